"""Sets of goals for the methods that steer to an element: a coset T exp(span F), begun at one T and moved along F.

The direct method knows sets by itself; this is for what it does not do: obstacles, rates, inertia, rest, ways through points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InfeasibleError, SteeringError, SteeringInputError, UncontrollableError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.goals import GoalSet, cosets
from lie_codegen.steering.methods import OPEN_LOOP, solver_of
from lie_codegen.steering.plan import Plan
from lie_codegen.steering.start import placed, seen_from
from lie_codegen.steering.task import Task, make_task

#: Methods that move the target along the directions that a goal leaves free.
_SET_METHODS = ("optimal", "transcription")


def set_plan(
    group: MatrixGroup,
    goal: GoalSet,
    controls: Sequence[Any],
    duration: float,
    method: str,
    tolerance: float,
    options: Mapping[str, Any],
) -> Plan:
    """The plan to a set of goals; the cheapest over the phases of a gate.

    Raises:
        SteeringInputError: a method that steers to elements alone, an option it does not have.
        Others as the method.
    """
    where = f"steer({group.name})"
    if method not in ("auto", *_SET_METHODS):
        raise SteeringInputError(
            f"{where}: a {type(goal).__name__} is a set of goals, which auto, direct, ocp and {', '.join(_SET_METHODS)} take, "
            f"not {method!r}"
        )
    asked = {name: value for name, value in options.items() if name != "start"}
    solve = solver_of(OPEN_LOOP, "transcription" if method == "auto" else method, asked)
    elements, free = cosets(group, goal, f"{where}: target")
    if len(free):
        elements = _nearest(group, goal, elements, controls, duration, options)
    found: list[Plan] = []
    failed: list[SteeringError] = []
    for element in elements:
        here, seen, moved = None, element, asked
        if options.get("start") is not None:
            here, seen, moved = seen_from(group, options["start"], element, options)
        try:
            plan = solve(_task(group, seen, controls, duration, tolerance, free, moved), **moved)
        except SteeringError as error:
            failed.append(error)
            continue
        found.append(plan if here is None else placed(plan, here))
        if len(free):
            break  # every element of a coset leads to all of it
    if not found:
        raise failed[0]
    best = min(found, key=lambda plan: plan.duration if asked.get("objective") == "time" else plan.cost)
    return replace(best, outcome=replace(best.facts, details={**best.details, "goal": goal}))


def _task(
    group: MatrixGroup,
    element: Array,
    controls: Sequence[Any],
    duration: float,
    tolerance: float,
    free: Array,
    options: Mapping[str, Any],
) -> Task:
    """The task to an element and what is as good; controls that miss directions may yet reach some element of a set."""
    torques = options.get("dynamics") == "second_order" or len(free) > 0
    task = make_task(group, element, controls, duration, tolerance, torques=torques, drift=options.get("drift"))
    return replace(task, free=free) if len(free) else task


def _nearest(
    group: MatrixGroup,
    goal: GoalSet,
    elements: Array,
    controls: Sequence[Any],
    duration: float,
    options: Mapping[str, Any],
) -> Array:
    """Where the direct method ends without obstacles and without inertia, before the element that is there by itself.

    Raises:
        InfeasibleError: it is proved that even without obstacles the bounds do not allow it.
    """
    from lie_codegen.steering.direct.method import direct

    still = options.get("dynamics") != "second_order"
    fixed = still and options.get("objective", "energy") == "energy"
    taken = ("weights", "start", *(("drift",) if still else ()), *(("bounds",) if fixed else ()))
    given = {name: options[name] for name in taken if options.get(name) is not None}
    try:
        return np.concatenate(
            [[direct(group, goal, controls, duration, rounds=1, polish=False, **given).X_final], elements]
        )
    except InfeasibleError:
        raise
    except (SteeringError, UncontrollableError):
        return elements
