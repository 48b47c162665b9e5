"""Steps on the group SO(3) itself: Munthe-Kaas and commutator-free, the exponential a Taylor polynomial."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.benchmarks import peers as peers
from lie_codegen.benchmarks.rows import Entrant, Row, Work, compete
from lie_codegen.groups.catalogue_load import group as load
from lie_codegen.groups.maps.commutator_free import commutator_free_step
from lie_codegen.groups.maps.rkmk import rkmk4_step
from lie_codegen.runtime.build import build_kernels
from lie_codegen.runtime.formula_input import fourier_input

STEPS, H, KEPT = 20_000, 1e-3, 100
_LONG = 10**6


def group_row(folder: Path, rounds: int) -> Row:
    """One trajectory of which every hundredth state is kept; beside it, how orthogonal it is after a million steps."""
    row = compete("trajectory", f"so3 RKMK4, {STEPS} steps", "ns a step", STEPS, rounds, list(_entrants(folder)))
    return replace(row, note=f"|X'X - I| after 10^6 steps: {_orthogonality():.1e}")


def _series() -> Any:
    phases = np.arange(3.0)
    return fourier_input([1.0], [0.3 * np.sin(phases)], [0.3 * np.cos(phases)])


def _orthogonality() -> float:
    step = build_kernels(lambda: [rkmk4_step(load("so3"))]).rkmk4_step
    X = step.drive(np.eye(3), _series(), n=_LONG, h=H, every=_LONG)[-1]
    return float(np.max(np.abs(X.T @ X - np.eye(3))))


def _entrants(folder: Path) -> Iterator[Entrant]:
    so3 = load("so3")
    kernel = rkmk4_step(so3)
    step = build_kernels(lambda: [kernel]).rkmk4_step
    free = build_kernels(lambda: [commutator_free_step(so3)]).commutator_free_step
    t = H * np.arange(STEPS)[:, None]
    us = [np.ascontiguousarray(0.3 * np.sin(t + shift + [0, 1, 2])) for shift in (0, H / 2, H)]
    start, hs, theirs = np.eye(3), np.array([H]), np.empty((STEPS + 1, 3, 3))
    last = slice(-9, None)

    def by_casadi_c() -> Work:
        loop, _ = peers.as_casadi_c(kernel, folder)
        given, strides = peers.pointers([start, *us, hs]), peers.sizes([0, 3, 3, 3, 0])

        def work() -> Array:
            loop.bench_scan(ctypes.c_ssize_t(STEPS), given, strides, ctypes.c_void_p(theirs.ctypes.data))
            return theirs[::KEPT]

        return work

    def by_numba() -> Work:
        peers.need("numba")
        scan = peers.as_python(kernel, folder, "math", scalars=True).scan
        trajectory = theirs.reshape(-1, 9)

        def work() -> Array:
            scan(start.ravel(), *us, H, trajectory)
            return theirs[::KEPT]

        return work

    def by_jaxlie() -> Work:
        jax, jnp = peers.jax_modules()
        jaxlie = peers.need("jaxlie")

        def rate(theta: Any, u: Any) -> Any:
            once = jnp.cross(theta, u)
            return u + once / 2 + jnp.cross(theta, once) / 12

        def move(X: Any, u: Any) -> Any:
            u0, um, u1 = u
            k2 = rate(H / 2 * u0, um)
            k3 = rate(H / 2 * k2, um)
            k4 = rate(H * k3, u1)
            return X @ jaxlie.SO3.exp(H / 6 * (u0 + 2 * (k2 + k3) + k4)), None

        run = jax.jit(lambda u: jax.lax.scan(move, jaxlie.SO3.identity(), u)[0].as_matrix())
        arrays = tuple(jnp.asarray(u) for u in us)
        return lambda: jax.block_until_ready(run(arrays))

    yield Entrant("lie_codegen", lambda: lambda: step.scan(start, *us, H, n=STEPS, every=KEPT))
    yield Entrant(
        "lie_codegen, u evaluated in C", lambda: lambda: step.drive(start, _series(), n=STEPS, h=H, every=KEPT)
    )
    yield Entrant("lie_codegen, commutator-free", lambda: lambda: free.scan(start, *us, H, n=STEPS, every=KEPT))
    yield Entrant("CasADi's C in a loop", by_casadi_c)
    yield Entrant("numba", by_numba)
    yield Entrant("jaxlie in jax scan", by_jaxlie, part=last)
