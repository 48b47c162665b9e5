"""method="transcription": whatever has bounds, obstacles, drift, torques, via points or a free time; multiple shooting.

The program is built once for its structure (`transcription_problem`) and solved for any numbers, from several first guesses:
the unconstrained optimum by shooting, a straight path, the area rule. Solvers' own flags are not believed: the true
system is integrated under the controls found, and the clearance of every obstacle is taken on a fine grid; where it
is violated between the nodes, the obstacle is enlarged by as much and the program solved again.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError, SteeringError
from lie_codegen.flow.logarithm import distance
from lie_codegen.steering.obstacles.lowest import lowest
from lie_codegen.steering.plan import Facts, Plan, Status
from lie_codegen.steering.task import Task
from lie_codegen.steering.transcription.failure_report import failure_report, refuse_blocked_states
from lie_codegen.steering.transcription.flow import piecewise_linear
from lie_codegen.steering.transcription.guess import (
    class_guesses,
    class_variables,
    first_variables,
    given_guess,
    guesses,
    plan_variables,
)
from lie_codegen.steering.transcription.nondimensional import nondimensional
from lie_codegen.steering.transcription.numbers import Numbers, Options
from lie_codegen.steering.transcription.outcome import classes_found, nearest_flown
from lie_codegen.steering.transcription.problem import endable, program
from lie_codegen.steering.transcription.solve import Candidate, ProgramEnd, Workbench, predicted_end, refined
from lie_codegen.steering.transcription.structure import Structure

_FALLBACK = 4
#: First guesses where their number is not given, and those where ways around obstacles differ.
_STARTS, _AMONG_WALLS = 3, 8
#: Full turns added to the end heading of paths between discs.
_TURNS = (0, 1, -1)
#: Further elements of a set of goals that are begun from.
_ELSEWHERE = 2
#: Clearance (of squared distances, or cosines) above which an obstacle does not hold.
_IDLE = 1e-5


def transcription(task: Task, *, progress: Callable[[str], None] | None = None, **asked: Any) -> Plan:
    """Minimum energy, or minimum time, under constraints; controls are continuous and linear on each interval.

    Args:
        task: the task; for minimum time its duration is the first guess, and the unit of `longest`.
        progress: called with one line a solve, and within a long one by ipopt every second. What was done is in the plan's
            details["solves"] in any case: start, solver, iterations, objective, violation, seconds and ipopt's residuals.
        **asked: the attributes of `Options`.

    Raises:
        SteeringInputError, ShapeError: about an option.
        SteeringError: no admissible manoeuvre found; says which limit the first guess breaks, and by how much.
    """
    return _run(task, Options(**asked), "transcription", (), progress)


def least_energy(
    task: Task,
    *,
    weights: ArrayLike | None = None,
    guess: Any = None,
    tried: tuple[str, ...] = (),
    progress: Callable[[str], None] | None = None,
) -> Plan:
    """Minimum energy without constraints, where shooting failed."""
    return _run(task, Options(weights=weights, starts=_FALLBACK, guess=guess), "optimal", tried, progress)


def _run(
    task: Task, asked: Options, method: str, tried: tuple[str, ...], progress: Callable[[str], None] | None
) -> Plan:
    started = time.perf_counter()
    structure, numbers = nondimensional(task, asked)
    refuse_blocked_states(task, numbers)
    names = _solvers(task, structure, asked)
    candidates: list[Candidate] = []
    building = 0.0
    for name, shape in ((name, shape) for name in names for shape in (structure, replace(structure, guarded=True))):
        if shape.guarded and not any(candidate.astray for candidate in candidates):
            continue
        began = time.perf_counter()
        built = program(shape, name, listening=progress is not None)
        building += time.perf_counter() - began
        for element in task.elements(_ELSEWHERE):
            there = replace(task, target=element)
            bench = Workbench(there, shape, numbers, built, progress or (lambda line: None))
            candidates += _candidates(bench, asked)
        if any(candidate.admissible for candidate in candidates):
            break
    good = [candidate for candidate in candidates if candidate.admissible]
    if not good:
        said = failure_report(task, structure, numbers, candidates)
        nearest = nearest_flown(task, numbers, candidates)
        if nearest is None:
            raise SteeringError(said)
        took = {"build": building, "solve": time.perf_counter() - started - building}
        plan = _plan(task, structure, numbers, method, tried, candidates, nearest, took, Status.NOT_FOUND)
        raise SteeringError(said, best=plan, violation=plan.violation)
    best = min(good, key=lambda candidate: candidate.objective)
    seconds = {"build": building, "solve": time.perf_counter() - started - building}
    return _plan(task, structure, numbers, method, tried, candidates, best, seconds)


def _solvers(task: Task, structure: Structure, asked: Options) -> tuple[str, ...]:
    """fatrop cannot couple the ends, loops for ever where drift or inertia must help the controls, and can be ended only where
    it solves a compiled program."""
    if asked.solver != "auto":
        return (asked.solver,)
    if asked.periodic or not task.report.controllable or not endable(structure):
        return ("ipopt",)
    return ("fatrop", "ipopt")


def _candidates(bench: Workbench, asked: Options) -> list[Candidate]:
    found = []
    for name, v in _guesses(bench, asked):
        try:
            first = None
            if isinstance(v, Plan):
                first = plan_variables(bench.task, bench.structure, bench.numbers, v)
                v = given_guess(bench.task, bench.structure.intervals, bench.numbers.drift, v)
            if first is None:
                first = first_variables(bench.task, bench.structure, bench.numbers, v)
            found.append(refined(bench, name, first, predicted_end(bench, first)))
        except ComputationError as error:
            bench.say(f"from {name}: {error}")
    if found and found[0].admissible and _idle(bench.numbers, found[0]):
        return found  # the first guess is the optimum without obstacles, and meets none of them
    for each in class_guesses(bench.task, bench.structure, bench.numbers, asked.classes, _TURNS):
        first = class_variables(bench.structure, bench.numbers, each)
        found.append(refined(bench, each.name, first, ProgramEnd(bench.task.target, np.zeros(bench.task.group.dim))))
    return found


def _idle(numbers: Numbers, candidate: Candidate) -> bool:
    """Whether no obstacle holds a candidate."""
    motion = candidate.motion
    if motion is None:
        return False
    return all(float(np.min(each.clearance(motion.X))) > _IDLE for each in numbers.obstacles)


def _guesses(bench: Workbench, asked: Options) -> Iterator[tuple[str, Array | Plan]]:
    """The caller's own, as velocities in unit time or as the plan that it is, and the others."""
    # Beside flat walls, and in least time, ways differ: of three starts none arrived where of eight some did, or the best took up to 1.6
    # times as long. Around balls and cones least energy is the same from three.
    walls, in_time = bench.structure.solids > 0, bench.structure.free_time and bool(bench.numbers.obstacles)
    usual = _AMONG_WALLS if walls or in_time else _STARTS
    starts = usual if asked.starts is None else asked.starts
    yield from guesses(bench.task, bench.structure, bench.numbers, starts)
    if isinstance(asked.guess, Plan):
        yield "the guess given", asked.guess
    elif asked.guess is not None:
        yield "the guess given", given_guess(bench.task, bench.structure.intervals, bench.numbers.drift, asked.guess)


def _plan(
    task: Task,
    structure: Structure,
    numbers: Numbers,
    method: str,
    tried: tuple[str, ...],
    candidates: Sequence[Candidate],
    best: Candidate,
    seconds: dict[str, float],
    status: Status | None = None,
) -> Plan:
    values = best.values / task.duration**numbers.power
    duration = best.duration * task.duration
    group, motion, last = task.group, best.motion, best.solves[-1]
    if motion is None:
        raise ValueError("an admissible candidate has been simulated")
    a, b = values[:-1], values[1:]
    details: dict[str, Any] = {
        "winner": f"transcription from {last.start}",
        "tried": (
            *tried,
            *(f"transcription from {each.solves[-1].start}: {each.solves[-1].message}" for each in candidates),
        ),
        "intervals": structure.intervals,
        "solver": last.solver,
        "iterations": sum(solve.iterations for each in candidates for solve in each.solves),
        "solves": tuple(solve for each in candidates for solve in each.solves),
        "objective": "time" if structure.free_time else "energy",
        "discretisation": "controls continuous and linear on each interval: the cost is an upper bound of the optimum's",
        "clearances": tuple(lowest(obstacle.clearance, motion.X) for obstacle in numbers.obstacles),
        "control_peaks": tuple(float(x) for x in np.max(np.abs(values), axis=0)),
        "drift": numbers.drift / task.duration,
        "optimality": "a local minimum of the discretised problem, the best of the starts tried",
        "fine_times": motion.t * task.duration,
        "classes": classes_found(numbers, candidates, task.duration, time=structure.free_time),
    }
    error, slip = distance(group, best.target, motion.X[-1]), 0.0
    if numbers.dynamics is not None:
        second, xi = numbers.dynamics, motion.xi / task.duration
        slip = float(np.linalg.norm(xi[-1] - second.ends[1] / task.duration))
        details |= {
            "dynamics": "second order: u is torque",
            "inertia": second.inertia,
            "start_velocity": second.ends[0] / task.duration,
            "fine_velocities": xi,
            "velocity_miss": slip,
            "velocity_peaks": tuple(float(x) for x in np.max(np.abs(xi), axis=0)),
        }
    solved = max(error, slip * duration) <= task.tolerance
    details["violation"] = {
        "end": error,
        "conditions": best.violation,
        "clearance": max([0.0, *(-x for x in details["clearances"])]),
    }
    return Plan(
        group=group,
        target=best.target,
        controls=tuple(group.labels[i] for i in task.controls),
        duration=duration,
        method=method,
        u=piecewise_linear(group, task.controls, values, duration),
        cost=float(np.sum(a * a + a * b + b * b)) * duration / (3 * structure.intervals),
        outcome=Facts(
            motion.X[-1], error, status or (Status.LOCAL if solved else Status.NOT_CONVERGED), details, seconds
        ),
    )
