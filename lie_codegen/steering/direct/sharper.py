"""A plan of the direct method among obstacles, made as cheap as it gets between nodes: the transcription, begun from that plan.

The direct method looks for ways; on a way its own descent is of first order, and leaves up to a third of a duration, most of all along flat
walls and under torques. The transcription has second derivatives and one way. Whichever is cheaper is the plan, if it is as clear.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from lie_codegen.algebra.controllability import control_indices
from lie_codegen.errors import ComputationError, SteeringError, SteeringInputError, UncontrollableError
from lie_codegen.steering.direct.scene import CLEAR, Scene
from lie_codegen.steering.goals import GoalSet, cosets
from lie_codegen.steering.obstacles.lowest import lowest
from lie_codegen.steering.obstacles.tunnels import tunnels
from lie_codegen.steering.plan import Plan
from lie_codegen.steering.start import placed, seen_from
from lie_codegen.steering.task import make_task, reach
from lie_codegen.steering.transcription.transcribe import transcription

#: Obstacles up to which a program is made for their number.
_MOST = 12
#: Points at which the way is looked at, and what a cost must fall by to count.
_LOOKS, _GAIN = 1025, 1e-6


def sharper(plan: Plan, scene: Scene, target: Any, tolerance: float) -> Plan:
    """The plan, or a cheaper one on its way; where the transcription does not have what is asked for, the plan."""
    asked = scene.options()
    if asked is None or len(scene.obstacles) > _MOST:
        return plan
    if isinstance(target, GoalSet) and not _alone(scene):
        return plan  # ipopt, which alone takes such systems, ends the process where the end is a coset and the duration is free
    try:
        found = _transcribed(plan, scene, target, tolerance, {**asked, "guess": plan, "starts": 1, "classes": 0})
    except (SteeringError, SteeringInputError, UncontrollableError, ComputationError):
        return plan
    before, after = scene.objective_of(plan), scene.objective_of(found)
    if not after < before * (1 - _GAIN) or found.error > tolerance:
        return plan
    X = found.X(np.linspace(0, found.duration, _LOOKS))
    if min(lowest(each.clearance, X) for each in scene.obstacles) < -CLEAR or tunnels(scene.obstacles, X):
        return plan
    return _joined(plan, found, before, after, scene.word(X))


def _alone(scene: Scene) -> bool:
    """Whether the controls reach every direction without drift or inertia."""
    group = scene.task.system.group
    return reach(group, control_indices(group.algebra, scene.task.system.labels)).controllable


def _transcribed(plan: Plan, scene: Scene, target: Any, tolerance: float, asked: dict[str, Any]) -> Plan:
    group, labels, duration = scene.task.system.group, scene.task.system.labels, scene.task.duration
    free, element = None, plan.target
    if isinstance(target, GoalSet):
        # the plan ends at an element of the set: from there the end moves along the directions that are free
        free, element = cosets(group, target, f"steer({group.name}): target")[1], plan.X_final
    start = None
    if asked.get("start") is not None:
        start, element, asked = seen_from(group, asked["start"], element, asked)
    unsure = asked.get("dynamics") == "second_order" or free is not None
    task = make_task(group, element, labels, duration, tolerance, torques=unsure, drift=asked.get("drift"))
    found = transcription(replace(task, free=free) if free is not None else task, **asked)
    return found if start is None else placed(found, start)


def _joined(plan: Plan, found: Plan, before: float, after: float, word: str | None) -> Plan:
    """The cheaper plan, with what the search knows of the others; its way may have left the class that it began in."""
    known = ("tried", "starts", "reached", "agree", "seed", "goal")
    kept = {name: plan.details[name] for name in known if name in plan.details}
    others = list(plan.details.get("classes", ()))
    if others and word is None:
        word = min(others, key=lambda each: abs(each["cost"] - before))["word"]
    better = {"word": word, "cost": after, "clearance": min(found.details["clearances"])}
    classes = (better, *(each for each in others if each["word"] != word)) if others else ()
    details = {
        **found.details,
        **kept,
        "classes": classes,
        "winner": f"{plan.details['winner']}, sharpened by the transcription",
        "objective_value": after,
        "optimality": "a local minimum of the discretised problem, on the cheapest way that was found",
    }
    return replace(found, method="direct", outcome=replace(found.facts, details=details))
