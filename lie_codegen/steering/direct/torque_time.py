"""Least time under bounded torques: words of arcs, each control at a bound (or off all the way), of least total duration.

J xi' = ad*_xi J xi + sum u_i f_i from a velocity to a velocity, X' = X hat(xi) from the start to an element. Where each control
switches p_i times, the order of all switches is a word; drawn at random, many words run side by side. The durations of their arcs
reach the goal by damped least squares and shrink by the descent of the direct method; two switches that meet may pass each other.
Half a turn of a body with equal moments: K. D. Bilimoria and B. Wie, J. Guid. Control Dyn. 16 (1993) 446.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import SteeringError, SteeringInputError
from lie_codegen.flow.logarithm import distance
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.mechanics.driven import simulate_driven
from lie_codegen.steering.direct.inputs import Drive, Inputs
from lie_codegen.steering.direct.numpy_search import Box, descend, reach
from lie_codegen.steering.direct.programme import Settings
from lie_codegen.steering.direct.system import System, Velocity
from lie_codegen.steering.direct.torque_words import GONE, TorqueWord, arcs_of, tidied, torque_words, word_box
from lie_codegen.steering.goals import GoalSet
from lie_codegen.steering.plan import Controls, Facts, Plan, Status
from lie_codegen.steering.start import placed, seen_from
from lie_codegen.steering.task import Task, make_task
from lie_codegen.steering.transcription.nondimensional import nondimensional
from lie_codegen.steering.transcription.numbers import Dynamics, Numbers, Options

#: Words of a round for each start asked for.
_LANES = 16
#: Switches of each control in the first round, at most; one more in each later round.
_SWITCHES = 2
#: Steps of an arc in the search, in the last descent, and for the last digits.
_COARSE, _MIDDLE, _FINE = 3, 10, 48
_ROUGH = 1e-9
#: Words that are descended, the best of them whose switches pass each other, and those that are sharpened.
_DESCENDED, _PASSED, _SHARPENED = 24, 8, 3
_BRIEF = 1e-3
_AGREEING, _ENOUGH = 1e-3, 3
_MOST_CONTROLS = 6
#: States an arc that are kept.
_SHOWN = 16


def least_time_torques(
    group: MatrixGroup,
    target: Any,
    controls: Sequence[Any],
    duration: float,
    tolerance: float,
    *,
    dynamics: str,
    objective: str = "energy",
    inertia: Any = None,
    bounds: Any = None,
    start: ArrayLike | None = None,
    start_velocity: ArrayLike | None = None,
    end_velocity: ArrayLike | None = None,
    starts: int = 16,
    rounds: int = 4,
    iterations: int = 40,
    seed: int = 0,
    longest: float = 20.0,
    progress: Callable[[str], None] | None = None,
) -> Plan:
    """The plan of least time that was found.

    Args:
        group, target, controls, duration, tolerance: as `steer`; the target is an element, the duration a guess.
        dynamics, inertia, bounds, start_velocity, end_velocity: as `steer`; every control has bounds.
        start: (d, d) X(0).
        starts: 16 words a round for each.
        rounds: rounds, each with one more switch of each control, until three words agree.
        iterations: most steps of each stage.
        seed: of words and durations.
        longest: longest duration allowed, in units of the given one.
        progress: called with a line a round.

    Raises:
        SteeringInputError: another objective, a set of goals, controls without bounds, too many of them.
        SteeringError: no word was found that reaches the target, which proves nothing.
        Others as `steer`.
    """
    where = f"steer({group.name})"
    if objective != "time":
        raise SteeringInputError(
            f'{where}: method="direct" finds torques of least time, objective="time", or among obstacles; others are for method="transcription"'
        )
    if isinstance(target, GoalSet):
        raise SteeringInputError(f"{where}: torques of least time go to an element, not to a {type(target).__name__}")
    if start is not None:
        here, element, _ = seen_from(group, start, target, {"start": start})
        plan = least_time_torques(
            group, element, controls, duration, tolerance, dynamics=dynamics, objective=objective, inertia=inertia,
            bounds=bounds, start_velocity=start_velocity, end_velocity=end_velocity, starts=starts, rounds=rounds,
            iterations=iterations, seed=seed, longest=longest, progress=progress,
        )  # fmt: skip
        return placed(plan, here)
    began = time.perf_counter()
    task = make_task(group, target, controls, duration, tolerance, torques=True)
    _, numbers = nondimensional(
        task,
        Options(
            bounds=bounds, objective="time", longest=longest, dynamics=dynamics, inertia=inertia,
            start_velocity=start_velocity, end_velocity=end_velocity,
        ),
    )  # fmt: skip
    if len(task.controls) > _MOST_CONTROLS:
        raise SteeringInputError(f"{where}: at most {_MOST_CONTROLS} torques, got {len(task.controls)}")
    second = numbers.dynamics
    if second is None:
        raise SteeringInputError(f'{where}: torques need dynamics="second_order"')
    say = progress or (lambda line: None)
    found, tried, total = _searched(task, numbers, second, starts, rounds, iterations, seed, longest, say)
    good = [word for word in found if word.size <= 1e-8]
    if not good:
        near = min(found, key=lambda word: word.size)
        details = {"tried": tried, "starts": total, "reached": 0, "agree": 0, "seed": seed}
        best = _plan(task, second, near, details, Status.NOT_FOUND, began)
        raise SteeringError(
            f"{where}: no word of arcs of torque was found that reaches the target within {longest:g} times the given duration, from "
            f"{total} starts (seed {seed}), which proves nothing; more starts, another seed, another guess of the duration",
            best=best,
            violation=best.violation,
        )
    first = good[0].total
    agree = sum(word.total <= first * (1 + _AGREEING) for word in good)
    sharp = [_sharpened(task, second, word, longest) for word in good[:_SHARPENED]]
    best_word = min((word for word in sharp if word.size <= 1e-9), key=lambda word: word.total, default=good[0])
    details = {"tried": tried, "starts": total, "reached": len(good), "agree": agree, "seed": seed}
    return _plan(task, second, best_word, details, None, began)


def _searched(
    task: Task, numbers: Numbers, second: Dynamics, starts: int, rounds: int, iterations: int, seed: int, longest: float,
    say: Callable[[str], None],
) -> tuple[list[TorqueWord], tuple[str, ...], int]:  # fmt: skip
    """Words, those that reach the target first, the shortest first; what was tried; starts in all."""
    low, high = numbers.bounds
    tried: list[str] = []
    found: list[TorqueWord] = []
    lanes = _LANES * starts
    settings = Settings(True, iterations, iterations, enough=_ROUGH, relative=1e-6)
    for round_ in range(rounds):
        rng = np.random.default_rng([seed, round_, 17])
        torques = torque_words(low, high, lanes, _SWITCHES + round_, rng)
        durations = rng.dirichlet(np.ones(torques.shape[1]), lanes) * 3.0 ** rng.uniform(-1, 0.5, (lanes, 1))
        box = word_box(torques.shape[1], longest)
        arrived = reach(arcs_of(task, second, torques, _COARSE).look, box, durations, settings)
        there = np.flatnonzero(arrived.size <= 10 * _ROUGH)
        tried.append(f"round {round_ + 1}: {len(there)} of {lanes} words of {torques.shape[1]} arcs arrive")
        say(tried[-1])
        if not len(there):
            lane = int(np.argmin(arrived.size))
            found.append(tidied(torques[lane], arrived.u[lane], float(arrived.size[lane])))
            continue
        there = there[np.argsort(arrived.cost[there], kind="stable")][:_DESCENDED]
        found += _descended(task, second, torques[there], arrived.u[there], box, settings)
        found.sort(key=lambda word: (word.size > 10 * _ROUGH, word.total))
        if sum(word.total <= found[0].total * (1 + _AGREEING) for word in found) >= _ENOUGH and round_:
            break
    found.sort(key=lambda word: (word.size > 10 * _ROUGH, word.total))
    return found, tuple(tried), lanes * len(tried)


def _descended(
    task: Task, second: Dynamics, torques: Array, durations: Array, box: Box, settings: Settings
) -> list[TorqueWord]:
    """The words made as short as they get, and once more where switches that met have passed each other."""
    found: list[TorqueWord] = []
    for _ in range(2):
        lower = descend(arcs_of(task, second, torques, _COARSE).look, box, durations, settings)
        found += [tidied(f, s, float(size)) for f, s, size in zip(torques, lower.u, lower.size, strict=True)]
        best = np.argsort(lower.cost, kind="stable")[:_PASSED]
        torques, durations = _passed(torques[best], lower.u[best])
        if not len(torques):
            break
    return found


def _passed(torques: Array, durations: Array) -> tuple[Array, Array]:
    """Words in which an inner arc is gone, with its two switches in the other order."""
    words, lengths = [], []
    for f, s in zip(torques, durations, strict=True):
        gone = np.flatnonzero(s[1:-1] <= GONE) + 1
        swapped = f.copy()
        for k in gone:
            here, there = swapped[k] - swapped[k - 1], swapped[k + 1] - swapped[k]
            if np.any(here) and np.any(there) and not np.any(here * there):  # of different controls
                swapped[k] = swapped[k - 1] + there
        if np.any(swapped != f):
            words.append(swapped)
            lengths.append(s)
    return np.array(words).reshape(-1, *torques.shape[1:]), np.array(lengths).reshape(-1, durations.shape[1])


def _sharpened(task: Task, second: Dynamics, word: TorqueWord, longest: float) -> TorqueWord:
    """The word without arcs that are all but gone, as short as it gets on finer steps, and at the goal on the finest."""
    settings = Settings(True, 30, 30, enough=1e-12, relative=1e-10, damping=1e-9)
    word = tidied(word.torques, word.durations, word.size, _BRIEF)
    box = word_box(len(word.durations), longest)
    middle = arcs_of(task, second, word.torques[None], _MIDDLE).look
    lower = descend(middle, box, reach(middle, box, word.durations[None], settings).u, settings)
    fine = reach(arcs_of(task, second, word.torques[None], _FINE).look, box, lower.u, settings)
    return tidied(word.torques, fine.u[0], float(fine.size[0]))


def _plan(
    task: Task, second: Dynamics, word: TorqueWord, details: dict[str, Any], status: Status | None, began: float
) -> Plan:
    """The plan of a word, flown by the true system."""
    group, D = task.group, task.duration
    torques, lengths = word.torques / D**2, word.durations * D
    labels = tuple(group.labels[i] for i in task.controls)
    eye = np.eye(group.dim)
    directions = tuple(Velocity(group.dim, constant=eye[i]) for i in task.controls)
    start = np.eye(group.degree, dtype=group.basis.dtype)
    system = System(group, labels, directions, Velocity(group.dim, constant=np.zeros(group.dim)), start)
    inputs = Inputs.constant(np.concatenate([[0.0], np.cumsum(lengths)]), torques)
    u = Controls(Drive(system, inputs), inputs.knots[1:-1])
    duration = float(inputs.knots[-1])
    ends = np.array(second.ends) / D
    parts = [np.linspace(a, b, _SHOWN, endpoint=False) for a, b in pairwise(inputs.knots)]
    run = simulate_driven(group, u, second.inertia, t=np.concatenate([*parts, [duration]]), xi0=ends[0])
    error = distance(group, task.target, run.X[-1])
    slip = float(np.linalg.norm(run.xi[-1] - ends[1]))
    solved = max(error, slip * duration) <= task.tolerance
    told = {
        "winner": "direct, arcs of torque",
        "objective": "time",
        "arcs": tuple((*map(float, f), float(s)) for f, s in zip(torques, lengths, strict=True)),
        "discretisation": "none: arcs of constant torques",
        "optimality": "a local minimum of the duration, the shortest of the words tried",
        "inputs": inputs,
        "control_peaks": inputs.peaks(),
        "dynamics": "second order: u is torque",
        "inertia": second.inertia,
        "start_velocity": ends[0],
        "fine_times": run.t,
        "fine_velocities": run.xi,
        "velocity_miss": slip,
        "velocity_peaks": tuple(float(x) for x in np.max(np.abs(run.xi), axis=0)),
        "violation": {"end": error, "velocity": slip},
        **details,
    }
    return Plan(
        group=group,
        target=task.target,
        controls=labels,
        duration=duration,
        method="direct",
        u=u,
        cost=inputs.integral_of_squares(np.ones(len(labels))),
        outcome=Facts(
            run.X[-1],
            error,
            status or (Status.LOCAL if solved else Status.NOT_CONVERGED),
            told,
            {"solve": time.perf_counter() - began},
        ),
    )
