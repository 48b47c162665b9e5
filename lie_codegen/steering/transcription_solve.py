"""Solving a posed transcription: from a guess of the controls to a candidate that the true system confirms."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.simulation.driven import simulate_driven
from lie_codegen.simulation.flow import simulate
from lie_codegen.steering.constraints import Cone
from lie_codegen.steering.guesses import rollout
from lie_codegen.steering.packing import pack_element
from lie_codegen.steering.plan import Controls
from lie_codegen.steering.task import Task
from lie_codegen.steering.transcription_pose import Numbers
from lie_codegen.steering.transcription_problem import Program, Structure

Array = NDArray[Any]

_ROUNDS = 5
_FINE = 8
_FEASIBLE = 1e-7
_CLEAR = 1e-8
_EXACT = 1e-9


@dataclass(frozen=True)
class Candidate:
    """What a solve gave.

    Attributes:
        objective, values, duration: the objective, (N + 1, m) controls and the duration, in the task's units.
        violation: of the constraints, infinite if the end is missed.
        iterations, message: the solver's.
        solution: all variables.
    """

    objective: float
    values: Array
    duration: float
    violation: float
    iterations: int
    message: str
    solution: Array


@dataclass(frozen=True)
class Aim:
    """Where the program is told to end, so that the true system ends where it must: X, and xi to second order."""

    X: Array
    xi: Array


def refined(
    task: Task, structure: Structure, built: Program, numbers: Numbers, margins: Array, start: Array
) -> Candidate:
    """Solves, and again with the aim corrected by the true system's miss, and obstacles enlarged where the path cuts them."""
    second = numbers.dynamics
    aim = Aim(task.target, np.zeros(task.group.dim) if second is None else second.ends[1])
    candidate = _solve(task, structure, built, numbers, margins, aim, start)
    for _ in range(_ROUNDS):
        if candidate.violation > _FEASIBLE:
            return candidate
        _, states, xi = fine_states(task, numbers, candidate)
        cut = np.array([max(0.0, -float(np.min(obstacle.clearance(states)))) for obstacle in numbers.obstacles])
        miss = np.linalg.solve(states[-1], task.target)
        slip = np.zeros(task.group.dim) if second is None else second.ends[1] - xi[-1] * task.duration
        off = max(np.max(np.abs(miss - np.eye(task.group.degree))), np.max(np.abs(slip)))
        if np.max(cut, initial=0.0) <= _CLEAR and off <= _EXACT:
            return candidate
        aim = Aim(aim.X @ miss, aim.xi + slip)
        margins = margins + 1.1 * cut
        candidate = _solve(task, structure, built, numbers, margins, aim, candidate.solution)
    return candidate


def first_variables(task: Task, structure: Structure, numbers: Numbers, v: Array) -> Array:
    """The variables of a guess of the velocities v on the actuated components, (N + 1, m), in unit time."""
    if numbers.dynamics is not None:
        return _second_order_variables(task, structure, numbers, v)
    scale = 1.0
    if structure.free_time:
        scale = float(np.clip(1.05 * np.max(ratios(numbers, v)), 1e-3, 0.9 * numbers.longest))
    states = rollout(task.group, structure.controls, v, numbers.drift * scale)
    return _joined(task.group, states, None, v / scale, scale)


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
    states = rollout(task.group, structure.controls, eased, numbers.drift)
    xi = np.zeros((len(t), task.group.dim))
    xi[:, list(structure.controls)] = eased
    momentum = xi @ second.inertia
    turning = np.einsum("ti,ijk,tk->tj", xi, task.group.algebra.structure_constants, momentum)
    torques = np.gradient(momentum, t, axis=0) - turning
    return states, xi, torques[:, list(structure.controls)]


def ratios(numbers: Numbers, v: Array) -> Array:
    """(N + 1, m) how many times their bounds controls are; zero where there are none."""
    low, high = numbers.bounds
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.nan_to_num(np.fmax(v / high, v / low), nan=0.0))


def _second_order_variables(task: Task, structure: Structure, numbers: Numbers, v: Array) -> Array:
    states, xi, torques = smooth_torques(task, structure, numbers, v)
    scale = 1.0
    if structure.free_time:
        scale = float(np.clip(np.sqrt(1.1 * np.max(ratios(numbers, torques))), 1e-3, 0.9 * numbers.longest))
    return _joined(task.group, states, xi / scale, torques / scale**2, scale)


def _joined(group: MatrixGroup, states: Array, xi: Array | None, v: Array, scale: float) -> Array:
    parts: list[Any] = []
    for k in range(len(v)):
        parts += [pack_element(group, states[k]), () if xi is None else xi[k], v[k], [scale]]
        if k < len(v) - 1:
            parts.append(v[k + 1] - v[k])
    return np.concatenate(parts)


def _limits(task: Task, structure: Structure, numbers: Numbers, aim: Aim, count: int) -> tuple[Array, Array]:
    """Lower and upper limits of all variables."""
    group, m, N, size, state = task.group, len(structure.controls), structure.intervals, structure.size, structure.state
    stage, second = structure.stage, numbers.dynamics
    low, high = np.full(count, -np.inf), np.full(count, np.inf)
    for k in range(N + 1):
        at = k * (stage + m)
        if k == 0:
            low[:size] = high[:size] = pack_element(group, np.eye(group.degree))
        if second is not None:
            low[at + size : at + state], high[at + size : at + state] = second.speeds
            if k in (0, N):
                low[at + size : at + state] = high[at + size : at + state] = aim.xi if k else second.ends[0]
        low[at + state : at + state + m], high[at + state : at + state + m] = numbers.bounds
        if numbers.rest and k in (0, N):
            low[at + state : at + state + m] = high[at + state : at + state + m] = 0.0
        low[at + state + m], high[at + state + m] = (1e-3, numbers.longest) if structure.free_time else (1.0, 1.0)
        if k < N and not structure.free_time:
            low[at + stage : at + stage + m], high[at + stage : at + stage + m] = (each / N for each in numbers.rates)
    return low, high


def _solve(
    task: Task, structure: Structure, built: Program, numbers: Numbers, margins: Array, aim: Aim, start: Array
) -> Candidate:
    m, N, size, state, stage = (
        len(structure.controls),
        structure.intervals,
        structure.size,
        structure.state,
        structure.stage,
    )
    low, high = _limits(task, structure, numbers, aim, len(start))
    upper = np.where(built.equality, 0.0, np.inf)
    result = built.solver(
        x0=start, p=_parameters(task, numbers, margins, aim.X), lbx=low, ubx=high, lbg=np.zeros(len(upper)), ubg=upper
    )
    solution = np.asarray(result["x"]).ravel()
    g = np.asarray(result["g"]).ravel()
    violation = float(np.max(np.where(built.equality, np.abs(g), np.maximum(-g, 0.0))))
    violation = max(violation, float(np.max(np.maximum(np.maximum(low - solution, solution - high), 0.0))))
    rows = [solution[k * (stage + m) : k * (stage + m) + stage] for k in range(N + 1)]
    values = np.array([row[state : state + m] for row in rows])
    last = pack_element(task.group, aim.X)
    if not np.all(np.isfinite(solution)) or np.max(np.abs(rows[-1][:size] - last)) > 1e-5 * max(
        1.0, np.max(np.abs(last))
    ):
        violation = np.inf
    stats = built.solver.stats()
    return Candidate(
        float(result["f"]),
        values,
        float(rows[0][state + m]),
        violation,
        int(stats.get("iter_count", -1)),
        str(stats.get("return_status", stats.get("unified_return_status", ""))),
        solution,
    )


def _parameters(task: Task, numbers: Numbers, margins: Array, aim: Array) -> Array:
    parts: list[Any] = [pack_element(task.group, aim), numbers.drift, numbers.weights]
    for obstacle, margin in zip(numbers.obstacles, margins, strict=True):
        values = list(obstacle.parameters())
        values[-1] = values[-1] - margin if isinstance(obstacle, Cone) else np.sqrt(values[-1] ** 2 + margin)
        parts.append(values)
    parts += [pack_element(task.group, element) for element in numbers.via]
    parts.append(np.minimum(np.minimum(-numbers.rates[0], numbers.rates[1]), 1e6))
    if numbers.dynamics is not None:
        parts += [numbers.dynamics.inertia.ravel(), np.linalg.inv(numbers.dynamics.inertia).ravel()]
    return np.concatenate([np.asarray(part, dtype=float) for part in parts])


def fine_states(task: Task, numbers: Numbers, candidate: Candidate) -> tuple[Array, Array, Array]:
    """Times, X and body velocities of the true system under a candidate's controls, eight times as fine as its nodes."""
    u, duration = candidate_controls(task, numbers, candidate)
    t = np.linspace(0, duration, _FINE * (len(candidate.values) - 1) + 1)
    if numbers.dynamics is not None:
        second = numbers.dynamics
        run = simulate_driven(task.group, u, second.inertia, t=t, xi0=second.ends[0] / task.duration)
        return t, run.X, run.xi
    driven = u.plus(numbers.drift / task.duration)
    return t, simulate(task.group, driven, t=t, tolerance=1e-10).X, driven(t)


def candidate_controls(task: Task, numbers: Numbers, candidate: Candidate) -> tuple[Controls, float]:
    """u(t) in SI units, and the duration."""
    duration = candidate.duration * task.duration
    return _piecewise_linear(
        replace(task, duration=duration), candidate.values / task.duration**numbers.power
    ), duration


def _piecewise_linear(task: Task, values: Array) -> Controls:
    knots = np.linspace(0, task.duration, len(values))

    def evaluate(t: Array) -> Array:
        u = np.zeros((len(t), task.group.dim))
        for position, column in zip(task.controls, values.T, strict=True):
            u[:, position] = np.interp(t, knots, column)
        return u

    return Controls(evaluate, knots[1:-1])
