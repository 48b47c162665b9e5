"""What a mechanical system on a group and its average refuse, in one line."""

from __future__ import annotations

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.errors import ExpressionError, InputError, ShapeError
from lie_codegen.kernel.kernel import Kernel, Port

GRAVITY = {"G": ("direction", (0, 0, 1))}


@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        ({"inputs": [["xi1*G2", "0", "0"]]}, InputError, ["input 1", "depends on xi"]),
        ({"force": ["xi1^2*xi2", "0", "0"]}, InputError, ["force", "degree 3", "quadratic"]),
        ({"inertia": (3, -2, 1)}, InputError, ["inertia", "not positive definite"]),
        ({"force": ["9.81*X12", "0", "0"]}, ExpressionError, ["X12", "advected"]),
        ({"force": ["sin(G1)", "0", "0"]}, InputError, ["no polynomial"]),
        ({"force": ["G1", "0"]}, ShapeError, ["3 formulas"]),
        ({"advected": {"G": ("vector", (0, 0, 1))}}, InputError, ["direction", "momentum"]),
        ({"advected": {"G": ("direction", (0, 1))}}, ShapeError, ["3 entries"]),
        ({"advected": {"xi": ("direction", (0, 0, 1))}}, InputError, ["clash"]),
    ],
)
def test_a_system_that_cannot_be(given, error, words):
    with pytest.raises(error) as caught:
        lc.mechanical_system("so3", **{"inertia": (3, 2, 1), "advected": GRAVITY, **given})
    assert all(word in str(caught.value) for word in words)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("u", "options", "words"),
    [
        (["1 + cos(t)", "sin(t)"], {}, ["mean", "mean_to_drift"]),
        (["cos(t)", "sin(t)"], {"order": 6}, ["order 6", "5"]),
        (["cos(t)", "sin(t)"], {"order": 0}, ["positive integer"]),
        (["cos(t)"], {}, ["1 components", "2 inputs"]),
        (["cos(t)", "sin(t)"], {"gauge": "mean"}, ["no gauge", "zero_mean"]),
    ],
)
def test_an_average_that_cannot_be(u, options, words):
    system = lc.mechanical_system("so3", inertia=(3, 2, 1), inputs=["w1", "w2"])
    with pytest.raises(InputError) as caught:
        lc.vibrational_average(system, lc.PeriodicInput(u), **options)
    assert all(word in str(caught.value) for word in words)


def test_a_jumping_input_is_refused():
    system = lc.mechanical_system("so3", inertia=(3, 2, 1), inputs=["w1"])
    square = lc.PeriodicInput.from_pieces([("1", ["1"]), ("2", ["-1"])])
    with pytest.raises(InputError, match="sines and cosines"):
        lc.vibrational_average(system, square)


def test_arguments_of_an_average_are_checked():
    system = lc.mechanical_system("so3", inertia=(3, 2, 1), inputs=["w1"], advected=GRAVITY)
    average = lc.vibrational_average(system, lc.PeriodicInput(["cos(t)"]), order=2)
    with pytest.raises(InputError, match="order 1 to 2"):
        average.term(3, (0, 0, 0), G=(0, 0, 1))
    with pytest.raises(InputError, match="G needed"):
        average.term(1, (0, 0, 0))
    with pytest.raises(ShapeError, match=r"give \(\.\.\., 3\)"):
        average.term(1, (0, 0), G=(0, 0, 1))
    with pytest.raises(ShapeError, match="G has shape"):
        average.term(1, (0, 0, 0), G=(0, 1))
    with pytest.raises(InputError, match="positive"):
        average.estimate(np.eye(3), (0, 0, 0), 0.0, 0.0)
    with pytest.raises(InputError, match="increasing"):
        average.solve(np.eye(3), (0, 0, 0), [1, 0], 0.1)


def test_mean_to_drift_is_a_constant_force():
    with_mean = lc.mechanical_system("so3", inertia=(3, 2, 1), inputs=["w1"])
    with_force = lc.mechanical_system("so3", inertia=(3, 2, 1), inputs=["w1"], force=["1/2", "0", "0"])
    a = lc.vibrational_average(with_mean, lc.PeriodicInput(["1/2 + cos(t)"]), order=3, mean_to_drift=True)
    b = lc.vibrational_average(with_force, lc.PeriodicInput(["cos(t)"]), order=3)
    xi = (0.3, -0.1, 0.7)
    np.testing.assert_allclose(a.rate(xi, 0.2), b.rate(xi, 0.2), rtol=1e-14)


def test_a_kernel_may_be_the_force():
    def body(ops, xi, G):
        return ([9.81 * G[1] - 0.1 * xi[0], -9.81 * G[0], 0.3 * xi[1] * xi[2]],)

    kernel = Kernel("force", "mine", (Port("xi", (3,)), Port("G", (3,))), (Port("f", (3,)),), body)
    texts = ["9.81*G2 - 0.1*xi1", "-9.81*G1", "0.3*xi2*xi3"]
    row = [["G2", "-G1", "0"]]
    systems = [
        lc.mechanical_system("so3", inertia=(3, 2, 1), advected=GRAVITY, force=force, inputs=row)
        for force in (kernel, texts)
    ]
    first, second = (lc.vibrational_average(s, lc.PeriodicInput(["cos(t)"]), order=2) for s in systems)
    np.testing.assert_allclose(
        first.rate((1, 2, 3), 0.1, G=(0, 1, 0)), second.rate((1, 2, 3), 0.1, G=(0, 1, 0)), rtol=1e-12
    )
