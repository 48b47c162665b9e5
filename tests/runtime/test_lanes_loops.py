"""Steps on the group: their order, and batches of their loops on lanes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.groups.maps.commutator_free import commutator_free_step
from lie_codegen.groups.maps.rkmk import rkmk4_step, wei_norman_step
from lie_codegen.runtime.build import build_kernels
from lie_codegen.runtime.compiler import find_compilers
from lie_codegen.runtime.library import Library

pytestmark = pytest.mark.skipif(not find_compilers(), reason="needs a C compiler")
STEPS = ("commutator_free_step", "rkmk4_step")


@pytest.fixture(scope="module", params=["so3", "se2", "su2"])
def made(request: pytest.FixtureRequest) -> Iterator[tuple[lc.MatrixGroup, Library]]:
    group = lc.group(request.param)
    kernels = [commutator_free_step(group), rkmk4_step(group), wei_norman_step(group)]
    return group, build_kernels(lambda: kernels)


def u(t: np.ndarray, n: int) -> np.ndarray:
    return np.stack([np.sin((k + 1) * t + k) for k in range(n)], axis=-1)


def sampled(n: int, steps: int, horizon: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    h = horizon / steps
    t = h * np.arange(steps)
    return u(t, n), u(t + h / 2, n), u(t + h, n), h


@pytest.mark.parametrize("name", STEPS)
def test_the_step_is_of_fourth_order_and_stays_on_the_group(made: tuple[lc.MatrixGroup, Library], name: str) -> None:
    group, lib = made
    d = group.degree
    basis = np.array([np.array(matrix.tolist(), dtype=complex) for matrix in group.basis])

    def field(t: float, x: np.ndarray) -> np.ndarray:
        hat = np.tensordot(u(np.array(t), group.dim), basis, 1)
        return (x.reshape(d, d) @ hat).ravel()

    exact = solve_ivp(field, (0, 2), np.eye(d, dtype=complex).ravel(), rtol=1e-12, atol=1e-13).y[:, -1].reshape(d, d)
    start = np.eye(d, dtype=complex if group.is_complex else float)
    errors = []
    for steps in (16, 32, 64):
        u0, um, u1, h = sampled(group.dim, steps, 2.0)
        errors.append(np.abs(lib[name].scan(start, u0, um, u1, h, n=steps)[-1] - exact).max())
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all((slopes > 3.7) & (slopes < 4.6)), (errors, slopes)


def test_a_constant_input_is_exact(made: tuple[lc.MatrixGroup, Library]) -> None:
    group, lib = made
    basis = np.array([np.array(matrix.tolist(), dtype=complex) for matrix in group.basis])
    v = np.linspace(-0.8, 0.9, group.dim)
    start = np.eye(group.degree, dtype=complex if group.is_complex else float)
    got = lib.commutator_free_step.scan(start, v, v, v, 0.1, n=10)[-1]
    np.testing.assert_allclose(got, expm(np.tensordot(v, basis, 1)), atol=1e-14)


@pytest.mark.parametrize("name", [*STEPS, "wei_norman_step"])
def test_many_trajectories_at_once(made: tuple[lc.MatrixGroup, Library], name: str) -> None:
    group, lib = made
    rng = np.random.default_rng(0)
    if name == "wei_norman_step":
        starts = rng.uniform(-0.3, 0.3, (11, group.dim))
    else:
        starts = np.eye(group.degree) + 0.1 * rng.normal(size=(11, group.degree, group.degree))
        starts = starts.astype(complex) if group.is_complex else starts
    u0, um, u1, h = sampled(group.dim, 20, 1.0)
    gains = rng.uniform(0.5, 1, (11, 1, 1))
    for every in (1, 5):
        together = lib[name].scan_batch(starts, u0[None], um[None], gains * u1, h, n=20, every=every)
        for start, gain, got in zip(starts, gains, together, strict=True):
            alone = lib[name].scan(start, u0, um, gain * u1, h, n=20, every=every)
            np.testing.assert_allclose(got, alone, rtol=1e-12, atol=1e-13)
