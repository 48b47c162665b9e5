"""References from samples of a smooth curve: values, velocities and accelerations to fourth order, against formulas."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.errors import InputError


def curve(name: str, t: np.ndarray) -> np.ndarray:
    """A product of exponentials by scipy."""
    group = lc.group(name)
    waves = [np.sin(t), t / 3, np.cos(t / 2), np.sin(2 * t) / 3, t**2 / 20, np.sin(t + 1)][: group.dim]
    found = np.repeat(np.eye(group.degree)[None], len(t), axis=0)
    for wave, matrix in zip(waves, group.basis, strict=True):
        found = found @ np.array([expm(x * matrix) for x in wave])
    return found


@pytest.mark.parametrize("name", ["so3", "se2", "h3", pytest.param("se3", marks=pytest.mark.slow)])
def test_samples_of_a_smooth_curve(name: str) -> None:
    group, fine = lc.group(name), np.linspace(0, 4, 201)
    errors = []
    for count in (21, 41):
        times = np.linspace(0, 4, count)
        made = lc.reference(name, times=times, samples=curve(name, times))
        X, xi, rate = run(made, fine)
        h = 1e-4
        before, after = curve(name, fine - h), curve(name, fine + h)
        here = curve(name, fine)
        velocity = np.linalg.solve(here, (after - before) / (2 * h))
        errors.append([np.max(np.abs(X - here)), np.max(np.abs(np.einsum("ki,ijl->kjl", xi, group.basis) - velocity))])
        np.testing.assert_allclose(np.gradient(xi, fine, axis=0)[2:-2], rate[2:-2], atol=0.05)
    slopes = np.log2(np.array(errors[0]) / np.array(errors[1]))
    assert slopes[0] > 3.3
    assert slopes[1] > 2.5
    assert errors[1][0] < 2e-4


def run(made: Any, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    from lie_codegen.control.reference_kernels import reference_kernel

    return lc.build(reference_kernel(made)).reference.batch(t)


def test_refusals_and_values() -> None:
    times = np.linspace(0, 1, 6)
    X = curve("so3", times)
    made = lc.reference("so3", times=times, samples=X)
    assert made == lc.reference("so3", times=times, samples=X)
    with pytest.raises(InputError, match="5 to 1024"):
        lc.reference("so3", times=times[:4], samples=X[:4])
    with pytest.raises(InputError, match="not both"):
        lc.reference("so3", times=times, samples=X, waypoints=X)
    law = lc.tracking_law("so3", inertia=[1, 2, 2], error="so3_right", gains={"K_p": 4, "K_d": 6})
    flown = lc.closed_loop("so3", inertia=[1, 2, 2], law=law, reference=made, X0=X[0], t=times)
    assert np.all(np.isfinite(flown.error))
