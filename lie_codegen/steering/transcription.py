"""method="transcription": whatever has bounds, obstacles, drift, torques, via points or a free time; multiple shooting.

The program is built once for its structure (`transcription_problem`) and solved for any numbers, from several first guesses:
the unconstrained optimum by shooting, the area rule, a straight path. Solvers' own flags are not believed: the true
system is integrated under the controls found, and the clearance of every obstacle is taken on a fine grid; where it
is violated between the nodes, the obstacle is enlarged by as much and the program solved again.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lie_codegen.errors import SteeringError
from lie_codegen.steering.constraints import Obstacle
from lie_codegen.steering.finish import finish
from lie_codegen.steering.guesses import guesses, rollout
from lie_codegen.steering.plan import Plan, Status
from lie_codegen.steering.task import Task
from lie_codegen.steering.transcription_pose import Numbers, pose
from lie_codegen.steering.transcription_problem import Structure, program
from lie_codegen.steering.transcription_solve import (
    Candidate,
    candidate_controls,
    fine_states,
    first_variables,
    ratios,
    refined,
    smooth_torques,
)

Array = NDArray[Any]

_FALLBACK = 4
_FEASIBLE = 1e-7


def transcription(
    task: Task,
    *,
    bounds: Any = None,
    rate_bounds: Any = None,
    obstacles: Sequence[Obstacle] = (),
    via: Sequence[tuple[float, ArrayLike]] = (),
    drift: ArrayLike | None = None,
    rest: bool = False,
    periodic: bool = False,
    objective: str = "energy",
    longest: float = 20.0,
    dynamics: str = "first_order",
    inertia: Any = None,
    velocity_bounds: Any = None,
    start_velocity: ArrayLike | None = None,
    end_velocity: ArrayLike | None = None,
    weights: ArrayLike | None = None,
    intervals: int = 64,
    starts: int = 3,
    solver: str = "ipopt",
    progress: Callable[[str], None] | None = None,
) -> Plan:
    """Minimum energy, or minimum time, under constraints; controls are continuous and linear on each interval.

    Args:
        task: the task; for minimum time its duration is the first guess, and the unit of `longest`.
        bounds: of the controls: a number (both signs), a (low, high) pair, or {label: either}; units of u.
        rate_bounds: of the controls' time derivatives, as bounds.
        obstacles: `Cone`s (attitude exclusion) and `Ball`s (position), for all of the way.
        via: (fraction of the duration, element or coordinates of the second kind) to pass through.
        drift: (n,) constant velocity added to the controls' own: X' = X hat(drift + u).
        rest: controls are zero at both ends.
        periodic: controls end as they begin: a gait, whose repetition moves by the target each time.
        objective: "energy", int sum w_i u_i^2, or "time".
        longest: for "time": the longest duration allowed, in units of the task's.
        dynamics: "first_order": u is a velocity; "second_order": u is a torque, or force, on the controlled components,
            X' = X hat(xi), J xi' = ad*_xi J xi + u, from rest to rest.
        inertia: J: a number, (n,) or (n, n), symmetric positive definite; for second order, as what follows.
        velocity_bounds: of any component of xi, as bounds.
        start_velocity, end_velocity: (n,) xi at the ends, zero if not given.
        weights: (m,) positive w_i, ones if not given.
        intervals: N, pieces of the controls.
        starts: first guesses tried; the cheapest admissible result wins.
        solver: "ipopt" or "fatrop".
        progress: called with one line a solve.

    Raises:
        SteeringInputError, ShapeError: about an option.
        SteeringError: no admissible manoeuvre found; says which limit the unconstrained optimum breaks.
    """
    started = time.perf_counter()
    structure, numbers = pose(
        task,
        bounds=bounds,
        rate_bounds=rate_bounds,
        obstacles=obstacles,
        via=via,
        drift=drift,
        rest=rest,
        periodic=periodic,
        objective=objective,
        longest=longest,
        dynamics=dynamics,
        inertia=inertia,
        velocity_bounds=velocity_bounds,
        start_velocity=start_velocity,
        end_velocity=end_velocity,
        weights=weights,
        intervals=intervals,
        starts=starts,
        solver=solver,
    )
    return _run(task, structure, numbers, starts, "transcription", (), progress or (lambda line: None), started)


def least_energy(
    task: Task,
    *,
    weights: ArrayLike | None = None,
    tried: tuple[str, ...] = (),
    progress: Callable[[str], None] | None = None,
) -> Plan:
    """Minimum energy without constraints, where shooting failed."""
    started = time.perf_counter()
    structure, numbers = pose(task, weights=weights, starts=_FALLBACK)
    return _run(task, structure, numbers, _FALLBACK, "optimal", tried, progress or (lambda line: None), started)


def _run(
    task: Task,
    structure: Structure,
    numbers: Numbers,
    starts: int,
    method: str,
    tried: tuple[str, ...],
    say: Callable[[str], None],
    started: float,
) -> Plan:
    built_program = program(structure)
    built = time.perf_counter()
    candidates: list[tuple[Candidate, str]] = []
    margins = np.zeros(len(numbers.obstacles))
    for name, v in guesses(task, structure, numbers.via, starts):
        candidate = refined(
            task, structure, built_program, numbers, margins, first_variables(task, structure, numbers, v)
        )
        candidates.append((candidate, name))
        say(
            f"from {name}: {candidate.message}, objective {candidate.objective:.9g}, violation {candidate.violation:.1e}"
        )
    good = [pair for pair in candidates if pair[0].violation <= _FEASIBLE]
    if not good:
        raise SteeringError(_complaint(task, structure, numbers, [pair[0] for pair in candidates]))
    best, name = min(good, key=lambda pair: pair[0].objective)
    u, duration = candidate_controls(task, numbers, best)
    done = replace(task, duration=duration)
    drift = numbers.drift / task.duration
    fine, states, xi = fine_states(task, numbers, best)
    details: dict[str, Any] = {
        "winner": f"transcription from {name}",
        "tried": (*tried, *(f"transcription from {each}: {candidate.message}" for candidate, each in candidates)),
        "intervals": structure.intervals,
        "solver": structure.solver,
        "iterations": sum(candidate.iterations for candidate, _ in candidates),
        "objective": "time" if structure.free_time else "energy",
        "discretisation": "controls continuous and linear on each interval: the cost is an upper bound of the optimum's",
        "clearances": tuple(float(np.min(obstacle.clearance(states))) for obstacle in numbers.obstacles),
        "control_peaks": tuple(float(x) for x in np.max(np.abs(best.values), axis=0) / task.duration**numbers.power),
        "drift": drift,
        "optimality": "a local minimum of the discretised problem, the best of the starts tried",
        "fine_times": fine,
    }
    seconds = {"build": built - started, "solve": time.perf_counter() - built}
    if numbers.dynamics is None:
        return finish(
            done, method, u, details, seconds, solved=Status.LOCAL, otherwise=Status.NOT_CONVERGED, drift=drift
        )
    second = numbers.dynamics
    slip = float(np.linalg.norm(xi[-1] - second.ends[1] / task.duration))
    details |= {
        "dynamics": "second order: u is torque",
        "inertia": second.inertia,
        "start_velocity": second.ends[0] / task.duration,
        "fine_velocities": xi,
        "velocity_miss": slip,
        "velocity_peaks": tuple(float(x) for x in np.max(np.abs(xi), axis=0)),
    }
    end = Status.LOCAL if slip * duration <= task.tolerance else Status.NOT_CONVERGED
    return finish(done, method, u, details, seconds, solved=end, otherwise=Status.NOT_CONVERGED, end=states[-1])


def _complaint(task: Task, structure: Structure, numbers: Numbers, candidates: list[Candidate]) -> str:
    """What was tried, how near it came, and which limits the unconstrained optimum breaks."""
    nearest = min(candidate.violation for candidate in candidates)
    lines = [
        f"steer({task.group.name}): no admissible manoeuvre from {len(candidates)} starts with {structure.intervals} "
        f"intervals (smallest violation {nearest:.2g}; {candidates[0].message})"
    ]
    _, v = next(iter(guesses(task, structure, numbers.via, 1)))
    if numbers.dynamics is None:
        needs, what = v, "without limits the least-energy manoeuvre needs"
        states = rollout(task.group, structure.controls, v, numbers.drift)
    else:
        states, _, needs = smooth_torques(task, structure, numbers, v)
        what = "the first guess needs"
    over = np.max(ratios(numbers, needs), axis=0)
    for position, ratio in zip(structure.controls, over, strict=True):
        if ratio > 1:
            lines.append(f"{what} {ratio:.3g} times the bound of {task.group.labels[position]}")
    largest = float(np.max(over))
    if largest > 1 and not structure.free_time and not np.any(numbers.drift) and numbers.dynamics is None:
        lines.append(f"{task.duration * largest:.4g} s would be enough for the bounds on the controls")
    for number, obstacle in enumerate(numbers.obstacles, start=1):
        if np.min(obstacle.clearance(states)) < 0:
            lines.append(f"it crosses obstacle {number} ({type(obstacle).__name__})")
        for which, element in (("start", np.eye(task.group.degree)), ("target", task.target)):
            if obstacle.clearance(element[None])[0] < 0:
                lines.append(f"the {which} itself is inside obstacle {number} ({type(obstacle).__name__})")
    return "; ".join([*lines, "try a longer duration, more starts or more intervals"])
