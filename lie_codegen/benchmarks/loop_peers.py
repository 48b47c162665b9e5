"""The tools of the attitude loops in `lie-codegen bench propagate`, each in a process of its own (`turns.py`).

    python -m lie_codegen.benchmarks.loop_peers TOOL MEMBERS RTOL

What is timed ends with the states in the tool's own form; matrices are made of them afterwards.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.benchmarks.loop_cases import START, LoopCase, loop_case, rate_of, states_of
from lie_codegen.benchmarks.rows import AbsentError
from lie_codegen.benchmarks.turns import Call, Read, answer, imported

Made = tuple[Call, Read]


def ours(case: LoopCase, rtol: float) -> Made:
    """lc.closed_loop with a law whose numbers are inputs."""
    from lie_codegen.control.attitude_law import attitude_law
    from lie_codegen.control.closed_loop import closed_loop

    X0 = states_of(START, np.zeros(3))[:9].reshape(3, 3)
    if len(case.k_p) == 1:
        law = attitude_law("pd", inertia=case.inertia[0], k_p=float(case.k_p[0]), k_d=float(case.k_d[0]))
        given: dict[str, Any] = {"law": law, "inertia": case.inertia[0], "xi0": case.xi0[0]}
    else:
        bodies = case.inertia[:, :, None] * np.eye(3)
        gains = {"k_p": case.k_p, "k_d": case.k_d}
        given = {"law": attitude_law("pd", tunable=True), "inertia": bodies, "gains": gains, "xi0": case.xi0}

    def read(run: Any) -> Array:
        shape = len(case.t), len(case.k_p)
        return np.concatenate([run.X.reshape(*shape, 9), run.xi.reshape(*shape, 3)], axis=-1)

    return lambda: closed_loop("so3", t=case.t, X0=X0, rtol=rtol, **given), read


def heyoka(case: LoopCase, rtol: float) -> Made:
    """Taylor series compiled for the loop; members eight at a time, their numbers its parameters."""
    hk = imported("heyoka")
    y = hk.make_vars(*[f"y{i}" for i in range(7)])
    rates = rate_of(hk.sqrt, hk.atan2)(*y, *(hk.par[k] for k in range(5)))
    system, bodies, starts = list(zip(y, rates, strict=True)), _bodies(case), _starts(case)
    if len(bodies) == 1:
        one = hk.taylor_adaptive(system, list(starts[0]), tol=rtol, pars=list(bodies[0]))

        def single() -> Array:
            one.time = 0.0
            one.state[:] = starts[0]
            return np.asarray(one.propagate_grid(case.t)[-1])

        return single, lambda grid: _states(grid[:, None])
    lanes = 8
    padded = -(-len(bodies) // lanes) * lanes
    starts, bodies = (np.resize(each, (padded, each.shape[1])) for each in (starts, bodies))
    many = hk.taylor_adaptive_batch(system, starts[:lanes].T.copy(), tol=rtol, pars=bodies[:lanes].T.copy())
    grid = np.repeat(case.t[:, None], lanes, 1)

    def batch() -> Array:
        found = np.empty((len(case.t), 7, padded))
        for first in range(0, padded, lanes):
            part = slice(first, first + lanes)
            many.set_time([0.0] * lanes)
            many.state[:] = starts[part].T
            many.pars[:] = bodies[part].T
            found[:, :, part] = many.propagate_grid(grid)[-1]
        return found

    return batch, lambda found: _states(np.swapaxes(found, 1, 2)[:, : len(case.k_p)])


def diffrax(case: LoopCase, rtol: float) -> Made:
    """Dopri8 with a PID controller, jitted; members by vmap."""
    jax = imported("jax")
    jax.config.update("jax_enable_x64", True)
    dfx, jnp = imported("diffrax"), imported("jax.numpy")
    rate, t = rate_of(jnp.sqrt, jnp.arctan2), jnp.asarray(case.t)

    def solve(start: Any, body: Any) -> Any:
        return dfx.diffeqsolve(
            dfx.ODETerm(lambda s, y, args: jnp.stack(rate(*y, *body))), dfx.Dopri8(), t[0], t[-1], 0.05, start, max_steps=10**6,
            stepsize_controller=dfx.PIDController(rtol=rtol, atol=rtol), saveat=dfx.SaveAt(ts=t),
        ).ys  # fmt: skip

    many = jax.jit(jax.vmap(solve))
    starts, bodies = jnp.asarray(_starts(case)), jnp.asarray(_bodies(case))
    return lambda: jax.block_until_ready(many(starts, bodies)), lambda found: _states(np.swapaxes(found, 0, 1))


def scipy(case: LoopCase, rtol: float) -> Made:
    """solve_ivp, DOP853."""
    return _solve_ivp(case, rtol, rate_of(math.sqrt, math.atan2))


def numba(case: LoopCase, rtol: float) -> Made:
    """The same with the right side compiled by numba."""
    return _solve_ivp(case, rtol, imported("numba").njit(rate_of(math.sqrt, math.atan2)))


def _solve_ivp(case: LoopCase, rtol: float, rate: Callable[..., tuple[Any, ...]]) -> Made:
    from scipy.integrate import solve_ivp

    if len(case.k_p) > 1:
        raise AbsentError("one trajectory at a time")
    body, start = [float(each) for each in _bodies(case)[0]], _starts(case)[0]

    def call() -> Array:
        run = solve_ivp(
            lambda t, y: rate(*y, *body), (0, case.t[-1]), start, method="DOP853", t_eval=case.t, rtol=rtol, atol=rtol
        )
        return np.asarray(run.y)

    return call, lambda y: _states(y.T[:, None])


def _bodies(case: LoopCase) -> Array:
    return np.column_stack([case.inertia, case.k_p, case.k_d])


def _starts(case: LoopCase) -> Array:
    return np.column_stack([np.tile(START, (len(case.xi0), 1)), case.xi0])


def _states(y: Any) -> Array:
    """(T, N, 12) of (T, N, 7)."""
    y = np.asarray(y)
    return states_of(y[..., :4], y[..., 4:])


TOOLS: Mapping[str, Callable[[LoopCase, float], Made]] = {
    "lie_codegen": ours, "heyoka": heyoka, "diffrax Dopri8": diffrax, "scipy DOP853": scipy, "scipy + numba": numba,
}  # fmt: skip


if __name__ == "__main__":
    answer(lambda: TOOLS[sys.argv[1]](loop_case(int(sys.argv[2])), float(sys.argv[3])))
