"""What a sample costs at most: operations from the caps of the loop, and the arrays on the stack."""

from __future__ import annotations

from dataclasses import dataclass

from lie_codegen.steering.ocp.source import SolverView, operations

#: A sweep is tried again with a larger shift three times; a roll-out at full length, the plan fed back, three shorter ones, one more.
_TRIES, _ROLLOUTS = 4, 6
#: Projected Newton steps of a stage's quadratic program.
_NEWTON = 25


@dataclass(frozen=True)
class Budget:
    """Of one sample.

    Attributes:
        usual: operations with one sweep and one roll-out an iteration, one Newton step a stage.
        worst: operations where every cap is reached.
        sweeps, rollouts: the caps.
        stack: bytes of local arrays in the deepest chain of calls.
    """

    usual: int
    worst: int
    sweeps: int
    rollouts: int
    stack: int


def budget_of(view: SolverView, iterations: int) -> Budget:
    """The budget of one sample of `iterations` iterations."""
    count = operations(view)
    s, N, m, nx = len(view.rk_a), view.intervals, view.m, view.nx
    nv, nc = nx + m, view.dim + nx + m
    inner = sum(1 for c in view.node_c if float(c.strip("()f")) not in (0.0, 1.0))
    stages = s * (count["model_stage_jacobian"] + 2 * nx * nx * nv + (4 + 2 * inner) * nx * nv)
    place = count["model_move"] + count["model_move_jacobian"] + 2 * view.dim * view.dim * nv
    if view.second_order:
        stages += s * (count["model_stage_hessian"] + 2 * nc * nv * (nc + nv) + 2 * nx * nx)
        stages += count.get("model_path_hessian", 0)
        place += count["model_move_hessian"] + 4 * view.dim * nv * (nv + view.dim) + count["model_cost_exact"]
    pulled = 2 * (2 * nv**3) + 2 * nv * nv
    stage = stages + (1 + inner) * (place + pulled) + len(view.node_c) * (count["model_cost_square"] + 2 * nv * nv)
    stage += count.get("model_path_jacobian", 0) + view.path * (2 * nv * nv + 2 * nv)
    newton = m**3 // 3 + 8 * m * m
    gains = nx * 2 * m * m + 4 * m * m * nx + 8 * m * nx * nx // 2
    sweep = N * (stage + newton + gains)
    longest = N * (stage + _NEWTON * (newton + 12 * 2 * m * m) + gains)
    step = s * (count["model_stage"] + (3 + 2 * inner) * nx) + (1 + inner) * count["model_move"]
    roll = step + count["model_difference"] + len(view.node_c) * count["model_cost"]
    roll += count.get("model_path", 0) + 6 * view.path + m * (2 * nx + 4)
    rollout = N * roll + count["model_end_cost"] + count.get("model_end", 0)
    shifts = 2 * N * step if view.durations else step
    after = 2 * N * count.get("model_path", 0) + shifts
    size = 4 if view.real == "float" else 8
    arrays = 4 * nv * nv + 2 * nv + nx * nv + nx * nx  # Q, W, H and the pulled-back block; gradients; J; P
    arrays += (
        s * (2 * nx + nx * nv + nx * nc)
        + (1 + inner) * nx * nv
        + 2 * view.dim**2
        + nx * nv
        + (m + nx) * nx
        + view.dim**2
    )  # the chain
    arrays += max(nc, nv) * nv + 3 * view.stored + view.path * (nv + 2) + view.end * (nx + 2) + 8 * m * m
    return Budget(
        usual=iterations * (sweep + rollout) + after,
        worst=iterations * (_TRIES * longest + _ROLLOUTS * rollout) + after,
        sweeps=iterations * _TRIES,
        rollouts=iterations * _ROLLOUTS,
        stack=arrays * size,
    )
