"""Why there is no admissible manoeuvre: what was tried, how near it came, and which limits stand in the way."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.obstacles.blocked import refuse_blocked
from lie_codegen.steering.task import Task
from lie_codegen.steering.transcription.flow import simulated_path
from lie_codegen.steering.transcription.guess import guesses, smooth_torques
from lie_codegen.steering.transcription.numbers import Numbers, over
from lie_codegen.steering.transcription.solve import Candidate
from lie_codegen.steering.transcription.structure import Structure


def failure_report(task: Task, structure: Structure, numbers: Numbers, candidates: Sequence[Candidate]) -> str:
    """One line: the limits in the way, most important first, and what to try."""
    lines = [f"steer({task.group.name}): no admissible manoeuvre"]
    if candidates:
        nearest = min(each.miss if np.isfinite(each.miss) else each.violation for each in candidates)
        lines[0] += (
            f" from {len(candidates)} starts with {structure.intervals} intervals (smallest violation {nearest:.2g}; "
            f"{candidates[0].solves[-1].message})"
        )
    first = next(iter(guesses(task, structure, numbers, 1)), None)
    if first is not None:
        lines += _needs(task, structure, numbers, first[1])
    advice = "more starts or more intervals"
    if structure.free_time and numbers.longest < 1e3:
        advice = f"a larger `longest`, {advice}"
    return "; ".join([*lines, f"try {advice}"])


def refuse_blocked_states(task: Task, numbers: Numbers) -> None:
    """Nothing, where the ends and the via points are clear of the obstacles.

    Raises:
        InfeasibleError: one is inside an obstacle.
    """
    fixed: Array = np.zeros((0, task.group.dim))
    places: list[tuple[str, Array, Array]] = [
        ("start", np.eye(task.group.degree), fixed),
        ("target", task.target, fixed if task.free is None else task.free),
    ]
    places += [(f"via point {number}", element, fixed) for number, element in enumerate(numbers.via, start=1)]
    named = zip(numbers.obstacle_names, numbers.obstacles, strict=True)
    refuse_blocked(f"steer({task.group.name})", task.group, places, named)


def _needs(task: Task, structure: Structure, numbers: Numbers, v: Array) -> list[str]:
    """What a manoeuvre without limits would need of each limit."""
    lines = []
    labels = [task.group.labels[i] for i in structure.controls]
    if numbers.dynamics is None:
        needs, what = v, "without limits the least-energy manoeuvre needs"
        states = simulated_path(task.group, task.controls, numbers, v, 1.0).X
    else:
        what = "the first guess needs"
        states, xi, needs = smooth_torques(task, structure, numbers, v)
        fast = np.max(over(xi, numbers.dynamics.speeds), axis=0)
        lines += [
            f"{what} {ratio:.3g} times the velocity bound of {label}"
            for label, ratio in zip(task.group.labels, fast, strict=True)
            if ratio > 1 and not structure.free_time
        ]
    if not structure.free_time:
        above = np.max(numbers.ratios(needs), axis=0)
        steep = np.max(over(np.diff(needs, axis=0) * structure.intervals, numbers.rates), axis=0)
        for number, (label, ratio, slope) in enumerate(zip(labels, above, steep, strict=True)):
            if ratio > 1:
                lines.append(f"{what} {ratio:.3g} times the bound of {label}")
            if slope > 1:
                lines.append(f"{what} {slope:.3g} times the rate bound of {label}")
            low, high = numbers.bounds[0][number], numbers.bounds[1][number]
            wants = float(np.mean(needs[:, number]))
            if low > 0 or high < 0:
                lines.append(
                    f"the bounds of {label} exclude zero; its mean without limits is {_unit(wants, task, numbers):.3g}"
                )
        enough = max(float(np.max(above)), float(np.sqrt(np.max(steep))))
        if 1 < enough < np.inf and not np.any(numbers.drift) and numbers.dynamics is None and not numbers.rest:
            lines.append(f"{task.duration * enough:.4g} s would be enough for the bounds on the controls")
    crossed = [
        name
        for obstacle, name in zip(numbers.obstacles, numbers.obstacle_names, strict=True)
        if np.min(obstacle.clearance(states)) < 0
    ]
    lines += [f"it crosses {name}" for name in crossed]
    return lines


def _unit(value: float, task: Task, numbers: Numbers) -> float:
    return value / task.duration**numbers.power
