"""lc.ocp: states, what a problem is made of, and every check of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.exact.positive_matrix import positive_matrix
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.maps.element_pattern import varying_entries
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.identifiers import check_identifier
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.runtime.patience import shows_progress
from lie_codegen.steering.ocp.checks import check_problem
from lie_codegen.steering.ocp.layout import Layout, Shape, check_distinct, layout
from lie_codegen.steering.ocp.problem import OptimalControlProblem
from lie_codegen.steering.ocp.problem_data import (
    INTEGRATORS,
    QUADRATURES,
    Affine,
    Condition,
    Cost,
    ProblemData,
    Rows,
    SecondOrder,
)
from lie_codegen.steering.ocp.terms import Term

Terms = Term | Sequence[Term]


@shows_progress
def ocp(
    group: GroupLike,
    *,
    duration: float | tuple[float, float],
    intervals: int,
    controls: Sequence[str | int] | None = None,
    inputs: Mapping[str, Any] | None = None,
    states: Mapping[str, Any] | None = None,
    velocity: Terms | None = None,
    rates: Mapping[str, Terms] | None = None,
    drift: ArrayLike | None = None,
    dynamics: str = "first_order",
    inertia: ArrayLike | None = None,
    force: Terms | None = None,
    drag: ArrayLike | None = None,
    allocation: ArrayLike | None = None,
    stage_cost: Terms | None = None,
    terminal_cost: Terms | None = None,
    constraints: Terms = (),
    terminal: Terms = (),
    target: str | None = None,
    bounds: Any = None,
    parameters: Mapping[str, Any] | None = None,
    quadrature: str = "trapezoid",
    integrator: str = "rkmk4",
    name: str | None = None,
) -> OptimalControlProblem:
    """An optimal control problem of one's own on a matrix group.

        minimise   sum_k (quadrature of) l(X, z, u, t, p) + phi(X_N, z_N, p)
        subject to X' = X hat(xi(X, z, u, t, p)),  z' = f(X, z, u, t, p),  u constant on each of N intervals,
                   low <= u <= high (exactly),  g(X, z, u, t, p) <= 0,  e(X_N, z_N, p) = 0

    Formulas are texts in the matrix grammar, with the names X, t, and those of inputs, states and parameters (entries: X11,
    v1, M12), or Kernels whose input ports are matched by name.

    Args:
        group: the group, or its name.
        duration: seconds; or a pair (shortest, longest): then it is found too, a number T that formulas may use.
        intervals: N.
        controls: labels (or positions) of the actuated basis elements: xi = sum_i u_i A_i + drift; with
            dynamics="second_order" the body forces that the controls are. The input is called u.
        inputs: names and shapes of inputs of one's own, with `velocity` (first order) or `allocation` (second order).
        states: names and shapes of states beside X.
        velocity: the n components of xi: a text or Kernel of n entries, or one text a component.
        rates: the rate of each state, likewise.
        drift: (n,) constant part of the velocity.
        dynamics: "first_order"; or "second_order": a state xi, I xi' = ad*_xi I xi - drag xi + force + B u.
        inertia: of the second order: a number, (n,) or (n, n), positive definite.
        force: further body force, n entries, of X, xi, t and parameters; or one text a component.
        drag: linear drag: a number, (n,) or (n, n).
        allocation: (n, m) B, instead of `controls`.
        stage_cost, terminal_cost: l and phi. One text is a scalar. A sequence of texts, or a Kernel with the output
            `residual`, is r with the cost |r|^2 / 2; a Kernel with the output `cost` is a scalar; sequences may mix them.
        constraints: g, entry by entry; a text may be "a <= b". Those without a control hold at the end too.
        terminal: e, entry by entry. Ask for a pose by the entries of X - Xd: entries of skew(Xd' X) vanish at half a turn too.
        target: name of a parameter, an element of the group, that X_N must equal.
        bounds: of the controls: a number b for -b <= u <= b, a pair (low, high), or {input: either}.
        parameters: names and shapes; () for a number, "X" for an element of the group.
        quadrature: "trapezoid", "left" (sum of h l(x_k, u_k)), or "simpson".
        integrator: "rkmk4" or "midpoint". Where xi depends on the controls alone a step is one exponential, exactly.
        name: C identifier, the prefix of generated symbols.

    Raises:
        ExpressionError: a formula outside the grammar, with an unknown name, or a matrix as a cost.
        InputError, ShapeError, NotFiniteError: anything else, naming the culprit.
    """
    group = as_group(group, "ocp")
    where = f"ocp({group.name})"
    element: Shape = (group.degree, group.degree, 2) if group.is_complex else (group.degree, group.degree)
    given = dict(parameters or {})
    if target is not None:
        if target not in given:
            given[target] = "X"
        terminal = (*_sequence(terminal), f"X - {target}")
    N = _count(intervals, where)
    T, free = _duration(duration, where)
    for what, known, value in (("quadrature", QUADRATURES, quadrature), ("integrator", INTEGRATORS, integrator)):
        if value not in known or value == "exact":
            names = ", ".join(each for each in known if each != "exact")
            raise InputError(f"{where}: no {what} {value!r}; there are {names}")
    own_inputs, law, own_states, own_rates = _dynamics(
        group, where, dynamics, controls, inputs, states, velocity, rates, drift, inertia, force, drag, allocation
    )
    if free is not None:
        own_states, own_rates = {**own_states, "T": ()}, {**own_rates, "T": ("0",)}
    layouts = (layout("input", own_inputs), layout("state", own_states), layout("parameter", given, element))
    check_distinct(layouts, _entries_of(group))
    if layouts[0].size == 0:
        raise InputError(f"{where}: no controls; give controls= or inputs=")
    lower, upper = _bounds(bounds, layouts[0], where)
    data = ProblemData(
        name=_name(name, group),
        group=group,
        inputs=layouts[0],
        states=layouts[1],
        parameters=layouts[2],
        velocity=law,
        rates=tuple(own_rates.items()),
        stage_cost=_costs(stage_cost, "stage_cost", where),
        terminal_cost=_costs(terminal_cost, "terminal_cost", where),
        constraints=tuple(_condition(each, "g", where) for each in _sequence(constraints)),
        terminal=tuple(_condition(each, "e", where) for each in _sequence(terminal)),
        lower=lower,
        upper=upper,
        duration=T,
        intervals=N,
        quadrature=quadrature,
        integrator=integrator,
        free_duration=free,
    )
    check_problem(data, where)
    return OptimalControlProblem(data)


def _dynamics(
    group: MatrixGroup,
    where: str,
    dynamics: str,
    controls: Sequence[str | int] | None,
    inputs: Mapping[str, Any] | None,
    states: Mapping[str, Any] | None,
    velocity: Terms | None,
    rates: Mapping[str, Terms] | None,
    drift: ArrayLike | None,
    inertia: ArrayLike | None,
    force: Terms | None,
    drag: ArrayLike | None,
    allocation: ArrayLike | None,
) -> tuple[dict[str, Any], Any, dict[str, Any], dict[str, tuple[Term, ...]]]:
    """Inputs, the law of xi, states and their rates."""
    if dynamics not in ("first_order", "second_order"):
        raise InputError(f"{where}: no dynamics {dynamics!r}; there are first_order, second_order")
    second = dynamics == "second_order"
    own_states = dict(states or {})
    own_rates = {key: _sequence(value) for key, value in dict(rates or {}).items()}
    if sorted(own_rates) != sorted(own_states):
        raise InputError(f"{where}: states are {_listed(own_states)}, rates are given of {_listed(own_rates)}")
    only_second = {"inertia": inertia, "force": force, "drag": drag, "allocation": allocation}
    misplaced = [key for key, value in only_second.items() if value is not None and not second]
    if second and velocity is not None:
        misplaced = ["velocity"]
    if second and drift is not None:
        misplaced = ["drift"]
    if misplaced:
        raise InputError(f"{where}: {_listed(misplaced)} has no meaning with dynamics={dynamics!r}")
    if not second and velocity is not None:
        if controls is not None or drift is not None or inputs is None:
            raise InputError(f"{where}: velocity= goes with inputs=, not with controls= or drift=")
        return dict(inputs), _sequence(velocity), own_states, own_rates
    columns = _columns(group, where, controls, inputs, allocation if second else None)
    own_inputs = dict(inputs) if inputs is not None else {"u": columns.shape[1]}
    if not second:
        constant = np.zeros(group.dim) if drift is None else _array(drift, (group.dim,), "drift", where)
        return own_inputs, Affine(_rows(columns), tuple(map(float, constant))), own_states, own_rates
    if inertia is None:
        raise InputError(f"{where}: dynamics='second_order' needs inertia=")
    metric = np.array(positive_matrix(inertia, group.dim, "inertia").tolist(), dtype=float)
    resistance = np.zeros((group.dim, group.dim)) if drag is None else _matrix(drag, group.dim, "drag", where)
    law = SecondOrder(
        _rows(metric), _rows(np.linalg.inv(metric)), _rows(resistance), _rows(columns), _sequence(force or ())
    )
    return own_inputs, law, {"xi": group.dim, **own_states}, own_rates


def _columns(
    group: MatrixGroup,
    where: str,
    controls: Sequence[str | int] | None,
    inputs: Mapping[str, Any] | None,
    allocation: ArrayLike | None,
) -> Array:
    """(n, m) which velocity, or force, each control is."""
    if allocation is not None:
        B = np.asarray(allocation, dtype=float)
        if B.ndim != 2 or B.shape[0] != group.dim or not np.isfinite(B).all():
            raise ShapeError(f"{where}: allocation has shape {B.shape}; it is ({group.dim}, m), finite")
        if controls is not None:
            raise InputError(f"{where}: give controls= or allocation=, not both")
        if inputs is not None and layout("input", inputs).size != B.shape[1]:
            raise ShapeError(f"{where}: allocation has {B.shape[1]} columns, inputs {layout('input', inputs).size}")
        return B
    if controls is None:
        raise InputError(f"{where}: say which basis elements are controlled, controls=; or give inputs= with velocity=")
    if inputs is not None:
        raise InputError(f"{where}: controls= names its input u itself; give inputs= with velocity= or allocation=")
    chosen = [controls] if isinstance(controls, str | int) else list(controls)
    places = [group.algebra.index(each) for each in chosen]
    if len(set(places)) != len(places) or not places:
        raise InputError(f"{where}: controls {chosen} are none or repeat one")
    return np.eye(group.dim)[:, places]


def _costs(terms: Terms | None, what: str, where: str) -> tuple[Cost, ...]:
    """Parts of a cost: one text is a scalar, a sequence of texts a residual, a Kernel what its output is called."""
    if terms is None:
        return ()
    alone = isinstance(terms, str | Kernel)
    parts = []
    for term in _sequence(terms):
        if isinstance(term, Kernel):
            output = term.outputs[0]
            if output.name not in ("residual", "cost"):
                raise InputError(
                    f"{where}: {what}: {term.name} gives {output.name!r}; name its output residual or cost"
                )
            if output.name == "cost" and output.shape not in ((), (1,)):
                raise ShapeError(f"{where}: {what}: the cost of {term.name} has shape {output.shape}; it is a number")
            parts.append(Cost(term, output.name == "residual"))
        else:
            parts.append(Cost(term, not alone))
    return tuple(parts)


def _condition(term: Term, sense: str, where: str) -> Condition:
    """A condition; "a <= b" is a - (b)."""
    what = "constraints" if sense == "g" else "terminal"
    if isinstance(term, Kernel):
        if term.outputs[0].name != sense:
            zero = "<= 0" if sense == "g" else "= 0"
            raise InputError(
                f"{where}: {what}: {term.name} gives {term.outputs[0].name!r}; name its output {sense} ({sense} {zero})"
            )
        return Condition(term.name, term, sense)
    if not isinstance(term, str):
        raise InputError(f"{where}: {what}: a condition is a text or a Kernel, got {term!r:.60}")
    text = term
    for sign in ("<=", ">="):
        if sense == "g" and text.count(sign) == 1:
            left, right = text.split(sign)
            text = f"({left}) - ({right})" if sign == "<=" else f"({right}) - ({left})"
    return Condition(term, text, sense)


def _bounds(given: Any, inputs: Layout, where: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    lower, upper = np.full(inputs.size, -np.inf), np.full(inputs.size, np.inf)
    if given is None:
        return tuple(lower), tuple(upper)
    by_name = given if isinstance(given, Mapping) else None
    places = inputs.slices()
    if by_name is None:
        places, by_name = {"": (slice(0, inputs.size), (inputs.size,))}, {"": given}
    for name, value in by_name.items():
        if name not in places:
            raise InputError(f"{where}: bounds of {name!r}, which is no input; inputs are {', '.join(inputs.names)}")
        place, shape = places[name]
        label = f"bounds of {name}" if name else "bounds"
        pair = value if isinstance(value, tuple | list) and len(value) == 2 else None
        if pair is None:
            high = _broadcast(value, shape, label, where)
            low = -high
        else:
            low, high = (_broadcast(each, shape, label, where) for each in pair)
        lower[place], upper[place] = low.ravel(), high.ravel()
    names = inputs.entry_names()
    for i in np.flatnonzero(~(lower <= upper)):
        raise InputError(f"{where}: bounds of {names[i]} are crossed: {lower[i]:g} > {upper[i]:g}")
    return tuple(map(float, lower)), tuple(map(float, upper))


def _broadcast(value: Any, shape: Shape, label: str, where: str) -> Array:
    try:
        array = np.broadcast_to(np.asarray(value, dtype=float), shape)
    except (TypeError, ValueError):
        raise ShapeError(f"{where}: {label}: {value!r:.60} does not fit the shape {shape}") from None
    if np.isnan(array).any():
        raise NotFiniteError(f"{where}: {label} hold NaN")
    return array


def _sequence(terms: Any) -> tuple[Any, ...]:
    """Terms as a tuple; numbers are texts too.

    Raises:
        InputError: something that is neither a text, a number nor a Kernel.
    """
    if isinstance(terms, str | Kernel):
        return (terms,)
    if not isinstance(terms, Iterable) or isinstance(terms, Mapping):
        raise InputError(f"ocp: expected a text, a Kernel or a sequence of them, got {terms!r:.60}")
    listed = tuple(repr(float(term)) if isinstance(term, int | float) else term for term in terms)
    for term in listed:
        if not isinstance(term, str | Kernel):
            raise InputError(f"ocp: expected a text or a Kernel, got {term!r:.60}")
    return listed


def _listed(names: Any) -> str:
    return ", ".join(names) or "none"


def _count(intervals: Any, where: str) -> int:
    if isinstance(intervals, bool) or not isinstance(intervals, int | np.integer) or not 1 <= intervals <= 100_000:
        raise InputError(f"{where}: intervals must be a whole number from 1 to 100000, got {intervals!r}")
    return int(intervals)


def _duration(duration: Any, where: str) -> tuple[float, tuple[float, float] | None]:
    """The duration of the equations, and the bounds of a free one."""
    ends = duration if isinstance(duration, tuple | list) and len(duration) == 2 else (duration,)
    for end in ends:
        if isinstance(end, bool) or not isinstance(end, int | float | np.number) or not 0 < end < np.inf:
            raise InputError(f"{where}: duration must be a positive number of seconds, or two, got {duration!r}")
    if len(ends) == 1:
        return float(ends[0]), None
    if not ends[0] < ends[1]:
        raise InputError(f"{where}: duration from {ends[0]:g} to {ends[1]:g} s is no range")
    return 1.0, (float(ends[0]), float(ends[1]))


def _name(name: str | None, group: MatrixGroup) -> str:
    chosen = f"{group.name}_ocp" if name is None else name
    check_identifier(chosen, "ocp name")
    return chosen


def _array(value: ArrayLike, shape: Shape, what: str, where: str) -> Array:
    array = np.asarray(value, dtype=float)
    if array.shape != shape or not np.isfinite(array).all():
        raise ShapeError(f"{where}: {what} has shape {array.shape}; it is {shape}, finite")
    return array


def _matrix(value: ArrayLike, n: int, what: str, where: str) -> Array:
    array = np.asarray(value, dtype=float)
    if array.shape == ():
        return np.eye(n) * _array(array, (), what, where)
    return np.diag(_array(array, (n,), what, where)) if array.ndim == 1 else _array(array, (n, n), what, where)


def _rows(matrix: Array) -> Rows:
    return tuple(tuple(float(value) for value in row) for row in matrix)


def _entries_of(group: MatrixGroup) -> tuple[str, ...]:
    return tuple(f"X{i + 1}{j + 1}" for i, j in varying_entries(group))
