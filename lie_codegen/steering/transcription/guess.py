"""First guesses for the transcription: the exact optimum without constraints, a straight path, the area rule."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from lie_codegen.algebra.brackets import ad_star
from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError, NotFiniteError, ShapeError
from lie_codegen.steering.obstacles.homotopy import planar_discs
from lie_codegen.steering.obstacles.path_guess import PathGuess, moves_in_the_plane, path_guesses
from lie_codegen.steering.path_samples import path_of, path_velocities
from lie_codegen.steering.plan import Plan
from lie_codegen.steering.seeds import coordinates, seed_controls
from lie_codegen.steering.shooting.extremals import SOLVED
from lie_codegen.steering.shooting.shooter import shooter
from lie_codegen.steering.task import Task
from lie_codegen.steering.transcription.flow import simulated_path
from lie_codegen.steering.transcription.layout import joined
from lie_codegen.steering.transcription.numbers import Numbers, over
from lie_codegen.steering.transcription.structure import Structure

_NUDGE = 0.02
_COARSE = 4
_LOOSE = 1e-10


def given_guess(task: Task, intervals: int, drift: Array, guess: Any) -> Array:
    """The caller's controls as velocities (N + 1, m) in unit time, beside the drift: of a plan, or samples (k, m) at equal times.

    Raises:
        ShapeError, NotFiniteError: about the guess.
    """
    m, where = len(task.controls), f"steer({task.group.name}): guess"
    s = np.linspace(0, 1, intervals + 1)
    if isinstance(guess, Plan):
        values = guess.u(s * guess.duration)[:, list(task.controls)] * guess.duration
    elif callable(guess):
        values = np.array([np.asarray(guess(float(t)), dtype=float) for t in s * task.duration]) * task.duration
    elif (path := path_of(task.group, guess, where)) is not None:
        rates = path_velocities(task.group, path, 1 / (len(path) - 1)) - drift
        middle = (np.arange(len(rates)) + 0.5) / len(rates)
        values = np.column_stack([np.interp(s, middle, rates[:, i]) for i in task.controls])
    else:
        samples = np.asarray(guess, dtype=float)
        if samples.ndim != 2 or samples.shape[1] != m or len(samples) < 2:
            raise ShapeError(
                f"{where} has shape {samples.shape}; give (k, {m}) samples, a path (k, d, d), a function of t, or a plan"
            )
        there = np.linspace(0, 1, len(samples))
        values = np.column_stack([np.interp(s, there, column) for column in samples.T]) * task.duration
    if values.shape != (len(s), m):
        raise ShapeError(f"{where} gives {values.shape[1:]} at a time; it must give ({m},)")
    if not np.all(np.isfinite(values)):
        raise NotFiniteError(f"{where} holds NaN or infinity")
    return values


def plan_variables(task: Task, structure: Structure, numbers: Numbers, plan: Plan) -> Array | None:
    """All variables as a plan has them, its states, velocities and duration too; None of a plan of another kind of motion than is asked for.

    A right-invariant plan is of another kind, and so are velocities where torques are asked for. A plan that lasts another time than the task
    is run through in the task's, unless the duration is found.
    """
    details, second = plan.details, numbers.dynamics
    system = details.get("system")
    if (details.get("inertia") is None) != (second is None) or (system is not None and system.right):
        return None
    s = np.linspace(0, 1, structure.intervals + 1)
    t = s * plan.duration
    slower = 1.0 if structure.free_time else plan.duration / task.duration
    scale = float(np.clip(plan.duration / task.duration, 1e-3, numbers.longest)) if structure.free_time else 1.0
    v = plan.u(t)[:, list(task.controls)] * (slower * task.duration) ** numbers.power
    xi = None if second is None else plan.xi(t) * slower * task.duration
    X = plan.X(t)
    return joined(structure, np.linalg.solve(X[:1], X), xi, v, scale)


def class_guesses(
    task: Task, structure: Structure, numbers: Numbers, classes: int, turns: tuple[int, ...]
) -> list[PathGuess]:
    """Guesses along the shortest classes of ways between discs in the plane; none where there are no discs, or via points or
    inertia ask for more than a path."""
    discs = planar_discs(numbers.obstacles)
    if discs is None or structure.via or numbers.dynamics is not None or not moves_in_the_plane(task.group):
        return []
    return path_guesses(task.group, discs, np.eye(task.group.degree), task.target, structure.intervals, classes, turns)


def class_variables(structure: Structure, numbers: Numbers, guess: PathGuess) -> Array:
    """The variables of such a guess; the program closes the gaps between its poses."""
    v = guess.velocities[:, list(structure.controls)] - numbers.drift[list(structure.controls)]
    scale = 1.0
    if structure.free_time:
        scale = float(np.clip(1.05 * np.max(numbers.ratios(v)), 1e-3, 0.9 * numbers.longest))
    return joined(structure, guess.states, None, v / scale, scale)


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
    states = simulated_path(task.group, task.controls, numbers, v / scale, scale, _COARSE, _LOOSE).X[::_COARSE]
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
    states = simulated_path(task.group, task.controls, still, eased, 1.0, _COARSE, _LOOSE).X[::_COARSE]
    xi = np.zeros((len(t), task.group.dim))
    xi[:, list(structure.controls)] = eased
    momentum = xi @ second.inertia
    turning = ad_star(task.group.algebra, xi, momentum)
    torques = np.gradient(momentum, t, axis=0) - turning
    return states, xi, torques[:, list(structure.controls)]
