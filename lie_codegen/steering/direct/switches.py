"""Goals at the edge of what can be reached: pieces whose ends may move, where controls on equal pieces come near and no nearer.

Beyond the edge lie the ends that no controls reach; at the edge those of one control alone, which switches between its bounds at times
that no equal pieces have. Unknown are the durations s_k >= 0 of K arcs, of sum T, and their controls within the bounds:
    X = X0 E_1 ... E_K,   E_k = exp(s_k (a + sum_i u_ki b_i)).
Exact derivatives come from the chain with the coefficients (s_k, s_k u_k) of a and b; steps are Levenberg and Marquardt's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.direct.assemble import Manoeuvre, programme_of
from lie_codegen.steering.direct.chain import linearise
from lie_codegen.steering.direct.flight import fly
from lie_codegen.steering.direct.inputs import Drive, Inputs
from lie_codegen.steering.direct.polish import Flown
from lie_codegen.steering.direct.programme import Programme

_ITERATIONS = 80
#: Neighbours whose controls differ by less, relative to the bounds, are one arc.
_BLUR = 0.02
_THERE = 1e-10
#: Arcs below that part of the time are left out.
_BRIEF = 2e-3


def switched(task: Manoeuvre, near: Sequence[tuple[Array, int]]) -> tuple[Flown, int] | None:
    """Arcs near one of the given pieces (S, m), each for a variant of the goal, that end there; flown, with the variant.

    None where none were found, and for systems that depend on time, controls without bounds, or motions that the goal leaves free.
    """
    bounded = np.all(np.isfinite(task.low)) and np.all(np.isfinite(task.high))
    if not task.system.steady or not bounded or any(task.free_slots):
        return None
    for u, variant in near:
        bang = np.where(u < (task.low + task.high) / 2, task.low, task.high)
        for arcs in (_arcs(task, u, _BLUR), _arcs(task, bang, _BLUR)):
            durations, controls = _solved(task, *arcs, variant)
            # the piece in which a switch was shrinks without end: the steps get on when it is gone
            long = durations > _BRIEF * task.duration
            if not np.all(long) and np.any(long):
                durations, controls = _solved(task, durations[long], controls[long], variant)
            flown = _flown(task, durations, controls, variant)
            if flown.miss <= _THERE * max(1.0, float(np.max(np.abs(task.end.values)))):
                return flown, variant
    return None


def _arcs(task: Manoeuvre, u: Array, alike: float) -> tuple[Array, Array]:
    """Durations and mean controls of neighbouring pieces that differ by less than `alike`, relative to the bounds."""
    h = task.duration / len(u)
    durations, controls = [h], [u[0]]
    for row in u[1:]:
        if np.all(np.abs(row - controls[-1]) <= alike * (task.high - task.low)):
            total = durations[-1] + h
            controls[-1] = (durations[-1] * controls[-1] + h * row) / total
            durations[-1] = total
        else:
            durations.append(h)
            controls.append(row)
    return np.array(durations), np.array(controls)


def _programme(task: Manoeuvre, arcs: int) -> Programme:
    """Exponentials of s a + sum_i w_i b_i, one an arc, with m + 1 coefficients each."""
    system, m, now = task.system, task.controls, np.zeros(1)
    rows = np.concatenate([system.drift.at(now)[:, None], system.directions_at(now)], axis=1)
    wide = replace(task, low=np.full(m + 1, -np.inf), high=np.full(m + 1, np.inf), weights=np.ones(m + 1))
    directions = system.group.hat(rows)
    table = (np.zeros_like(directions[:, 0]), directions, np.zeros(arcs, int))
    return programme_of(wide, table, np.arange(arcs), np.tile([1.0, 0.0], (arcs, 1)), np.ones(arcs))


def _solved(task: Manoeuvre, s: Array, u: Array, variant: int) -> tuple[Array, Array]:
    """Durations (K,) and controls (K, m) that end nearest to the goal and add up to the time there is."""
    m, arcs = task.controls, len(s)
    programme, goal = _programme(task, arcs), task.goal(np.array([variant]))

    def equations(x: Array) -> tuple[Array, Array]:
        """Reduced residual and the total duration, and their derivative by s and u."""
        s, u = x[:arcs], x[arcs:].reshape(arcs, m)
        _, r, J = linearise(programme, goal, np.column_stack([s, s[:, None] * u])[None])
        rows = J[0].reshape(-1, arcs, m + 1)
        by_s = rows[:, :, 0] + np.einsum("nkm,km->nk", rows[:, :, 1:], u)
        by_u = (rows[:, :, 1:] * s[:, None]).reshape(len(rows), -1)
        clock = np.concatenate([np.full(arcs, 1 / task.duration), np.zeros(arcs * m)])
        return np.append(r[0], np.sum(s) / task.duration - 1), np.vstack([np.hstack([by_s, by_u]), clock])

    low = np.concatenate([np.zeros(arcs), np.tile(task.low, arcs)])
    high = np.concatenate([np.full(arcs, task.duration), np.tile(task.high, arcs)])
    # a step in s counts in units of the time there is, one in u in units of the bounds
    unit = np.concatenate([np.full(arcs, task.duration), np.tile(task.high - task.low, arcs)]) ** 2
    x, damped = np.concatenate([s, u.ravel()]), 1e-3
    r, J = equations(x)
    for _ in range(_ITERATIONS):
        size = float(np.linalg.norm(r))
        if size <= 1e-14 or damped > 1e8:
            break
        pull = J.T @ r
        open_ = ~(((x <= low) & (pull > 0)) | ((x >= high) & (pull < 0)))
        scaled = J * np.where(open_, unit, 0.0)
        K = scaled @ J.T
        K += (damped * np.trace(K) / len(K) + 1e-300) * np.eye(len(K))
        trial = np.clip(x - scaled.T @ np.linalg.solve(K, r), low, high)
        new_r, new_J = equations(trial)
        if np.linalg.norm(new_r) < size:
            x, r, J, damped = trial, new_r, new_J, max(damped / 5, 1e-13)
        else:
            damped *= 6
    return x[:arcs], x[arcs:].reshape(arcs, m)


def _flown(task: Manoeuvre, durations: Array, controls: Array, variant: int) -> Flown:
    """The arcs in the system's own time, their sum exactly the time there is."""
    there = durations > 1e-12 * task.duration
    durations, controls = durations[there], controls[there]
    if task.system.right:
        durations, controls = durations[::-1], controls[::-1]
    knots = np.concatenate([[0.0], np.cumsum(durations)])
    inputs = Inputs.constant(knots * (task.duration / knots[-1]), controls)
    X = fly(Drive(task.system, inputs))[1][-1]
    eye = np.eye(task.system.group.degree)
    miss = task.end.left @ X @ task.end.right - task.end.values[variant]
    return Flown(inputs, X, float(np.linalg.norm(miss)), (eye, eye))
