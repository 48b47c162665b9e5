"""What the direct method hands back: smoother controls where they keep to the goal, plans at the edge of what can be reached, the error where nothing was found."""

from __future__ import annotations

import time
from typing import Any

from lie_codegen.arrays import Array
from lie_codegen.errors import SteeringError
from lie_codegen.steering.direct.assemble import Manoeuvre
from lie_codegen.steering.direct.polish import Flown, PolishError, corrected, flown, polished, refined
from lie_codegen.steering.direct.programme import Machine, Settings
from lie_codegen.steering.direct.report import cost_of, plan_of
from lie_codegen.steering.direct.search import Budget, Found
from lie_codegen.steering.plan import Plan, Status

_FUEL_TIMES = 4


def smoother(
    task: Manoeuvre, solver: Machine, u: Array, found: Found, before: Flown, settings: Settings
) -> tuple[Flown, str]:
    """Better controls than the constant pieces, if they keep to the goal as well: what was flown, in words."""
    plain = f"{len(task.own(u))} constant pieces"
    if settings.fuel:
        finer, programme = refined(task, solver, u, found.variant, _FUEL_TIMES, settings)
        _, now = corrected(task, solver, programme, finer, found.variant, False, settings)
        pieces = len(now.inputs.first)
        cheaper = now.inputs.integral_of_sizes(task.weights) < before.inputs.integral_of_sizes(task.weights)
        good = cheaper and now.miss <= max(10 * before.miss, 1e-9)
        return (now, f"{pieces} constant pieces") if good else (before, plain)
    try:
        nodes, programme, pieces = polished(task, solver, u, found.variant, found.cost, settings)
    except PolishError:
        return before, plain
    _, now = corrected(task, solver, programme, nodes, found.variant, True, settings)
    if now.miss <= max(10 * before.miss, 1e-9):
        return now, f"continuous controls, linear on {pieces} pieces"
    return before, plain


def plan_at_the_edge(
    task: Manoeuvre,
    target: Any,
    found: Found,
    best: Flown,
    variant: int,
    budget: Budget,
    tolerance: float,
    objective: str,
    began: float,
) -> Plan:
    """The plan of arcs whose ends moved: nothing cheaper was sought, at the edge of what can be reached there is next to no choice."""
    arcs = len(best.inputs.first)
    details = {
        "winner": "direct, arcs with free ends",
        "objective": objective,
        "tried": (
            *found.tried,
            f"{arcs} arcs with free ends reach it from one of the nearest {len(found.near)} starts",
        ),
        "starts": found.starts,
        "reached": 0,
        "agree": 1,
        "seed": budget.seed,
        "pieces": best.inputs,
        "pieces_cost": cost_of(task, best.inputs, objective),
        "pieces_peaks": best.inputs.peaks(),
        "discretisation": f"none: {arcs} arcs of constant controls",
        "optimality": "not sought: equal pieces did not reach the goal, which lies at the edge of what the bounds allow",
    }
    if task.end.phases:
        details["phase"] = task.end.phases[variant]
    took = {"solve": time.perf_counter() - began}
    return plan_of(task, target, best, variant, tolerance, objective, details, took, Status.SOLVED)


def not_found(
    task: Manoeuvre, target: Any, found: Found, budget: Budget, tolerance: float, began: float
) -> SteeringError:
    """The error, with the nearest plan; it says what was tried and proves nothing."""
    best = flown(task, found.u, found.variant, False)
    details = {
        "tried": found.tried,
        "starts": found.starts,
        "reached": 0,
        "agree": 0,
        "seed": budget.seed,
        "objective": "none",
    }
    plan = plan_of(
        task,
        target,
        best,
        found.variant,
        tolerance,
        "energy",
        details,
        {"solve": time.perf_counter() - began},
        Status.NOT_FOUND,
    )
    name = task.system.group.name
    return SteeringError(
        f"steer({name}): not found, which proves nothing: the nearest of {found.starts} starts ends {plan.error:.3g} from the goal "
        f"({len(found.tried)} rounds, {budget.pieces} pieces, {budget.settings.reach_iterations} iterations, seed {budget.seed}); "
        "it is in .best; more starts, more pieces or another seed may find one, wider bounds may make it possible",
        best=plan,
        violation=plan.violation,
    )
