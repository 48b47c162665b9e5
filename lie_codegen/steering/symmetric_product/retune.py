"""2n numbers, 2n equations: (log(target^-1 X(T)), T xi(T)) = 0 by Newton, each Jacobian from one batch of 2n + 1 runs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow.logarithm import matrix_log
from lie_codegen.mechanics.states import initial_states, split_states
from lie_codegen.steering.symmetric_product.oscillation import Oscillation
from lie_codegen.steering.symmetric_product.steps import step_library

#: Steps a cycle of the fastest pair: while Newton is on its way, and at the end (error about 1e-11).
_COARSE, _FINE = 48, 640
_ITERATIONS = 14
_STEP = 1e-6
_SETTLED = 1e-7


@dataclass(frozen=True)
class Retuned:
    """What Newton gave.

    Attributes:
        oscillation: with its numbers.
        first_error: |(log, T xi)| before.
        error: after, by the compiled integrator.
        iterations: of Newton.
    """

    oscillation: Oscillation
    first_error: float
    error: float
    iterations: int


def retune(oscillation: Oscillation, target: Array, tolerance: float) -> Retuned | None:
    """The retuned oscillation; None where Newton does not get there."""
    first, count = float("nan"), 0
    for steps, goal in ((_COARSE, max(_SETTLED, tolerance)), (_FINE, min(1e-9, tolerance))):
        before = np.inf
        while True:
            numbers = oscillation.numbers
            scale = _STEP * max(1.0, float(np.abs(numbers).max()))
            trials = numbers + np.vstack([np.zeros(len(numbers)), scale * np.eye(len(numbers))])
            found = residuals(oscillation, trials, target, steps)
            if found is None:
                return None
            error = float(np.linalg.norm(found[0]))
            if count == 0:
                first = error
            if error <= goal:
                break
            if count >= _ITERATIONS or error > 2 * before:
                return None
            jacobian = (found[1:] - found[0]).T / scale
            change = np.linalg.lstsq(jacobian, -found[0], rcond=1e-12)[0]
            # a step is no longer than what the numbers are: far from the solution the linear model says little
            limit = 1.0 * max(0.3, float(np.linalg.norm(numbers)))
            change *= min(1.0, limit / float(np.linalg.norm(change)))
            oscillation = replace(oscillation, numbers=numbers + change)
            before, count = error, count + 1
    return Retuned(oscillation, first, error, count)


def residuals(oscillation: Oscillation, trials: Array, target: Array, steps: int) -> Array | None:
    """(k, 2n) of k sets of numbers; None where a run leaves the chart of the logarithm or the doubles."""
    body = oscillation.body
    group, n = body.group, body.group.dim
    total = int(np.ceil(steps * oscillation.cycles * max(oscillation.multiples, default=1)))
    start, _ = initial_states(group, None, None)
    x = np.arange(total) / total
    runs = step_library(group, len(body.forces)).oscillation_step.scan_batch(
        np.repeat(start, len(trials), axis=0), n=total, every=total, numbers=np.ascontiguousarray(trials),
        balance=_at_least_one(oscillation.balance), inertia=body.inertia, inverse=np.ascontiguousarray(body.inverse), damping=body.damping,
        lifts=np.ascontiguousarray(body.lifts), split=np.ascontiguousarray(body.decomposition),
        compensation=np.ascontiguousarray(body.compensation), duration=oscillation.duration, cycles=float(oscillation.cycles),
        x=x[None], h=1.0 / total,
    )  # fmt: skip
    ends = runs[:, -1]
    if not np.all(np.isfinite(ends)):
        return None
    X, xi = split_states(group, ends)
    result = np.empty((len(trials), 2 * n))
    for k in range(len(trials)):
        log, off = matrix_log(group, np.linalg.solve(target, X[k]))
        if not (np.all(np.isfinite(log)) and off < 1e-6):
            return None
        result[k] = np.concatenate([log, oscillation.duration * xi[k]])
    return result


def _at_least_one(balance: Array) -> Array:
    return np.ascontiguousarray(balance) if len(balance) else np.ones(1)
