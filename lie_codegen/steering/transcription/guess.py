"""First guesses for the transcription: the exact optimum without constraints, a straight path, the area rule."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.errors import ComputationError
from lie_codegen.steering.seeds import coordinates, seed_controls
from lie_codegen.steering.shooting.extremals import SOLVED
from lie_codegen.steering.shooting.shooter import shooter
from lie_codegen.steering.task import Task
from lie_codegen.steering.transcription.flow import fly
from lie_codegen.steering.transcription.layout import joined
from lie_codegen.steering.transcription.numbers import Numbers, over
from lie_codegen.steering.transcription.structure import Structure

Array = NDArray[Any]

_NUDGE = 0.02
_COARSE = 4
_LOOSE = 1e-10


def guesses(task: Task, structure: Structure, numbers: Numbers, starts: int) -> Iterator[tuple[str, Array]]:
    """`starts` pairs (name, (N + 1, m) velocities on the actuated components in unit time)."""
    shot = _shot(task, structure, numbers)
    if shot is not None:
        yield "shooting", shot
    if (left := starts - (shot is not None)) < 1:
        return
    x = coordinates(task.group, task.target)
    yield "a straight path", np.tile(x[list(task.controls)], (structure.intervals + 1, 1)) + _NUDGE
    seeds = seed_controls(task.group, task.controls, task.report.depth, x, max(left, 2), structure.intervals + 1)
    for number, seed in enumerate(seeds[: left - 1], start=1):
        yield f"the area rule, start {number}", seed


def _shot(task: Task, structure: Structure, numbers: Numbers) -> Array | None:
    """The extremals of least energy from via point to via point, in the time each has; None where one is not found."""
    if not task.report.controllable:
        return None
    solver = shooter(task.group, task.controls)
    nodes = [0, *structure.via, structure.intervals]
    elements = [np.eye(task.group.degree), *numbers.via, task.target]
    v = np.zeros((structure.intervals + 1, len(task.controls)))
    for first, last, here, there in zip(nodes, nodes[1:], elements, elements[1:], strict=False):
        found = solver.solve(np.linalg.solve(here, there), weights=numbers.weights)
        if found.status[0] != SOLVED:
            return None
        extremal = solver.extremal(found.mu0[0], weights=numbers.weights, nodes=last - first)
        u = extremal.costates[:, list(task.controls)] / numbers.weights
        v[first : last + 1] = u * structure.intervals / (last - first)
    return v


def first_variables(task: Task, structure: Structure, numbers: Numbers, v: Array) -> Array:
    """The variables of a guess of the velocities v on the actuated components, (N + 1, m), in unit time.

    Raises:
        ComputationError: the guess leaves the range of double precision.
    """
    if numbers.dynamics is not None:
        states, xi, torques = smooth_torques(task, structure, numbers, v)
        scale = 1.0
        if structure.free_time:
            scale = float(np.clip(np.sqrt(1.1 * np.max(numbers.ratios(torques))), 1e-3, 0.9 * numbers.longest))
        return joined(structure, states, xi / scale, torques / scale**2, scale)
    scale = 1.0
    if structure.free_time:
        fast = np.abs(np.diff(v, axis=0)) * structure.intervals
        need = max(1.05 * np.max(numbers.ratios(v)), np.sqrt(np.max(over(fast, numbers.rates))))
        scale = float(np.clip(need, 1e-3, 0.9 * numbers.longest))
    states = fly(task.group, task.controls, numbers, v / scale, scale, _COARSE, _LOOSE).X[::_COARSE]
    if not np.all(np.isfinite(states)):
        raise ComputationError(f"steer({task.group.name}): a first guess leaves the range of double precision")
    return joined(structure, states, None, v / scale, scale)


def smooth_torques(task: Task, structure: Structure, numbers: Numbers, v: Array) -> tuple[Array, Array, Array]:
    """X, xi and the actuated part of the torques along the path of the velocities v, sped up and slowed down smoothly.

    The path is run through by s = 3 t^2 - 2 t^3; where it needs torques that there are none for, it is no motion of the
    system, and only a guess.
    """
    second = numbers.dynamics
    if second is None:
        raise ValueError("smooth_torques is for second-order dynamics")
    t = np.linspace(0, 1, structure.intervals + 1)
    s = 3 * t**2 - 2 * t**3
    eased = np.stack([np.interp(s, t, column) for column in v.T], axis=1) * (6 * t * (1 - t))[:, None]
    still = Numbers(**{**vars(numbers), "dynamics": None})
    states = fly(task.group, task.controls, still, eased, 1.0, _COARSE, _LOOSE).X[::_COARSE]
    xi = np.zeros((len(t), task.group.dim))
    xi[:, list(structure.controls)] = eased
    momentum = xi @ second.inertia
    turning = np.einsum("ti,ijk,tk->tj", xi, task.group.algebra.structure_constants, momentum)
    torques = np.gradient(momentum, t, axis=0) - turning
    return states, xi, torques[:, list(structure.controls)]
