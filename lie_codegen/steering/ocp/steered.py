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
from lie_codegen.flow.elements import group_element
from lie_codegen.groups.matrix_group import MatrixGroup, require_group
from lie_codegen.steering.direct.system import velocity
from lie_codegen.steering.goals import Coset, Pointing, Position, UpToPhase, cosets
from lie_codegen.steering.ocp.problem_data import Affine
from lie_codegen.steering.ocp.stage_controls import StageControls
from lie_codegen.steering.plan import Controls, Facts, Plan, Status

if TYPE_CHECKING:
    from lie_codegen.steering.ocp.problem import OptimalControlProblem

_GOAL = "steer_goal"


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
        group, target, controls, duration, tolerance: as `lc.steer`; a pair of durations is searched between. Goals are
            elements, `Pointing`, `Position`, `UpToPhase`, and a `Coset` of a real group whose free motions are all that keep some
            vectors where they are (turns about an axis).
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
    if isinstance(target, UpToPhase):
        asked = {
            "cost": cost, "terminal_cost": terminal_cost, "constraints": constraints, "parameters": parameters, "bounds": bounds,
            "drift": drift, "start": start, "intervals": intervals, "starts": starts, "seed": seed, "guess": guess,
            "quadrature": quadrature, "integrator": integrator,
        }  # fmt: skip
        return _cheapest_phase(group, target, controls, duration, tolerance, asked)
    own = {name: np.asarray(value) for name, value in dict(parameters or {}).items()}
    terminal, goal, values = _goal(group, target, own)
    shapes = tuple((name, "X" if name == _GOAL else value.shape) for name, value in values.items())
    frozen = [_frozen(each) for each in (cost, terminal_cost, constraints, bounds, drift, duration)]
    began = time.perf_counter()
    problem = _problem(
        group, tuple(controls), *frozen, terminal=terminal, shapes=shapes, intervals=intervals,
        quadrature=quadrature, integrator=integrator,
    )  # fmt: skip
    first = np.eye(group.degree) if start is None else start
    found = problem.solve(first, guess=guess, starts=starts, seed=seed, **values)
    steered = (
        None if guess is not None or goal is None or start is not None else _extremal(problem, goal, found.duration)
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
    law = problem.data.velocity
    columns = np.array(law.columns) if isinstance(law, Affine) else np.eye(group.dim)
    velocities = StageControls(np.asarray(found.u) @ columns.T, found.duration)
    return Plan(
        group=group,
        target=found.X_final if goal is None else goal,
        controls=tuple(group.labels[group.algebra.index(each)] for each in controls),
        duration=found.duration,
        method="ocp",
        u=Controls(velocities, found.t),
        cost=found.cost,
        outcome=Facts(
            found.X_final,
            found.error,
            Status.LOCAL if found.error <= tolerance else Status.NOT_CONVERGED,
            {
                "plan": found,
                "problem": problem,
                "inputs": StageControls(found.u, found.duration),
                **({} if start is None else {"start": np.asarray(found.X[0])}),
                **_constant_drift(group, drift),
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
        SteeringInputError: any phase will do, as on U(d).
        SteeringError: no phase is reached.
    """
    elements, free = cosets(group, target, f"steer({group.name}): target")
    if len(free):
        raise SteeringInputError(
            f"steer({group.name}): with costs or constraints of one's own the gate must be up to one of finitely many phases: give it "
            'with its phase, on all levels; method="direct" takes any'
        )
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


def _kept_columns(group: MatrixGroup, target: Coset) -> tuple[Array, Array]:
    """Columns V (d, k) and T V so that X is in the coset exactly where X V = T V.

    Raises:
        SteeringInputError: other motions than the free ones keep the vectors that those keep, or the group is complex.
    """
    where = f"steer({group.name}): target"
    elements, free = cosets(group, target, where)
    if not group.is_complex:
        _, sizes, across = np.linalg.svd(group.hat(free).reshape(-1, group.degree))
        V = across[int(np.sum(sizes > 1e-10)) :].T
        slopes = (group.basis @ V).reshape(group.dim, -1)
        if group.dim - np.linalg.matrix_rank(slopes, tol=1e-10) == np.linalg.matrix_rank(free, tol=1e-10):
            return V, elements[0] @ V
    raise SteeringInputError(
        f"{where}: with costs or constraints of one's own a Coset must be that of all motions that keep some vectors where they are, "
        'as turns about an axis do, in a real group; method="direct" and "transcription" take any'
    )


def _goal(
    group: MatrixGroup, target: Any, values: dict[str, Any]
) -> tuple[tuple[str, ...], Array | None, dict[str, Any]]:
    """The terminal texts, the element if the goal is one, and the parameters with those of the goal."""
    d = group.degree
    if isinstance(target, Pointing) and not group.is_complex:
        axis, direction = np.zeros(d), np.zeros(d)
        given = np.asarray(target.direction, dtype=float)
        axis[: len(given)], direction[: len(given)] = np.asarray(target.axis), given / np.linalg.norm(given)
        axis = axis / np.linalg.norm(axis)
        return ("X*goal_axis - goal_direction",), None, {**values, "goal_axis": axis, "goal_direction": direction}
    if isinstance(target, Position) and not group.is_complex:
        point = np.ones(d)
        point[: d - 1] = np.asarray(target.point, dtype=float)
        return ("X*goal_column - goal_point",), None, {**values, "goal_column": np.eye(d)[-1], "goal_point": point}
    if isinstance(target, Coset):
        V, ends = _kept_columns(group, target)
        pairs = zip(V.T, ends.T, strict=True)
        fixed = {f"goal_{kind}{k}": each for k, pair in enumerate(pairs) for kind, each in zip("ve", pair, strict=True)}
        return tuple(f"X*goal_v{k} - goal_e{k}" for k in range(V.shape[1])), None, {**values, **fixed}
    if isinstance(target, Pointing | Position) or not isinstance(target, np.ndarray | list | tuple):
        raise SteeringInputError(
            f"steer({group.name}): with costs or constraints of one's own the goal is an element, a Pointing, a Position or a Coset "
            f"of a real group, or UpToPhase; got {type(target).__name__}"
        )
    element = group_element(group, target, f"steer({group.name}): target")
    return (f"X - {_GOAL}",), element, {**values, _GOAL: element}


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
    terminal: tuple[str, ...],
    shapes: tuple[tuple[str, Any], ...],
    intervals: int,
    quadrature: str,
    integrator: str,
) -> OptimalControlProblem:
    """The problem, made once for equal arguments: another target or another value of a parameter builds nothing."""
    limits = _thawed(bounds)
    if isinstance(limits, Mapping):
        limits = _by_label(group, controls, limits)
    from lie_codegen.steering.ocp.front import ocp  # and with it CasADi, which steering by shooting does without

    return ocp(
        group,
        controls=controls,
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


def _by_label(group: MatrixGroup, controls: tuple[Any, ...], limits: Mapping[Any, Any]) -> Any:
    """Bounds by label, as lc.steer has them, as arrays in the order of the controls."""
    if set(limits) == {"u"}:
        return limits
    labels = [group.labels[group.algebra.index(each)] for each in controls]
    low, high = np.full(len(labels), -np.inf), np.full(len(labels), np.inf)
    for label, limit in limits.items():
        name = group.labels[group.algebra.index(label)]
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
    controls = [int(np.flatnonzero(column)[0]) for column in np.array(law.columns).T]
    try:
        return optimal(make_task(problem.data.group, goal, controls, duration, 1e-6))
    except LieCodegenError:
        return None
