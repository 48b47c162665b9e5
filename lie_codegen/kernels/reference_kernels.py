"""Reference trajectories as kernels: t -> (X_d, xi_d, xi_d_dot), and the waypoints' quintics."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lie_codegen.control.reference import TIME, FormulaReference, Reference, WaypointReference, formula_reference
from lie_codegen.errors import InputError, NotOnGroupError, ShapeError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernels.arithmetic import Arithmetic, FloatArithmetic, Scalar
from lie_codegen.kernels.block_solve import add, product
from lie_codegen.kernels.complex_scalar import Complex
from lie_codegen.kernels.dual import Dual, DualArithmetic, tangent_of, value_of
from lie_codegen.kernels.exponential_map import exp_matrix, jacobian
from lie_codegen.kernels.expressions import ExpressionEvaluator
from lie_codegen.kernels.group_derivation import GroupDerivation
from lie_codegen.kernels.group_matrices import matrix_port, velocity_units
from lie_codegen.kernels.kernel import Kernel, Port
from lie_codegen.kernels.linear import Matrix, Vector, matvec
from lie_codegen.kernels.logarithm import log_coordinates
from lie_codegen.kernels.wei_norman_body import WeiNormanData, inverse_columns, product_exp

#: How far a waypoint may lie off the group, relative to its size.
_ON_GROUP = 1e-8
#: Width, relative to the horizon, at which a change that is still there counts as a jump, and its size.
_JUMP_WIDTH, _JUMP_SIZE = 1e-9, 1e-5


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
        self.derivation = GroupDerivation(reference.group)
        self.data = WeiNormanData(reference.group)

    def __call__(self, ops: Arithmetic, t: Scalar) -> tuple[Any, Vector, Vector]:
        if isinstance(self.reference, FormulaReference):
            return self._formulas(ops, t, self.reference)
        return self._waypoints(ops, t, self.reference)

    def _formulas(self, ops: Arithmetic, t: Scalar, reference: FormulaReference) -> tuple[Any, Vector, Vector]:
        evaluate = ExpressionEvaluator(ops, {TIME: t})
        g, rate, turn = ([evaluate(e) for e in row] for row in (reference.g, reference.rates, reference.accelerations))
        dual = DualArithmetic(ops)
        moving = [_variable(dual, a, b) for a, b in zip(g, rate, strict=True)]
        velocity = [_variable(dual, a, b) for a, b in zip(rate, turn, strict=True)]
        columns = inverse_columns(dual, self.data, moving)
        xi: Vector = [0] * reference.group.dim
        for (i, j), entry in columns.items():
            xi[i] = add(xi[i], product(entry, velocity[j]))
        X = _from_left(ops, reference.start, product_exp(ops, self.data, g))
        return X, [value_of(x, dual.level) for x in xi], [tangent_of(x, 0, dual.level) for x in xi]

    def _waypoints(self, ops: Arithmetic, t: Scalar, reference: WaypointReference) -> tuple[Any, Vector, Vector]:
        start, span, table, element = _segment(ops, t, reference)
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


def waypoint_reference(group: MatrixGroup, times: ArrayLike, waypoints: ArrayLike) -> WaypointReference:
    """A twice continuously differentiable curve through the waypoints, at rest at both ends.

    At an inner waypoint its velocity is the mean of the constant velocities of the two segments that meet there,
    weighted by the other's duration, and its acceleration is zero.

    Args:
        group: the group.
        times: (k,) increasing [s], k >= 2.
        waypoints: (k, d, d) elements.

    Raises:
        ShapeError: the shapes do not fit.
        InputError: times that do not increase (a jump), or two waypoints whose relative element has no unique
        logarithm. NotOnGroupError: a waypoint is off the group.
    """
    t = np.asarray(times, dtype=float)
    X = np.asarray(waypoints, dtype=complex if group.is_complex else float)
    if t.ndim != 1 or len(t) < 2 or X.shape != (len(t), group.degree, group.degree):
        raise ShapeError(
            f"waypoints on {group.name}: times {t.shape} and elements {X.shape}; give (k,) and "
            f"(k, {group.degree}, {group.degree}) with k >= 2"
        )
    if not (np.all(np.isfinite(t)) and np.all(np.isfinite(X))):
        raise InputError("waypoints hold NaN or infinity")
    bad = np.flatnonzero(np.diff(t) <= 0)
    if len(bad):
        raise InputError(
            f"the reference jumps: waypoint {bad[0] + 2} at t = {t[bad[0] + 1]:g} does not come after waypoint "
            f"{bad[0] + 1} at t = {t[bad[0]]:g}; times must increase"
        )
    moves = np.array([_relative_log(group, X[i], X[i + 1], i) for i in range(len(t) - 1)])
    spans = np.diff(t)
    mean = moves / spans[:, None]
    speed = np.zeros((len(t), group.dim))
    weight = spans[1:] / (spans[1:] + spans[:-1])
    speed[1:-1] = weight[:, None] * mean[:-1] + (1 - weight)[:, None] * mean[1:]
    derivation = GroupDerivation(group)
    table = [_quintic(derivation, moves[i], speed[i], speed[i + 1], spans[i]) for i in range(len(spans))]
    return WaypointReference(group, t, X, np.array(table))


def check_reference(
    reference: Reference, t0: float, t1: float, evaluate: Callable[[float], Any] | None = None, samples: int = 400
) -> None:
    """Refuses a reference that jumps, or whose velocity or acceleration does, between t0 and t1.

    Args:
        reference: what to check.
        t0: first time.
        t1: last time.
        evaluate: t -> (X_d, xi_d, xi_d_dot), as the compiled `reference_kernel` gives it; in Python floats if None.
        samples: number of intervals of the first look.

    Raises:
        InputError: it jumps or is not finite; names the time.
    """
    body = ReferenceBody(reference)
    at = evaluate or (lambda t: body(FloatArithmetic(), t))
    name = reference.group.name

    def value(t: float) -> NDArray[Any]:
        try:
            X, xi, rate = at(t)
        except InputError:
            raise
        except (ValueError, ZeroDivisionError, OverflowError):
            raise InputError(f"the reference on {name} has no finite value at t = {t:.9g}") from None
        entries = [part for row in X for z in row for part in _parts(z)]
        result = np.array([float(x) for x in (*entries, *xi, *rate)])
        if not np.all(np.isfinite(result)):
            raise InputError(f"the reference on {name} has no finite value at t = {t:.9g}")
        return result

    grid = np.linspace(t0, t1, samples + 1)
    values = [value(float(t)) for t in grid]
    changes = [float(np.max(np.abs(b - a))) for a, b in pairwise(values)]
    for index in np.argsort(changes)[::-1][:8]:
        low, high, a, b = float(grid[index]), float(grid[index + 1]), values[index], values[index + 1]
        while high - low > _JUMP_WIDTH * (t1 - t0):
            middle = (low + high) / 2
            c = value(middle)
            if np.max(np.abs(c - a)) >= np.max(np.abs(b - c)):
                high, b = middle, c
            else:
                low, a = middle, c
        size = float(np.max(np.abs(b - a)))
        if size > _JUMP_SIZE * max(1.0, changes[index]):
            raise InputError(
                f"the reference on {name}, its velocity or its acceleration jumps by {size:.3g} at t = {low:.9g}; "
                "tracking needs a twice differentiable reference: smooth it, or give waypoints"
            )


def _parts(z: Any) -> tuple[float, float]:
    return (z.re, z.im) if isinstance(z, Complex) else (z.real, z.imag)


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


def _segment(
    ops: Arithmetic, t: Scalar, reference: WaypointReference
) -> tuple[Scalar, Scalar, list[Vector], list[list[Any]]]:
    """Start, duration, (n, 6) coefficients and first waypoint of the segment that holds t."""
    starts, n = reference.times[:-1], reference.group.dim
    later = [ops.less(float(start), t) for start in starts[1:]]

    def chosen(values: NDArray[Any]) -> Scalar:
        result: Scalar = float(values[0])
        for condition, value in zip(later, values[1:], strict=True):
            if any(other != values[0] for other in values):
                result = ops.where(condition, float(value), result)
        return result

    spans = np.diff(reference.times)
    table = [[chosen(reference.coefficients[:, m, k]) for m in range(6)] for k in range(n)]
    X = reference.elements[:-1]
    size = range(reference.group.degree)
    if reference.group.is_complex:
        element = [[Complex(chosen(X[:, i, j].real), chosen(X[:, i, j].imag)) for j in size] for i in size]
    else:
        element = [[chosen(X[:, i, j]) for j in size] for i in size]
    return chosen(starts), chosen(spans), table, element


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


def _relative_log(group: MatrixGroup, X: NDArray[Any], Y: NDArray[Any], index: int) -> NDArray[Any]:
    relative = np.linalg.solve(X, Y)
    x = _logarithm(group, relative)
    if x is not None:
        return x
    for number, element in ((index + 1, X), (index + 2, Y)):
        if not _on_group(group, element):
            raise NotOnGroupError(f"waypoint {number} is not on {group.name}, or too far from its identity")
    raise InputError(
        f"between waypoints {index + 1} and {index + 2} there is no unique way (their relative element has no "
        "principal logarithm, as a turn by 180 degrees has none); put a waypoint between them"
    )


def _logarithm(group: MatrixGroup, X: NDArray[Any]) -> NDArray[Any] | None:
    """The x with exp(hat(x)) = X, or None where the principal logarithm is not in the algebra."""
    derivation, ops = GroupDerivation(group), FloatArithmetic()
    try:
        x = np.array(log_coordinates(ops, derivation, _scalars(X)), dtype=float)
        off = float(np.max(np.abs(_numbers(exp_matrix(ops, derivation, x.tolist())) - X)))
    except (ArithmeticError, ValueError):
        return None
    turn = float(np.max(np.abs(np.linalg.eigvals(group.hat(x)).imag)))
    if turn > np.pi * (1 - 1e-9):
        return None  # the other way round is as short
    return x if off <= _ON_GROUP * max(1.0, float(np.max(np.abs(X)))) else None


def _scalars(X: NDArray[Any]) -> list[list[Any]]:
    if np.iscomplexobj(X):
        return [[Complex(float(z.real), float(z.imag)) for z in row] for row in X]
    return [[float(x) for x in row] for row in X]


def _numbers(X: Sequence[Sequence[Any]]) -> NDArray[Any]:
    return np.array([[complex(z.re, z.im) if isinstance(z, Complex) else float(z) for z in row] for row in X])


def _on_group(group: MatrixGroup, X: NDArray[Any]) -> bool:
    """Whether X is on the group: some element near it has a logarithm in the algebra."""
    derivation, ops = GroupDerivation(group), FloatArithmetic()
    for seed in range(3):
        small = 0.1 * np.random.default_rng(seed).normal(size=group.dim)
        nudge = _numbers(exp_matrix(ops, derivation, small.tolist()))
        if _logarithm(group, X @ nudge) is not None:
            return True
    return False


def _quintic(
    derivation: GroupDerivation, move: NDArray[Any], first: NDArray[Any], last: NDArray[Any], span: float
) -> NDArray[Any]:
    """(6, n): p(0) = 0, p(1) = move, body velocities first and last [1/s] and no body acceleration at either end."""
    ops = FloatArithmetic()
    inverse = np.array(jacobian(ops, derivation, [float(x) for x in move], "right", inverse=True), dtype=float)
    rate = inverse @ last * span
    dual = DualArithmetic(ops)
    moving = [dual.variable(float(a), {0: float(b)}) for a, b in zip(move, rate, strict=True)]
    turning = matvec(jacobian(dual, derivation, moving, "right", inverse=False), [float(r) for r in rate])
    bend = -inverse @ np.array([float(tangent_of(x)) if isinstance(x, Dual) else 0.0 for x in turning])
    start = first * span
    conditions = np.array([[1, 1, 1], [3, 4, 5], [6, 12, 20]], dtype=float)
    rest = np.linalg.solve(conditions, np.array([move - start, rate - start, bend]))
    return np.vstack([np.zeros_like(move), start, np.zeros_like(move), rest])


def reference(
    group: MatrixGroup,
    formulas: Sequence[Any] | None = None,
    *,
    times: ArrayLike | None = None,
    waypoints: ArrayLike | None = None,
    start: Any = None,
) -> Reference:
    """A reference from formulas of t, or from waypoints; its velocity and acceleration are derived.

    Args:
        group: the group.
        formulas: (n,) texts or expressions of t: X_d = start exp(g_1(t) A_1) ... exp(g_n(t) A_n).
        times, waypoints: (k,) and (k, d, d), instead of formulas.
        start: (d, d) for formulas.

    Raises:
        InputError: both or neither given; else as `formula_reference` and `waypoint_reference`.
    """
    if (formulas is None) == (times is None or waypoints is None):
        raise InputError(f"a reference on {group.name} is given by formulas, or by times and waypoints")
    if formulas is not None:
        return formula_reference(group, formulas, start=start)
    return waypoint_reference(group, np.asarray(times), np.asarray(waypoints))
