"""RK4 of the SO(3) Wei-Norman equations: one trajectory of 10^4 steps, and many at once."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.benchmarks import peers as peers
from lie_codegen.benchmarks.diffrax_peer import diffrax_solve
from lie_codegen.benchmarks.rows import AbsentError, Entrant, Row, Work, compete
from lie_codegen.groups.catalogue_load import group as load
from lie_codegen.groups.maps.rkmk import wei_norman_step
from lie_codegen.kernel.casadi_arithmetic import function_of
from lie_codegen.runtime.build import build_kernels
from lie_codegen.runtime.formula_input import fourier_input

STEPS, H = 10_000, 1e-3
COUNT, SHORT = 2_000, 200
#: Slow ones do this part of the steps.
_PART = 0.02


def inputs(steps: int) -> tuple[Array, Array, Array]:
    """u_i = 0.3 sin(t + i) at the start, the middle and the end of each step."""
    t = H * np.arange(steps)[:, None]
    u0, um, u1 = (np.ascontiguousarray(0.3 * np.sin(t + shift + [0, 1, 2])) for shift in (0, H / 2, H))
    return u0, um, u1


def field(m: Any, s: Any, x: Any, stack: Callable[[list[Any]], Any]) -> Any:
    """g' = M(g) u(s), as an engineer writes it; `m` has sin and cos."""
    u = [0.3 * m.sin(s + i) for i in range(3)]
    c, d = m.cos(x[2]), m.sin(x[2])
    top = (u[0] * c - u[1] * d) / m.cos(x[1])
    return stack([top, u[0] * d + u[1] * c, u[2] - m.sin(x[1]) * top])


def trajectory_row(folder: Path, hand: ctypes.CDLL, rounds: int) -> Row:
    """One trajectory, every step kept."""
    return compete("trajectory", f"so3 RK4, {STEPS} steps", "ns a step", STEPS, rounds, list(_one(folder, hand)))


def monte_carlo_row(folder: Path, hand: ctypes.CDLL, rounds: int) -> Row:
    """Many trajectories from different starts, the last state kept."""
    what = f"so3 RK4, {COUNT} x {SHORT}"
    return compete("Monte Carlo", what, "ns a step", COUNT * SHORT, rounds, list(_many(folder, hand)))


def _one(folder: Path, hand: ctypes.CDLL) -> Iterator[Entrant]:
    kernel = wei_norman_step(load("so3"))
    step = build_kernels(lambda: [kernel]).wei_norman_step
    g, hs, us = np.zeros(3), np.array([H]), inputs(STEPS)
    ours, theirs = np.empty((STEPS + 1, 3)), np.empty((STEPS + 1, 3))

    def by_hand() -> Work:
        addresses = [ctypes.c_void_p(array.ctypes.data) for array in (g, *us)]

        def work() -> Array:
            hand.hand_scan(ctypes.c_ssize_t(STEPS), *addresses, ctypes.c_double(H), ctypes.c_void_p(theirs.ctypes.data))
            return theirs

        return work

    def by_casadi_c() -> Work:
        loop, _ = peers.as_casadi_c(kernel, folder)
        given, strides = peers.pointers([g, *us, hs]), peers.sizes([0, 3, 3, 3, 0])

        def work() -> Array:
            loop.bench_scan(ctypes.c_ssize_t(STEPS), given, strides, ctypes.c_void_p(theirs.ctypes.data))
            return theirs

        return work

    def by_numba() -> Work:
        peers.need("numba")
        scan = peers.as_python(kernel, folder, "math", scalars=True).scan

        def work() -> Array:
            scan(g, *us, H, theirs)
            return theirs

        return work

    def by_jax() -> Work:
        jax, jnp = peers.jax_modules()
        move = peers.as_python(kernel, folder, "jax.numpy", scalars=False).point
        scan = jax.jit(lambda x, u: jax.lax.scan(lambda s, v: (move(s, *v, H)[0],) * 2, x, u)[1])
        first, arrays = jnp.asarray(g), tuple(jnp.asarray(u) for u in us)
        return lambda: _from_start(g, jax.block_until_ready(scan(first, arrays)))

    def by_mapaccum() -> Work:
        accumulated = function_of(kernel).mapaccum(STEPS)
        columns = [np.ascontiguousarray(u.T) for u in us]
        return lambda: _from_start(g, accumulated(g, *columns, H).full().T)

    yield Entrant("lie_codegen", lambda: lambda: step.scan(g, *us, H, n=STEPS, out=ours))
    yield Entrant("lie_codegen, u evaluated in C", lambda: lambda: step.drive(g, _series(), n=STEPS, h=H))
    yield Entrant("hand-written C", by_hand)
    yield Entrant("CasADi's C in a loop", by_casadi_c)
    yield Entrant("CasADi mapaccum, interpreted", by_mapaccum)
    yield Entrant("numba", by_numba)
    yield Entrant("jax scan", by_jax)
    few, last, end = int(STEPS * _PART), slice(-3, None), slice(3 * int(STEPS * _PART), 3 * int(STEPS * _PART) + 3)
    yield Entrant("diffrax, the same RK4", lambda: diffrax_solve(field, g, STEPS, H), part=last)
    yield Entrant("CasADi integrator('rk')", lambda: _casadi_integrator("rk", STEPS), part=last)
    yield Entrant("CasADi integrator('cvodes')", lambda: _casadi_integrator("cvodes", STEPS), 1, 1e-5, last)
    yield Entrant("scipy solve_ivp, max_step = h", lambda: _solve_ivp(few), _PART, 1e-6, end)


def _many(folder: Path, hand: ctypes.CDLL) -> Iterator[Entrant]:
    kernel = wei_norman_step(load("so3"))
    step = build_kernels(lambda: [kernel]).wei_norman_step
    starts = np.random.default_rng(0).uniform(-0.3, 0.3, (COUNT, 3))
    u = [each[0] for each in inputs(1)]
    hs, target = np.array([H]), np.empty((COUNT, 2, 3))

    def by_c(run: Callable[[Array], object]) -> Work:
        def work() -> Array:
            states = starts.copy()
            run(states)
            return states

        return work

    def by_casadi_c() -> Work:
        loop, _ = peers.as_casadi_c(kernel, folder)
        given = peers.pointers([*u, hs])
        sizes = ctypes.c_ssize_t(COUNT), ctypes.c_ssize_t(SHORT)
        return by_c(lambda states: loop.bench_many(*sizes, given, ctypes.c_void_p(states.ctypes.data)))

    def by_numba() -> Work:
        peers.need("numba")
        many = peers.as_python(kernel, folder, "math", scalars=True).many
        return by_c(lambda states: many(states, *u, H, SHORT))

    def by_jax() -> Work:
        jax, jnp = peers.jax_modules()
        move = peers.as_python(kernel, folder, "jax.numpy", scalars=False).point
        constant = [jnp.asarray(each) for each in u]
        whole = jax.jit(lambda xs: jax.lax.fori_loop(0, SHORT, lambda _, s: move(s, *constant, H)[0], xs))
        several = jnp.asarray(starts)
        return lambda: jax.block_until_ready(whole(several))

    def by_lanes() -> Work:
        def work() -> Array:
            made: Array = step.scan_batch(starts, *u, H, n=SHORT, every=SHORT, out=target)
            return made[:, -1]

        return work

    yield Entrant("lie_codegen", by_lanes)
    yield Entrant("CasADi's C in a loop", by_casadi_c)
    yield Entrant("numba", by_numba)
    yield Entrant("jax, batched", by_jax)


def _series() -> Any:
    phases = np.arange(3.0)
    return fourier_input([1.0], [0.3 * np.sin(phases)], [0.3 * np.cos(phases)])


def _from_start(start: Array, states: Any) -> Array:
    return np.concatenate([start[None], np.asarray(states)])


def _casadi_integrator(name: str, steps: int) -> Work:
    import casadi as ca

    x, t = ca.SX.sym("x", 3), ca.SX.sym("t")
    dae = {"x": x, "t": t, "ode": field(ca, t, x, lambda rows: ca.vertcat(*rows))}
    # cvodes is held to steps of h too; left alone it would take a few dozen.
    options = (
        {"number_of_finite_elements": steps} if name == "rk" else {"max_step_size": H, "max_num_steps": 10 * steps}
    )
    try:
        solver = ca.integrator("f", name, dae, 0.0, steps * H, options)
    except RuntimeError as error:
        raise AbsentError(f"this CasADi has no {name}") from error
    start = np.zeros(3)
    return lambda: solver(x0=start)["xf"].full()


def _solve_ivp(steps: int) -> Work:
    from scipy.integrate import solve_ivp

    def rate(s: float, x: Array) -> Array:
        return np.asarray(field(math, s, x, np.array))

    def work() -> Array:
        return np.asarray(solve_ivp(rate, (0, steps * H), np.zeros(3), max_step=H).y[:, -1])

    return work
