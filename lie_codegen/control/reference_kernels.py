"""Reference trajectories as kernels: t -> (X_d, xi_d, xi_d_dot), and the waypoints' quintics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, cast, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lie_codegen.control.curve_reference import CurveReference, curve_kernel, curve_reference
from lie_codegen.control.manifold import Manifold
from lie_codegen.control.reference_motion import (
    FormulaReference,
    PlanReference,
    Reference,
    WaypointReference,
    formula_reference,
)
from lie_codegen.errors import InputError
from lie_codegen.exact.expression import time_symbol
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.exponential import exp_matrix, jacobian
from lie_codegen.groups.maps.matrices import matrix_port, velocity_units
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.definition import double, doubles, kernel_factory, record_factory
from lie_codegen.kernel.dual import DualArithmetic, tangent_of, value_of
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Matrix, Vector, matvec
from lie_codegen.kernel.table_rows import TimeTable

if TYPE_CHECKING:
    from lie_codegen.control.plan_reference import Planned, PlanOnGroup


def motion_kernel(reference: Reference | CurveReference) -> Kernel:
    """What a reference is at a time, on a group or in coordinates."""
    return curve_kernel(reference) if isinstance(reference, CurveReference) else reference_kernel(reference)


@kernel_factory()
def reference_kernel(reference: Reference, name: str = "reference") -> Kernel:
    """The kernel t -> (X_d, xi_d, xi_d_dot)."""
    group = reference.group
    evaluate = ReferenceBody(reference)

    def body(ops: Arithmetic, t: Scalar) -> tuple[Any, ...]:
        return evaluate(ops, t)

    return Kernel(
        name=name,
        namespace=group.name,
        inputs=(Port("t", (), "s"),),
        outputs=(
            matrix_port(group, "X_d", "reference configuration"),
            Port("xi_d", (group.dim,), velocity_units(group), description="X_d' = X_d hat(xi_d)"),
            Port("xi_d_dot", (group.dim,), velocity_units(group, "s^2")),
        ),
        body=body,
        formula="X_d = X_0 exp(g_1 A_1) ... exp(g_n A_n), xi_d = M(g)^-1 g'"
        if isinstance(reference, FormulaReference)
        else "X_d = X_i exp(p_i(s)), p_i quintic",
        source="Wei and Norman, Proc. AMS 15 (1964) 327",
        sampler=lambda rng: (rng.uniform(0, 1),),
    )


class ReferenceBody:
    """(ops, t) -> (X_d, xi_d, xi_d_dot), the matrix in the port's form."""

    def __init__(self, reference: Reference) -> None:
        self.reference = reference
        self.derivation = derivation_of(reference.group)
        self.data = derivation_of(reference.group).wei_norman
        if not isinstance(reference, FormulaReference):
            self._table = _segments(reference)

    def __call__(self, ops: Arithmetic, t: Scalar) -> tuple[Any, Vector, Vector]:
        if isinstance(self.reference, FormulaReference):
            return self._formulas(ops, t, self.reference)
        return self._waypoints(ops, t, self.reference)

    def _formulas(self, ops: Arithmetic, t: Scalar, reference: FormulaReference) -> tuple[Any, Vector, Vector]:
        from lie_codegen.groups.wei_norman.body import body_velocity, product_exp

        evaluate = ExpressionEvaluator(ops, {time_symbol(): t})
        g, rate, turn = ([evaluate(e) for e in row] for row in (reference.g, reference.rates, reference.accelerations))
        dual = DualArithmetic(ops)
        moving = [_variable(dual, a, b) for a, b in zip(g, rate, strict=True)]
        velocity = [_variable(dual, a, b) for a, b in zip(rate, turn, strict=True)]
        xi = body_velocity(dual, self.data, moving, velocity)
        X = _from_left(ops, reference.start, product_exp(ops, self.data, g))
        return X, [value_of(x, dual.level) for x in xi], [tangent_of(x, 0, dual.level) for x in xi]

    def _waypoints(self, ops: Arithmetic, t: Scalar, reference: WaypointReference) -> tuple[Any, Vector, Vector]:
        n, d = reference.group.dim, reference.group.degree
        start, span, *rest = self._table.at(ops, t)
        table, entries = [rest[6 * k : 6 * k + 6] for k in range(n)], rest[6 * n :]
        if reference.group.is_complex:
            entries = [Complex(re, im) for re, im in zip(entries[: d * d], entries[d * d :], strict=True)]
        element = [entries[d * i : d * i + d] for i in range(d)]
        s = (t - start) / span
        inside = ops.where(ops.less(s, 0), 0, ops.where(ops.less(1, s), 1, s))
        p = [_horner(row, inside, 0) for row in table]
        v = [_horner(row, inside, 1) / span for row in table]
        a = [_horner(row, inside, 2) / (span * span) for row in table]
        dual = DualArithmetic(ops)
        moving = [_variable(dual, x, y) for x, y in zip(p, v, strict=True)]
        velocity = [_variable(dual, x, y) for x, y in zip(v, a, strict=True)]
        xi = matvec(jacobian(dual, self.derivation, moving, "right", inverse=False), velocity)
        X = _times(element, exp_matrix(ops, self.derivation, p))
        return X, [value_of(x, dual.level) for x in xi], [tangent_of(x, 0, dual.level) for x in xi]


def _variable(dual: DualArithmetic, value: Scalar, rate: Scalar) -> Scalar:
    variable = dual.variable(value, {0: rate})
    return variable if variable.tangent else variable.value


def _horner(coefficients: Sequence[Scalar], s: Scalar, derivative: int) -> Scalar:
    """A polynomial or its first or second derivative at s; coefficients from the constant up."""
    terms = list(coefficients)
    for _ in range(derivative):
        terms = [k * c for k, c in enumerate(terms)][1:]
    value: Scalar = 0
    for c in reversed(terms):
        value = value * s + c
    return value


def _segments(reference: WaypointReference) -> TimeTable:
    """Start, duration, coefficients and first waypoint of every segment: 1, 1, 6 n, and d^2 numbers, twice as many of a complex group."""
    starts, X = reference.times[:-1], reference.elements[:-1]
    parts = [X.real, X.imag] if reference.group.is_complex else [X]
    columns = [starts[:, None], np.diff(reference.times)[:, None], np.moveaxis(reference.coefficients, 1, 2), *parts]
    rows = np.concatenate([each.reshape(len(starts), -1) for each in columns], axis=1)
    return TimeTable(starts, np.ascontiguousarray(rows, dtype=float))


def _from_left(ops: Arithmetic, start: NDArray[Any] | None, X: Matrix) -> Any:
    if start is None:
        return X
    left = [
        [Complex(float(z.real), float(z.imag)) if np.iscomplexobj(start) else float(z) for z in row] for row in start
    ]
    return _times(left, X)


def _times(a: list[list[Any]], b: list[list[Any]]) -> list[list[Any]]:
    size = len(a)
    return [
        [sum((a[i][k] * b[k][j] for k in range(1, size)), a[i][0] * b[0][j]) for j in range(size)] for i in range(size)
    ]


def _space(group: Any) -> Any:
    return group if isinstance(group, Manifold) or _is_plan(group) else as_group(group, "reference")


def _is_plan(value: Any) -> bool:
    return all(hasattr(value, name) for name in ("X", "u", "duration"))


@overload
def reference(group: Manifold, formulas: Sequence[Any]) -> CurveReference: ...


@overload
def reference(
    group: GroupLike, formulas: Planned, *, smoothing: float | None = None, tolerance: float = 1e-8
) -> PlanReference: ...


@overload
def reference(
    group: PlanOnGroup, *, duration: float | None = None, smoothing: float | None = None, tolerance: float = 1e-8
) -> PlanReference: ...


@overload
def reference(
    group: GroupLike,
    formulas: Sequence[Any] | None = None,
    *,
    times: ArrayLike | None = None,
    waypoints: ArrayLike | None = None,
    samples: ArrayLike | None = None,
    start: Any = None,
    smoothing: float | None = None,
    tolerance: float = 1e-8,
    plan: Planned | None = None,
    duration: float | None = None,
) -> Reference: ...


@record_factory(group=_space, times=doubles, waypoints=doubles, samples=doubles, start=doubles)
def reference(
    group: GroupLike | Manifold | PlanOnGroup,
    formulas: Sequence[Any] | Planned | None = None,
    *,
    plan: Planned | None = None,
    duration: float | None = None,
    times: ArrayLike | None = None,
    waypoints: ArrayLike | None = None,
    samples: ArrayLike | None = None,
    start: Any = None,
    smoothing: float | None = None,
    tolerance: float = 1e-8,
) -> Reference | CurveReference:
    """A reference from formulas of t, from a plan, or from waypoints; its velocity and acceleration are derived.

    Args:
        group: the group; or a manifold, then formulas are its N coordinates; or a plan alone, as in `lc.reference(plan)`.
        formulas: (n,) texts or expressions of t: X_d = start exp(g_1(t) A_1) ... exp(g_n(t) A_n). Or the plan
            of a manoeuvre, as `steer` makes it: then the reference says its `error` and what it rounds off (`PlanReference`).
        plan: the same.
        duration: with a plan without drift: the time [s] it takes, from rest to rest, X_d(t) = X(s(t)) with quintics s that stop
            wherever the plan's controls jump: nothing is rounded off.
        times, waypoints: (k,) and (k, d, d), instead of formulas; at rest at both ends.
        samples: (k, d, d), 5 to 1024 of a smooth curve at the times, in the place of waypoints: velocities and accelerations are those of
            polynomials through five neighbours.
        start: (d, d) for formulas.
        smoothing: for a plan: the time before and after a jump of the controls in which it is rounded off [s]; a hundredth of the
            duration if None.
        tolerance: for a plan: on the entries of X, away from the jumps.

    Raises:
        InputError: both or neither given; else as `formula_reference`, `plan_reference` and `waypoint_reference`.
    """
    if isinstance(group, Manifold):
        return _on_manifold(group, formulas)
    if _is_plan(group):
        if formulas is not None or plan is not None:
            raise InputError("reference: a plan comes alone, or after its group")
        formulas = cast("PlanOnGroup", group)
        group = formulas.group
    group = as_group(cast("GroupLike", group), "reference")
    if plan is not None:
        if formulas is not None:
            raise InputError("reference: give the plan as plan= or in the place of formulas, not both")
        formulas = plan
    # A reference that is made again from its definition is given texts such as "1/100000000".
    duration, smoothing = (double(each) if isinstance(each, str) else each for each in (duration, smoothing))
    tolerance = double(tolerance) if isinstance(tolerance, str) else tolerance
    if duration is not None:
        if not _is_plan(formulas):
            raise InputError("reference: duration= goes with a plan")
        from lie_codegen.control.retimed_plan import retimed

        formulas = retimed(cast("Planned", formulas), float(duration))
    if samples is not None and waypoints is not None:
        raise InputError("reference: give waypoints, to rest at both ends, or samples of a smooth curve, not both")
    points = waypoints if samples is None else samples
    if (formulas is None) == (times is None or points is None):
        raise InputError(
            f"a reference on {group.name} is given by formulas, by a plan, or by times and waypoints (or times and samples)"
        )
    if _is_plan(formulas):
        if start is not None:
            raise InputError("reference: a plan begins where it begins; start= goes with formulas")
        from lie_codegen.control.plan_reference import plan_reference

        return plan_reference(group, cast("Planned", formulas), smoothing=smoothing, tolerance=tolerance)
    if smoothing is not None:
        raise InputError("reference: smoothing= goes with a plan")
    if formulas is not None:
        formulas = cast(Sequence[Any], formulas)
        return formula_reference(group, formulas, start=start)
    from lie_codegen.control.waypoints import sampled_reference, waypoint_reference

    made = waypoint_reference if samples is None else sampled_reference
    return made(group, np.asarray(doubles(times)), np.asarray(doubles(points)))


def _on_manifold(space: Manifold, formulas: Any) -> CurveReference:
    """r(t), which must stay on the manifold: r' and r'' are its derivatives, so that J r' = 0 and r'' has its part across.

    Raises:
        InputError: not N formulas, or it leaves the manifold; with the figure and the time.
    """
    if isinstance(formulas, str) or not isinstance(formulas, list | tuple) or len(formulas) != space.size:
        raise InputError(f"a reference on {space.name} is {space.size} formulas of t, one a coordinate")
    made = curve_reference(formulas)
    c, _ = space.numeric
    for t in np.linspace(0, 10, 61):
        point = np.array([float(entry.subs(time_symbol(), float(t))) for entry in made.r])
        off = np.max(np.abs(np.array(c(point), dtype=float)), initial=0.0)
        if not off <= 1e-9 * max(1.0, float(np.max(np.abs(point)))):
            raise InputError(f"the reference leaves the manifold {space.name}: c(r) = {off:.3g} at t = {t:.6g}, not 0")
    return made
