"""X' = X hat(xi), J xi' = ad*_xi J xi + f(t) from rest or any velocity, by RKMK4 in compiled loops."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError
from lie_codegen.flow.grid import Grid, refine, sample
from lie_codegen.flow.inputs import Signal, as_signal
from lie_codegen.flow.rollout import BLOCK
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.damped_run import damped_run
from lie_codegen.mechanics.states import initial_states, split_states
from lie_codegen.runtime.build import build_kernels
from lie_codegen.runtime.call import Compiled
from lie_codegen.runtime.library import Library
from lie_codegen.shapes import shaped

if TYPE_CHECKING:
    from lie_codegen.kernel.kernel import Kernel

_LARGEST_MOVE = 0.25
_MOST_STEPS = 2**21


@dataclass(frozen=True, eq=False, repr=False)
class Driven(Saved):
    """A solution of X' = X hat(xi), J xi' = ad*_xi J xi + f(t).

    Attributes:
        t: (k,) times.
        X: (k, d, d) configurations.
        xi: (k, n) body velocities.
        error_estimate: difference to the run with half the steps, over 15 (Richardson).
        steps: that were taken.
    """

    t: Array
    X: Array
    xi: Array
    error_estimate: float
    steps: int = 0


@lru_cache(maxsize=32)
def _library(group: MatrixGroup) -> Library:
    def kernels() -> list[Kernel]:
        from lie_codegen.mechanics.driven_step import driven_step

        return [driven_step(group)]

    return build_kernels(kernels, namespace=group.name, definition=f"driven\n{group.definition_text}")


def simulate_driven(
    group: GroupLike,
    force: Any,
    inertia: Array,
    *,
    t: ArrayLike,
    xi0: ArrayLike | None = None,
    tolerance: float = 1e-11,
    damping: ArrayLike | None = None,
) -> Driven:
    """The motion under a body force given in time, and a drag -D xi if there is one, from X = I at t[0].

    Args:
        group: the group.
        force: f(t) -> (n,), vectorised or not; an attribute `breakpoints` names the times at which it is not smooth.
        inertia: (n, n) symmetric positive definite.
        t: (k,) increasing times.
        xi0: (n,) initial body velocity, zero if not given.
        tolerance: on the entries of X and xi, relative to the largest one or 1; of each step where there is a drag.
        damping: (n, n) D; none if not given. With it an explicit method of order 8 runs in Python.

    Raises:
        ShapeError: an argument of another shape, named.
        ComputationError: the tolerance is not met with two million steps, or the state is no longer finite.
    """
    group = as_group(group, "simulate_driven")
    times, n = shaped(t, ("k",), "simulate_driven: t"), group.dim
    signal = as_signal(group, force, times)
    start = initial_states(group, None, xi0)[0][0]
    J = np.ascontiguousarray(shaped(inertia, (n, n), "simulate_driven: inertia"))
    if damping is not None and np.any(damping):
        D = shaped(damping, (n, n), "simulate_driven: damping")
        return Driven(times, *damped_run(group, force, J, D, times, start[-group.dim :], tolerance))
    inverse = np.ascontiguousarray(np.linalg.inv(J))
    step = _library(group).driven_step
    grid, coarse = Grid.coarse(times, signal.breakpoints), None
    while True:
        states, move = _run(step, grid, signal, start, {"inertia": J, "inverse": inverse}, group.dim)
        if coarse is not None and np.isfinite(move):
            estimate = float(np.max(np.abs(states - coarse))) / 15
            scale = max(1.0, float(np.max(np.abs(states))))
            if move <= _LARGEST_MOVE and estimate <= max(tolerance * scale, 4e-16 * scale * np.sqrt(grid.steps)):
                return Driven(times, *split_states(group, states), estimate, grid.steps)
        if 2 * grid.steps > _MOST_STEPS and not np.isfinite(move):
            raise ComputationError(f"simulate_driven({group.name}): the solution left the range of double precision")
        coarse = states if np.isfinite(move) else None
        grid = refine(grid, _MOST_STEPS, group.name)


def _run(
    step: Compiled[Any], grid: Grid, force: Signal, start: Array, inertias: dict[str, Array], n: int
) -> tuple[Array, float]:
    """The states at the output times, and the largest |h xi|; infinite where the state is not finite."""
    kept, move, current = [start[None]], 0.0, start
    block = BLOCK // grid.parts * grid.parts or grid.parts
    for first in range(0, grid.steps, block):
        last = min(first + block, grid.steps)
        f0, fm, f1, h = sample(force, grid, first, last)
        three = {name: np.ascontiguousarray(values) for name, values in (("f0", f0), ("fm", fm), ("f1", f1))}
        run = step.scan(current, n=last - first, every=1, **inertias, **three, h=h)
        kept.append(run[grid.parts :: grid.parts])
        current = run[-1]
        if not np.all(np.isfinite(run)):
            move = np.inf
        else:
            move = max(move, float(np.max(h * np.linalg.norm(run[:-1, -n:], axis=1))))
    return np.concatenate(kept)[grid.at], move
