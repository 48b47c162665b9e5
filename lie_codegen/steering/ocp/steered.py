"""lc.steer with costs, constraints or parameters of one's own: the problem of `lc.ocp` with the target as its end."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import LieCodegenError, SteeringError, SteeringInputError
from lie_codegen.groups.matrix_group import MatrixGroup, require_group
from lie_codegen.steering.direct.report import leakage
from lie_codegen.steering.direct.system import controls_of, velocity
from lie_codegen.steering.goals import GoalSet, UpToPhase, cosets, end_of
from lie_codegen.steering.ocp.goal_terms import GOAL, away, goal_terms
from lie_codegen.steering.ocp.problem_data import Affine
from lie_codegen.steering.ocp.stage_controls import StageControls
from lie_codegen.steering.plan import Controls, Facts, Plan, Status

if TYPE_CHECKING:
    from lie_codegen.steering.ocp.problem import OptimalControlProblem


def open_plan(
    group: MatrixGroup,
    target: Any,
    controls: Sequence[Any],
    duration: Any,
    tolerance: float = 1e-6,
    *,
    cost: Any = None,
    terminal_cost: Any = None,
    constraints: Any = (),
    parameters: Mapping[str, ArrayLike] | None = None,
    bounds: Any = None,
    drift: ArrayLike | None = None,
    start: ArrayLike | None = None,
    intervals: int = 60,
    starts: int = 8,
    seed: int = 0,
    guess: Any = None,
    quadrature: str = "trapezoid",
    integrator: str = "rkmk4",
) -> Plan:
    """The cheapest of several starts of a problem of one's own from the identity (or `start`) to the target.

    Args:
        group, target, controls, duration, tolerance: as `lc.steer`; a pair of durations is searched between. Controls are labels,
            positions or (n,) vectors; goals are elements and all sets of goals whose free motions linear equations in the entries of X
            tell from others (turns about an axis, gates on some levels).
        cost: l of `lc.ocp`, in X, u, t and the parameters; norm2(u) if not given, so that the cost is int |u|^2 dt.
        terminal_cost, constraints: phi and g of `lc.ocp`.
        parameters: {name: value} of the formulas.
        bounds, drift, intervals, quadrature, integrator: as `lc.ocp`.
        start: (d, d) element to start from.
        starts, seed, guess: as `solve`; where the target is an element, the exact extremal without bounds is one of the starts.

    Raises:
        SteeringInputError: a goal or an option that it does not have.
        SteeringError: nothing admissible was found; says what was tried.
        Others as `lc.ocp` and `solve`.
    """
    group = require_group(group, "steer")
    if isinstance(target, UpToPhase) and len(end_of(group, target, f"steer({group.name}): target").phases) > 1:
        asked = {
            "cost": cost, "terminal_cost": terminal_cost, "constraints": constraints, "parameters": parameters, "bounds": bounds,
            "drift": drift, "start": start, "intervals": intervals, "starts": starts, "seed": seed, "guess": guess,
            "quadrature": quadrature, "integrator": integrator,
        }  # fmt: skip
        return _cheapest_phase(group, target, controls, duration, tolerance, asked)
    own = {name: np.asarray(value) for name, value in dict(parameters or {}).items()}
    goal = goal_terms(group, target, f"steer({group.name}): target")
    taken = sorted(set(own) & set(goal.values))
    if taken:
        raise SteeringInputError(
            f"steer({group.name}): the parameter {taken[0]} has a name of the goal's own; choose another"
        )
    values: dict[str, Any] = {**own, **goal.values}
    labels, directions = controls_of(group, controls, f"steer({group.name})")
    moving = [label for label, each in zip(labels, directions, strict=True) if each.constant is None]
    if moving:
        raise SteeringInputError(
            f"steer({group.name}): the control {moving[0]} is a function of the time; with costs or constraints of one's own controls are "
            'labels or (n,) vectors: write such a velocity in lc.ocp(inputs=, velocity=), or take method="direct"'
        )
    shapes = tuple((name, "X" if name == GOAL else value.shape) for name, value in values.items())
    frozen = [_frozen(each) for each in (cost, terminal_cost, constraints, bounds, drift, duration)]
    began = time.perf_counter()
    problem = _problem(
        group, tuple(_frozen(each) for each in controls), *frozen, labels=labels, terminal=goal.terminal, shapes=shapes, intervals=intervals,
        quadrature=quadrature, integrator=integrator,
    )  # fmt: skip
    first = np.eye(group.degree) if start is None else start
    found = problem.solve(first, guess=guess, starts=starts, seed=seed, **values)
    steered = (
        None
        if guess is not None or len(goal.free) or start is not None
        else _extremal(problem, goal.element, found.duration)
    )
    if steered is not None:
        other = problem.solve(first, guess=steered, **values)
        if other.status in (Status.SOLVED, Status.ADMISSIBLE):
            worse = found.status not in (Status.SOLVED, Status.ADMISSIBLE) or other.cost < found.cost
            found = other if worse else found
    if found.status not in (Status.SOLVED, Status.ADMISSIBLE):
        what, stage = found.worst or ("the first trajectory", 0)
        raise SteeringError(
            f"steer({group.name}): {len(found.starts)} starts found nothing admissible (that none is, is not proved); nearest: "
            f"{what} at interval {stage} of {intervals} missed by {found.violation:.3g}; more starts, "
            f"another seed or a guess may find one, wider bounds may make it possible"
        )
    error = max(found.error, away(group, goal, found.X_final))
    law = problem.data.velocity
    columns = np.array(law.columns) if isinstance(law, Affine) else np.eye(group.dim)
    velocities = StageControls(np.asarray(found.u) @ columns.T, found.duration)
    return Plan(
        group=group,
        target=found.X_final if len(goal.free) else goal.element,
        controls=labels,
        duration=found.duration,
        method="ocp",
        u=Controls(velocities, found.t),
        cost=found.cost,
        outcome=Facts(
            found.X_final,
            error,
            Status.LOCAL if error <= tolerance else Status.NOT_CONVERGED,
            {
                "plan": found,
                "problem": problem,
                "inputs": StageControls(found.u, found.duration),
                **({} if start is None else {"start": np.asarray(found.X[0])}),
                **_constant_drift(group, drift),
                **_told(target, found.X_final),
            },
            {"solve": time.perf_counter() - began},
        ),
    )


def _constant_drift(group: MatrixGroup, drift: Any) -> dict[str, Array]:
    """The drift as a fact of the plan, where there is one and it is a constant."""
    if drift is None:
        return {}
    constant = velocity(group, drift, f"steer({group.name}): drift").constant
    return {} if constant is None else {"drift": constant}


def _told(target: Any, X: Array) -> dict[str, Any]:
    """The goal as a fact of the plan, where it is a set; of a gate on some levels, or up to any phase, how good it is."""
    if not isinstance(target, GoalSet):
        return {}
    if not isinstance(target, UpToPhase):
        return {"goal": target}
    levels = tuple(range(len(X))) if target.levels is None else tuple(target.levels)
    block = X[np.ix_(levels, levels)]
    overlap = np.abs(np.vdot(np.asarray(target.gate), block)) ** 2 / len(levels) ** 2
    known = {"goal": target, "fidelity": float(overlap)}
    return known if target.levels is None else {**known, "leakage": leakage(X, levels)}


def _cheapest_phase(
    group: MatrixGroup,
    target: UpToPhase,
    controls: Sequence[Any],
    duration: Any,
    tolerance: float,
    asked: dict[str, Any],
) -> Plan:
    """The cheapest of the plans to each of the phases of a gate that the group has.

    Raises:
        SteeringError: no phase is reached.
    """
    elements, _ = cosets(group, target, f"steer({group.name}): target")
    plans: list[Plan] = []
    failed: list[SteeringError] = []
    for element in elements:
        try:
            plans.append(open_plan(group, element, controls, duration, tolerance, **asked))
        except SteeringError as error:
            failed.append(error)
    if not plans:
        raise failed[0]
    best = min(plans, key=lambda plan: plan.cost)
    return replace(best, outcome=replace(best.facts, details={**best.details, "goal": target}))


def _frozen(value: Any) -> Any:
    """Lists, arrays and mappings as tuples, so that a problem is made once."""
    if isinstance(value, Mapping):
        return ("mapping", *((name, _frozen(each)) for name, each in value.items()))
    if isinstance(value, np.ndarray):
        return ("array", *value.ravel().tolist(), value.shape)
    if isinstance(value, list | tuple):
        return ("sequence", *map(_frozen, value))
    return value


def _thawed(value: Any) -> Any:
    """What `_frozen` was given."""
    if not isinstance(value, tuple):
        return value
    kind, *rest = value
    if kind == "mapping":
        return {name: _thawed(each) for name, each in rest}
    if kind == "array":
        return np.array(rest[:-1]).reshape(rest[-1])
    return tuple(map(_thawed, rest))


@lru_cache(maxsize=32)
def _problem(
    group: MatrixGroup,
    controls: tuple[Any, ...],
    cost: Any,
    terminal_cost: Any,
    constraints: Any,
    bounds: Any,
    drift: Any,
    duration: Any,
    *,
    labels: tuple[str, ...],
    terminal: tuple[str, ...],
    shapes: tuple[tuple[str, Any], ...],
    intervals: int,
    quadrature: str,
    integrator: str,
) -> OptimalControlProblem:
    """The problem, made once for equal arguments: another target or another value of a parameter builds nothing."""
    limits = _thawed(bounds)
    if isinstance(limits, Mapping):
        limits = _by_label(group, labels, limits)
    from lie_codegen.steering.ocp.front import ocp  # and with it CasADi, which steering by shooting does without

    return ocp(
        group,
        controls=_thawed(("sequence", *controls)),
        duration=_thawed(duration),
        intervals=intervals,
        stage_cost="norm2(u)" if cost is None else _thawed(cost),
        terminal_cost=_thawed(terminal_cost),
        constraints=_thawed(constraints) or (),
        terminal=terminal,
        bounds=limits,
        drift=_thawed(drift),
        parameters=dict(shapes),
        quadrature=quadrature,
        integrator=integrator,
        name=f"{group.name}_steered",
    )


def _by_label(group: MatrixGroup, labels: tuple[str, ...], limits: Mapping[Any, Any]) -> Any:
    """Bounds by label, as lc.steer has them, as arrays in the order of the controls."""
    if set(limits) == {"u"}:
        return limits
    low, high = np.full(len(labels), -np.inf), np.full(len(labels), np.inf)
    for label, limit in limits.items():
        name = label if label in labels else group.labels[group.algebra.index(label)]
        if name not in labels:
            raise SteeringInputError(f"steer({group.name}): bounds of {label!r}, which is no control")
        pair = limit if isinstance(limit, tuple | list) else (-limit, limit)
        low[labels.index(name)], high[labels.index(name)] = pair
    return low, high


def _extremal(problem: OptimalControlProblem, goal: Array, duration: float) -> Plan | None:
    """The exact extremal of least energy without bounds, as a first guess; None where there is none."""
    from lie_codegen.steering.shooting.method import optimal
    from lie_codegen.steering.task import make_task

    law = problem.data.velocity
    if not isinstance(law, Affine) or any(law.drift):
        return None
    columns = np.array(law.columns).T
    if np.any(np.sum(columns != 0, axis=1) != 1) or np.any(np.sum(columns, axis=1) != 1):
        return None  # shooting has basis elements alone
    controls = [int(np.flatnonzero(column)[0]) for column in columns]
    try:
        return optimal(make_task(problem.data.group, goal, controls, duration, 1e-6))
    except LieCodegenError:
        return None
