"""Magnus steps on lanes of floats: they are those of doubles up to what is stated, for every kind of input."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.errors import InputError
from lie_codegen.runtime.formula_input import fourier_input


def close(group: lc.MatrixGroup, u, t, **options) -> lc.Trajectory:
    """Single beside double precision: within the stated error, which is near what floats can do."""
    single = lc.simulate(group, u, t=t, precision="single", **options)
    double = lc.simulate(group, u, t=t, rtol=1e-10, **options)
    scale = max(1.0, float(np.max(np.abs(double.X))))
    off = float(np.max(np.abs(single.X - double.X)))
    assert single.X.dtype == double.X.dtype
    assert 1e-9 * scale < off <= single.error_estimate
    assert single.error_estimate <= 2e-5 * scale
    return single


@pytest.mark.parametrize("name", ["so3", "su2", "se3", "su3", "so7"])
def test_waves_of_many_trajectories(name: str) -> None:
    """21 are one vector of sixteen and a part of another; so7 takes its brackets as products of matrices."""
    group, rng = lc.group(name), np.random.default_rng(2)
    cosines, sines = rng.normal(size=(2, 21, 2, group.dim)) / np.sqrt(group.dim)
    starts = np.array([expm(group.hat(x)) for x in rng.normal(size=(21, group.dim)) / 3])
    u = fourier_input([1.3, 2.1 + 1e-9], cosines, sines)
    run = close(group, u, [0, 1.7, 6], X0=starts, eps=rng.uniform(0.3, 1, 21))
    assert run.X.shape == (3, 21, group.degree, group.degree)
    assert run.method == "magnus8"


def test_late_times_are_known_to_more_than_a_float() -> None:
    """A float knows 5000 to 2e-4; sines, corners of samples and pieces of functions there are where they belong."""
    so3, eps = lc.group("so3"), np.linspace(0.2, 1, 5)
    t = [5000.0, 5001.3, 5004.0]
    knots = 5000 + np.array([0, 0.7, 1.9, 2.2, 4])
    values = np.random.default_rng(3).normal(size=(5, 3))
    close(so3, ["cos(7*t)", "sin(11*t/10)", "1/3"], t, eps=eps)
    close(so3, lc.SampledInput(knots, values, between="linear"), t, eps=eps)
    close(so3, lambda s: np.array([np.exp(-((s - 5002) ** 2)), np.cos(3 * s), 0.5]), t, eps=eps)


def test_propagators_of_many_parameters_and_threads() -> None:
    u = lc.ParametricInput(["-2*a*cos(w*t)", "0", "-1"], parameters=("a", "w"))
    U = lc.propagator("su2", u, duration=50.0)
    amplitudes = np.linspace(0.1, 1, 100)
    double = U.batch(a=amplitudes, w=1.1)
    runs = [U.batch(a=amplitudes, w=1.1, precision="single", threads=threads) for threads in (1, 2)]
    np.testing.assert_array_equal(runs[0].X, runs[1].X)
    assert 1e-9 < np.max(np.abs(runs[0].X - double.X)) <= runs[0].error_estimate < 2e-5


def test_a_number_of_steps() -> None:
    so3, eps = lc.group("so3"), np.linspace(0.2, 1, 17)
    texts = ["cos(t)", "1/2", "sin(2*t)"]
    single, double = (
        lc.simulate(so3, texts, t=[0, 5], eps=eps, steps=40, method="magnus6", precision=precision)
        for precision in ("single", "double")
    )
    assert single.steps == double.steps == 40
    assert 1e-9 < np.max(np.abs(single.X - double.X)) < 3e-6


def test_what_it_does_not_go_with() -> None:
    so3, u, eps = lc.group("so3"), [0.1, 0.2, 0.3], [1.0, 2.0]
    for named, words in (
        ({"precision": "half", "eps": eps}, "double"),
        ({"precision": "single"}, "N trajectories"),
        ({"precision": "single", "eps": eps, "rtol": 1e-9}, "1e-06 at best"),
        ({"precision": "single", "eps": eps, "method": "rkmk4"}, "Magnus methods"),
    ):
        with pytest.raises(InputError, match=words):
            lc.simulate(so3, u, t=[0, 1], **named)
    with pytest.raises(InputError, match="feedback"):
        lc.simulate(so3, lambda t, X: np.array([X[0, 0], 0, 0]), t=[0, 1], precision="single")
