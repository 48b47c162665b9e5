"""(A2) exactly: d_2 phi + P^T d_1 phi = 0 at rational points of the group, by dual numbers over fractions.

A polynomial identity that holds at random rational points with large denominators holds everywhere; one that fails
is refused with its residual. Groups without rational points of that kind, and formulas with functions other than + -
* /, are checked in 50 digits instead. Bullo and Murray, CIT-CDS 97-003, (A2).
"""

from __future__ import annotations

import random
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from lie_codegen.control.error_derivatives import ErrorDerivatives
from lie_codegen.control.error_function import ErrorFunction
from lie_codegen.control.error_inputs import at_numbers
from lie_codegen.errors import ExpressionError, IncompatibleError, InputError
from lie_codegen.exact.exponential import MatrixExponential
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.matrices import GroupMatrices, random_element
from lie_codegen.groups.matrix_pattern import RealMatrices
from lie_codegen.groups.wei_norman.data import WeiNormanData
from lie_codegen.groups.wei_norman.exponential_entries import ExponentialEntries
from lie_codegen.kernel.arithmetic import Arithmetic, FloatArithmetic
from lie_codegen.kernel.dual import (
    DualArithmetic,
    PlainArithmetic,
    decimal_arithmetic,
    fraction_arithmetic,
    tangent_of,
)
from lie_codegen.kernel.linear import Matrix, identity, matmul, matvec, plus, transpose
from lie_codegen.kernel.plain_data import NoDefinitionError
from lie_codegen.kernel.records import record_definition
from lie_codegen.kernel.saved import Saved
from lie_codegen.runtime.records import recalled

_POINTS = 3
_DIGITS = 50
_TOLERANCE = Fraction(1, 10**35)


@dataclass(frozen=True, eq=False, repr=False)
class Compatibility(Saved):
    """What was found.

    Attributes:
        compatible: whether (A2) holds.
        exact: whether it was decided in rational numbers (else in 50 digits, or in doubles where a logarithm is a loop).
        residual: the largest component of d_2 phi + P^T d_1 phi over the points; 0.0 exactly when compatible and exact.
        positive: whether phi vanishes on the diagonal with a positive definite Hessian there.
        hessian: (n, n) Hessian of phi(exp(x), 1) at x = 0: the stiffness that the linearised loop sees.
    """

    compatible: bool
    exact: bool
    residual: float
    positive: bool
    hessian: tuple[tuple[float, ...], ...]


def compatibility(error: ErrorFunction, seed: int = 0) -> Compatibility:
    """Checks (A2), and that phi is locally positive definite; what was found once for a pair is recalled from its record."""
    try:
        source = record_definition(error).text
    except NoDefinitionError:  # a formula of functions that no text says: no record can name it
        return _examined(error, seed)
    return recalled("compatibility", [source, seed], Compatibility, lambda: _examined(error, seed))


def _examined(error: ErrorFunction, seed: int) -> Compatibility:
    error, real = at_numbers(error), derivation_of(error.group).real
    rng = random.Random(seed)
    data = derivation_of(error.group).wei_norman
    if error.uses_log:
        return _in_floats(error, real, data, rng)
    try:
        ops: PlainArithmetic = fraction_arithmetic()
        residual = _residual(ops, error, real, [(_rational(data, rng), _rational(data, rng)) for _ in range(_POINTS)])
        exact, compatible = True, residual == 0
    except (ArithmeticError, AttributeError, TypeError):
        ops = decimal_arithmetic(_DIGITS)
        points = [(_element(ops, data, rng), _element(ops, data, rng)) for _ in range(_POINTS)]
        residual = _residual(ops, error, real, points)
        exact, compatible = False, bool(residual < ops.constant(_TOLERANCE))
    hessian = _hessian(ops, error, real)
    X = _rational(data, rng) if exact else _element(ops, data, rng)
    return Compatibility(compatible, exact, float(residual), _positive(ops, error, real, X, hessian), hessian)


def _in_floats(error: ErrorFunction, real: RealMatrices, data: WeiNormanData, rng: random.Random) -> Compatibility:
    """With a logarithm, which may be a loop: in doubles, at places well within its cut."""
    ops = FloatArithmetic()
    places = [random_element(error.group, data, rng, 0.6) for _ in range(2 * _POINTS)]
    read = GroupMatrices(ops, real).read
    points = [(read(X), read(Y)) for X, Y in zip(places[::2], places[1::2], strict=True)]
    residual, hessian = float(_residual(ops, error, real, points)), _hessian(ops, error, real)
    size = max(1e-300, float(np.max(np.abs(np.array(hessian)))))
    positive = _positive(ops, error, real, points[0][0], hessian, 1e-10 * size)
    return Compatibility(residual < 1e-9 * size, False, residual, positive, hessian)


def check_compatibility(error: ErrorFunction, seed: int = 0) -> Compatibility:
    """`compatibility` of an error function, or an error that says what fails: d_2 phi + P^T d_1 phi = 0, (A2), and phi positive definite.

    Args:
        error: of `error_function` or the catalogue.
        seed: of the random points at which (A2) is tried.

    Raises:
        IncompatibleError: (A2) fails; carries the residual.
        InputError: phi is not positive definite near the diagonal.
        ExpressionError: phi cannot be evaluated.
    """
    try:
        found = compatibility(error, seed)
    except ExpressionError as problem:
        raise type(problem)(f"error function {error.name} on {error.group.name}: {problem}") from None
    if not found.compatible:
        how = "in rational numbers" if found.exact else "in doubles" if error.uses_log else f"in {_DIGITS} digits"
        raise IncompatibleError(
            f"error function {error.name} on {error.group.name} and its transport map are not compatible (A2): "
            f"d_2 phi + P^T d_1 phi = {found.residual:.3g} at a random point, computed {how}, not 0; any phi of "
            "X_d^-1 X goes with transport 'right', any phi of X X_d^-1 with 'left'"
        )
    if not found.positive:
        raise InputError(
            f"error function {error.name} on {error.group.name}: phi(X, X) is not 0 or the Hessian there is not "
            f"positive definite: {[[round(v, 6) for v in row] for row in found.hessian]}; an error function is 0 "
            "exactly at X = X_d"
        )
    return found


def _residual(ops: Arithmetic, error: ErrorFunction, real: RealMatrices, points: list[tuple[Matrix, Matrix]]) -> Any:
    worst: Any = 0
    for X, X_d in points:
        at = ErrorDerivatives(ops, error, real, X, X_d)
        _, first = at.differential(1)
        _, second = at.differential(2)
        for entry in plus(second, matvec(transpose(at.transport_matrix()), first)):
            worst = max(worst, abs(entry))
    return worst


def _hessian(ops: Arithmetic, error: ErrorFunction, real: RealMatrices) -> tuple[tuple[float, ...], ...]:
    """Second derivatives along exp(x) at X = X_d = 1, where the connection does not matter: phi is critical."""
    n = real.group.dim
    one = [[ops.constant(i == j) for j in range(real.size)] for i in range(real.size)]
    rows = []
    for a in range(n):
        outer = DualArithmetic(ops)
        direction = [int(a == b) for b in range(n)]
        B = ErrorDerivatives(ops, error, real, one, one).group.hat(direction)
        moved = [[outer.variable(one[i][j], {0: B[i][j]}) for j in range(real.size)] for i in range(real.size)]
        _, gradient = ErrorDerivatives(outer, error, real, moved, one).differential(1)
        rows.append(tuple(float(tangent_of(entry, 0, outer.level)) for entry in gradient))
    return tuple(rows)


def _positive(
    ops: Arithmetic,
    error: ErrorFunction,
    real: RealMatrices,
    X: Matrix,
    hessian: tuple[tuple[float, ...], ...],
    tolerance: Any = _TOLERANCE,
) -> bool:
    phi, gradient = ErrorDerivatives(ops, error, real, X, X).differential(1)
    zero = all(abs(value) <= ops.constant(tolerance) for value in (phi, *gradient))
    # symmetric but for rounding: the two orders of A_a and A_b differ by d phi . [A_a, A_b], and d phi = 0 here
    values = np.linalg.eigvalsh((np.array(hessian) + np.array(hessian).T) / 2)
    return bool(zero and values[0] > 1e-12 * max(1e-300, abs(values[-1])))


def _element(ops: PlainArithmetic, data: WeiNormanData, rng: random.Random) -> Matrix:
    """A product of exponentials in the given arithmetic."""
    size = derivation_of(data.group).real.size
    value: Matrix = identity(size)
    for exponential in data.defining:
        x = ops.constant(Fraction(rng.randint(-100, 100), 97))
        entries = ExponentialEntries(ops, x, exponential, printed=True).sparse()
        value = matmul(value, [[entries.get((i, j), 0) for j in range(size)] for i in range(size)])
    return value


def _rational(data: WeiNormanData, rng: random.Random) -> Matrix:
    """A product of one-parameter elements with rational entries.

    Raises:
        ArithmeticError: a basis element has none of the known kinds.
    """
    size = derivation_of(data.group).real.size
    value: Matrix = identity(size)
    for exponential in data.defining:
        value = matmul(value, _rational_factor(exponential, rng, size))
    return value


def _rational_factor(exponential: MatrixExponential, rng: random.Random, size: int) -> Matrix:
    """exp(x A) at an x where its modes are rational: nilpotent, a rotation, or a dilation."""
    modes = exponential.modes
    rates = [mode.rate for mode in modes if mode.rate != 0]
    frequencies = [mode.frequency for mode in modes if mode.frequency != 0]
    powers = any(mode.power for mode in modes)
    if (rates and frequencies) or (powers and (rates or frequencies)):
        raise ArithmeticError("this one-parameter subgroup has no rational points of a known kind")
    small = Fraction(rng.randint(-60, 60), 61)
    base = min((abs(r) for r in rates or frequencies), default=None)
    # Rational points of the circle, and powers of a rational growth: the modes are rational though x is not, and the identity is checked without rounding.
    cosine, sine = (1 - small**2) / (1 + small**2), 2 * small / (1 + small**2)
    growth = Fraction(rng.randint(30, 90), 61)
    values: list[Fraction] = []
    for mode in modes:
        multiple = _integer((mode.rate if rates else mode.frequency) / base) if base is not None else 0
        if frequencies:
            turned = _turned(cosine, sine, multiple)
            values.append(turned[1] if mode.odd else turned[0])
        else:
            values.append(growth**multiple if rates else small**mode.power)
    number = fraction_arithmetic().constant
    result: Matrix = [[Fraction(0)] * size for _ in range(size)]
    for (i, j), terms in exponential.entries.items():
        result[i][j] = sum((number(c) * values[m] for m, c in terms.items()), Fraction(0))
    return result


def _integer(ratio: Any) -> int:
    if not ratio.is_Integer:
        raise ArithmeticError(f"{ratio} is not an integer ratio")
    return int(ratio)


def _turned(cosine: Fraction, sine: Fraction, times: int) -> tuple[Fraction, Fraction]:
    c, s = Fraction(1), Fraction(0)
    for _ in range(times):
        c, s = c * cosine - s * sine, s * cosine + c * sine
    return c, s
