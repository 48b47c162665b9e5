"""From controls that were flown to a Plan: error, violations, cost, fidelity."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow.logarithm import distance
from lie_codegen.steering.direct.assemble import Manoeuvre
from lie_codegen.steering.direct.inputs import Drive, Inputs
from lie_codegen.steering.direct.polish import Flown
from lie_codegen.steering.goals import GoalSet
from lie_codegen.steering.plan import Controls, Facts, Plan, Status


def plan_of(
    task: Manoeuvre,
    target: Any,
    found: Flown,
    variant: int,
    tolerance: float,
    objective: str,
    details: dict[str, Any],
    seconds: dict[str, float],
    status: Status | None = None,
) -> Plan:
    """The plan of inputs that were flown; its error is the true system's."""
    system, group = task.system, task.system.group
    error = error_at(task, found, variant)
    inputs = found.inputs
    over = max(
        0.0,
        float(
            np.max([inputs.first - task.high, task.low - inputs.first, inputs.last - task.high, task.low - inputs.last])
        ),
    )
    aim = task.end.elements[variant] if task.end.elements is not None else found.X
    steady = inputs.knots[1:-1]
    told = {
        "goal": target if isinstance(target, GoalSet) else aim,
        "inputs": inputs,
        "system": system,
        "violation": {"end": error, "bound": over},
        "objective_value": cost_of(task, inputs, objective),
        "weights": task.weights,
        "control_peaks": inputs.peaks(),
        "fidelity": fidelity(task, found.X, variant),
        **details,
    }
    if task.end.levels:
        told["leakage"] = leakage(found.X, task.end.levels)
    if not system.right and system.drift.constant is not None and np.any(system.drift.constant):
        told["drift"] = system.drift.constant
    if np.any(system.start != np.eye(group.degree)):
        told["start"] = system.start
    return Plan(
        group=group,
        target=aim,
        controls=system.labels,
        duration=float(inputs.knots[-1]),
        method="direct",
        u=Controls(Drive(system, inputs), steady),
        cost=cost_of(task, inputs, objective)
        if objective == "fuel"
        else inputs.integral_of_squares(np.ones(task.controls)),
        outcome=Facts(
            found.X,
            error,
            status or (Status.LOCAL if error <= tolerance else Status.NOT_CONVERGED),
            told,
            seconds,
        ),
    )


def error_at(task: Manoeuvre, found: Flown, variant: int) -> float:
    """|log(T^-1 X)| where the goal is an element up to free motions, else the distance of what the goal prescribes."""
    end = task.end
    if end.elements is None:
        scale = float(np.max(np.abs(end.left)))
        return found.miss / scale
    return distance(task.system.group, end.elements[variant], found.free[0] @ found.X @ found.free[1])


def fidelity(task: Manoeuvre, X: Array, variant: int) -> float | None:
    """|tr(U^H X)|^2 / d^2 of unitary groups, None on others: one for the gate up to its phase; of a gate on s levels |tr(U^H X_s)|^2 / s^2
    with the block X_s of these levels."""
    elements = task.end.elements
    if elements is None or not task.system.group.is_complex:
        return None
    levels = task.end.levels or range(task.system.group.degree)
    block = np.ix_(levels, levels)
    return float(np.abs(np.vdot(elements[variant][block], X[block])) ** 2 / len(levels) ** 2)


def leakage(X: Array, levels: Sequence[int]) -> float:
    """1 - tr(X_s^H X_s) / s: what leaves the levels, the mean over states that begin in them."""
    return max(0.0, float(1 - np.sum(np.abs(X[np.ix_(levels, levels)]) ** 2) / len(levels)))


def cost_of(task: Manoeuvre, inputs: Inputs, objective: str) -> float:
    """The objective of inputs."""
    if objective == "time":
        return float(inputs.knots[-1])
    return float(
        inputs.integral_of_sizes(task.weights) if objective == "fuel" else inputs.integral_of_squares(task.weights)
    )
