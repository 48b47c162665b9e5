"""lc.vibration_feedback: the closed loop by scipy, published decay, refusals; the compiled law is its formula."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm, logm

import lie_codegen as lc
from lie_codegen.errors import InputError, UncontrollableError


def closed(name, J, controls, frequency, start, end=20.0):
    """|log X| at the last zero of U before `end`, from rest."""
    group = lc.group(name)
    law = lc.vibration_feedback(name, inertia=J, controls=controls, k_p=1, k_d=2, frequency=frequency)
    force = lc.build([law]).vibration_feedback
    c, d, inertia = group.algebra.structure_constants, group.degree, np.diag(J)
    X, xi, period = expm(group.hat(start)), np.zeros(group.dim), 2 * np.pi / frequency
    for _ in range(int(end / period)):
        held = X.copy(), xi.copy()

        def rate(s, y, held=held):
            z = y[d * d :]
            turned = np.einsum("i,ijk,k->j", z, c, inertia @ z)
            return np.concatenate(
                [(y[: d * d].reshape(d, d) @ group.hat(z)).ravel(), np.linalg.solve(inertia, turned + force(*held, s))]
            )

        y = solve_ivp(rate, (0, period), np.concatenate([X.ravel(), xi]), method="DOP853", rtol=1e-9, atol=1e-12).y[
            :, -1
        ]
        X, xi = y[: d * d].reshape(d, d), y[d * d :]
    return np.linalg.norm(group.vee(np.real(logm(X))))


@pytest.mark.parametrize(
    ("name", "J", "controls", "size"),
    [("so3", (3, 2, 1), ("w1", "w2"), 9.3e-7), ("se2", (1, 2, 2), ("omega", "vx"), 1.0e-6)],
)
def test_decay_to_the_identity(name, J, controls, size):
    assert closed(name, J, controls, 10, (0.5, -0.4, 0.8)) == pytest.approx(size, rel=0.05)


def test_the_law_is_its_formula():
    """SO(3), J = (3, 2, 1): <Y1 : Y2> = (J2 - J1) / (J1 J2 J3) e3, squares zero."""
    law = lc.vibration_feedback("so3", inertia=(3, 2, 1), controls=("w1", "w2"), k_p=1.5, k_d=3, frequency=30)
    X, xi, s = expm(lc.group("so3").hat((0.2, -0.1, 0.4))), np.array([0.3, 0.1, -0.2]), 0.05
    eta = -1.5 * np.array((0.2, -0.1, 0.4)) - 3 * xi
    c = eta[2] / ((2 - 3) / 6)
    p = np.sqrt(2 * abs(c))
    wave = 30 * np.cos(30 * s)
    expected = (3 * eta[0] + p * wave, 2 * eta[1] - np.sign(c) * p * wave, 0)
    np.testing.assert_allclose(lc.build([law]).vibration_feedback(X, xi, s), expected, rtol=1e-12)


def test_refusals():
    with pytest.raises(InputError, match=r"diverges; frequency at least 8\.98"):
        lc.vibration_feedback("so3", inertia=(3, 2, 1), controls=("w1", "w2"), frequency=5)
    with pytest.raises(UncontrollableError, match="nothing turns w3"):
        lc.vibration_feedback("so3", inertia=(2, 2, 1), controls=("w1", "w2"))
    with pytest.raises(InputError, match="controls"):
        lc.vibration_feedback("so3", inertia=(3, 2, 1))
    with pytest.raises(InputError, match="k_p"):
        lc.vibration_feedback("so3", inertia=(3, 2, 1), controls=("w1", "w2"), k_p=-1)


def test_the_law_is_a_value():
    laws = [lc.vibration_feedback("so3", inertia=(3, 2, 1), controls=("w1", "w2"), frequency=f) for f in (20, 20, 30)]
    assert laws[0] == laws[1]
    assert laws[0] != laws[2]
