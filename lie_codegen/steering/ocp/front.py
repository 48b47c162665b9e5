"""lc.ocp: states, what a problem is made of, and every check of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.errors import InputError
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.maps.element_pattern import varying_entries
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.identifiers import check_identifier
from lie_codegen.runtime.patience import shows_progress
from lie_codegen.steering.goals import GoalSet
from lie_codegen.steering.ocp.bounds import bounds_of
from lie_codegen.steering.ocp.checks import check_problem
from lie_codegen.steering.ocp.dynamics import dynamics_of
from lie_codegen.steering.ocp.goal_terms import fixed_terms
from lie_codegen.steering.ocp.layout import Shape, check_distinct, layout
from lie_codegen.steering.ocp.problem import OptimalControlProblem
from lie_codegen.steering.ocp.problem_data import INTEGRATORS, QUADRATURES, ProblemData
from lie_codegen.steering.ocp.written_terms import Terms, conditions_of, costs_of, sequence_of
from lie_codegen.steering.task import LONGEST, SHORTEST


@shows_progress
def ocp(
    group: GroupLike,
    *,
    duration: float | tuple[float, float],
    intervals: int,
    controls: Sequence[Any] | None = None,
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
    target: str | GoalSet | None = None,
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
        controls: labels (or positions) of the actuated basis elements, or (n,) vectors: xi = sum_i u_i b_i + drift; with
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
        constraints: g, entry by entry; a text may be "a <= b", "a >= b" or "a <= b <= c". Those without a control hold at the end too.
        terminal: e, entry by entry. Ask for a pose by the entries of X - Xd: entries of skew(Xd' X) vanish at half a turn too.
        target: name of a parameter, an element of the group, that X_N must equal; or a set of goals that X_N must be in: a `Pointing`, a
            `Position`, a `Coset`, a gate on some levels (`UpToPhase(U, levels=)`), written by linear equations in the entries of X
            (`error` is what is left of them).
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
    if isinstance(target, GoalSet):
        terminal = (*sequence_of(terminal), *fixed_terms(group, target, f"{where}: target"))
    elif target is not None:
        if not isinstance(target, str):
            raise InputError(
                f"{where}: target is the name of a parameter, or a Pointing, Position, Coset or UpToPhase, got {target!r:.80}"
            )
        if target not in given:
            given[target] = "X"
        terminal = (*sequence_of(terminal), f"X - {target}")
    N = _count(intervals, where)
    T, free = _duration(duration, where)
    for what, known, value in (("quadrature", QUADRATURES, quadrature), ("integrator", INTEGRATORS, integrator)):
        if value not in known or value == "exact":
            names = ", ".join(each for each in known if each != "exact")
            raise InputError(f"{where}: no {what} {value!r}; there are {names}")
    own_inputs, law, own_states, own_rates = dynamics_of(
        group, where, dynamics, controls, inputs, states, velocity, rates, drift, inertia, force, drag, allocation
    )
    if free is not None:
        own_states, own_rates = {**own_states, "T": ()}, {**own_rates, "T": ("0",)}
    layouts = (layout("input", own_inputs), layout("state", own_states), layout("parameter", given, element))
    check_distinct(layouts, _entries_of(group))
    if layouts[0].size == 0:
        raise InputError(f"{where}: no controls; give controls= or inputs=")
    lower, upper = bounds_of(bounds, layouts[0], where)
    data = ProblemData(
        name=_name(name, group),
        group=group,
        inputs=layouts[0],
        states=layouts[1],
        parameters=layouts[2],
        velocity=law,
        rates=tuple(own_rates.items()),
        stage_cost=costs_of(stage_cost, "stage_cost", where),
        terminal_cost=costs_of(terminal_cost, "terminal_cost", where),
        constraints=conditions_of(constraints, "g", where),
        terminal=conditions_of(terminal, "e", where),
        lower=lower,
        upper=upper,
        duration=T,
        intervals=N,
        quadrature=quadrature,
        integrator=integrator,
        free_duration=free,
        elements=tuple(name for name, shape in given.items() if shape == "X" or name == target),
    )
    check_problem(data, where)
    return OptimalControlProblem(data)


def _count(intervals: Any, where: str) -> int:
    if isinstance(intervals, bool) or not isinstance(intervals, int | np.integer) or not 1 <= intervals <= 100_000:
        raise InputError(f"{where}: intervals must be a whole number from 1 to 100000, got {intervals!r}")
    return int(intervals)


def _duration(duration: Any, where: str) -> tuple[float, tuple[float, float] | None]:
    """The duration of the equations, and the bounds of a free one."""
    ends = duration if isinstance(duration, tuple | list) and len(duration) == 2 else (duration,)
    for end in ends:
        if isinstance(end, bool) or not isinstance(end, int | float | np.number) or not SHORTEST <= end <= LONGEST:
            raise InputError(
                f"{where}: duration must be a positive number of seconds between {SHORTEST:g} and {LONGEST:g}, or two, "
                f"got {duration!r}"
            )
    if len(ends) == 1:
        return float(ends[0]), None
    if not ends[0] < ends[1]:
        raise InputError(f"{where}: duration from {ends[0]:g} to {ends[1]:g} s is no range")
    return 1.0, (float(ends[0]), float(ends[1]))


def _name(name: str | None, group: MatrixGroup) -> str:
    chosen = f"{group.name}_ocp" if name is None else name
    check_identifier(chosen, "ocp name")
    return chosen


def _entries_of(group: MatrixGroup) -> tuple[str, ...]:
    return tuple(f"X{i + 1}{j + 1}" for i, j in varying_entries(group))
