"""Runs of mechanical systems in the compiled loop: halve the step until two runs agree."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError, InputError
from lie_codegen.flow.grid import Grid, refine
from lie_codegen.groups.maps.element_pattern import packed_size
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.mechanical_system import MechanicalSystem
from lie_codegen.mechanics.states import initial_states, split_states
from lie_codegen.runtime.call import Compiled

_MOST_STEPS = 2**23
#: Steps whose states are held at once.
_BLOCK = 2**16
_LARGEST_MOVE = 0.25


@dataclass(frozen=True, eq=False, repr=False)
class GroupRun(Saved):
    """A motion on a group.

    Attributes:
        t: (k,) times.
        X: (k, d, d) configurations.
        xi: (k, n) velocities.
        advected: (k, m) advected vectors, one after another.
        error_estimate: difference to the run with twice the step, over 15 (Richardson).
    """

    t: Array
    X: Array
    xi: Array
    advected: Array
    error_estimate: float


def states_of(t: ArrayLike) -> Array:
    """(k,) times; a number is the end of a run from 0.

    Raises:
        InputError: not increasing, or not finite.
    """
    times = np.asarray(t, dtype=float)
    if times.ndim == 0:
        times = np.array([0.0, float(times)])
    if times.ndim != 1 or len(times) < 2 or not np.all(np.isfinite(times)) or np.any(np.diff(times) <= 0):
        raise InputError("t: at least two increasing finite times, or the end of a run from 0")
    return times


def run(
    system: MechanicalSystem,
    step: Compiled[Any],
    X0: ArrayLike,
    xi0: ArrayLike,
    times: Array,
    numbers: Mapping[str, Any],
    eps: float,
    tolerance: float,
    largest: float,
) -> GroupRun:
    """The states at the times.

    Args:
        step: (state, .., h), or (state, tau, .., h) for a system that depends on the fast time t / eps.
        numbers: of the inputs of the step that stay.
        largest: a step is never longer.

    Raises:
        NotOnGroupError: X0 is off the group.
        ComputationError: the tolerance is not met with eight million steps, or the state is no longer finite.
    """
    group = system.group
    packed, many = initial_states(group, X0, xi0)
    if many:
        raise InputError("one start at a time: X0 (d, d) and xi0 (n,)")
    X, _ = split_states(group, packed)
    start = np.concatenate([packed[0], system.seen(X)[0]])
    grid, coarse = Grid.coarse(times, np.zeros(0)), None
    while grid.largest_step > largest:
        grid = refine(grid, _MOST_STEPS, group.name)
    while True:
        states, move = _states(step, grid, start, numbers, eps, (group.dim, packed_size(group)))
        if coarse is not None and np.isfinite(move):
            estimate = float(np.max(np.abs(states - coarse))) / 15
            scale = max(1.0, float(np.max(np.abs(states))))
            if move <= _LARGEST_MOVE and estimate <= max(tolerance * scale, 4e-16 * scale * np.sqrt(grid.steps)):
                X, xi = split_states(group, states)
                return GroupRun(times, X, xi, states[:, packed_size(group) + group.dim :].copy(), estimate)
        if 2 * grid.steps > _MOST_STEPS:
            raise ComputationError(
                f"{step.name}({group.name}): {_MOST_STEPS} steps do not reach the tolerance, or the motion left the range of doubles"
            )
        coarse = states if np.isfinite(move) else None
        grid = refine(grid, _MOST_STEPS, group.name)


def _states(
    step: Compiled[Any], grid: Grid, start: Array, numbers: Mapping[str, Any], eps: float, sizes: tuple[int, int]
) -> tuple[Array, float]:
    """The states at the output times, and the largest |h xi| at the ends of spans; infinite where a state is not finite."""
    (n, size), kept, current, move = sizes, [start[None]], start, 0.0
    fast = any(port.name == "tau" for port in step.inputs)
    h = np.repeat(np.diff(grid.knots) / grid.parts, grid.parts)
    begin = (grid.knots[:-1, None] + (np.diff(grid.knots) / grid.parts)[:, None] * np.arange(grid.parts)).ravel()
    block = max(grid.parts, _BLOCK // grid.parts * grid.parts)
    for first in range(0, grid.steps, block):
        here = slice(first, min(first + block, grid.steps))
        more = {"tau": np.ascontiguousarray(begin[here] / eps)} if fast else {}
        states = step.scan(
            current, n=here.stop - first, every=grid.parts, h=np.ascontiguousarray(h[here]), **numbers, **more
        )
        if not np.all(np.isfinite(states)):
            return np.zeros((len(grid.at), len(start))), np.inf
        move = max(move, float(h[here].max() * np.abs(states[:, size : size + n]).max(initial=0.0)))
        kept.append(states[1:])
        current = np.ascontiguousarray(states[-1])
    return np.concatenate(kept)[grid.at], move
