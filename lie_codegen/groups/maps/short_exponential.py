"""X exp(A) by a Taylor polynomial, shortened where A = hat(x) satisfies A^k (A^2 + q(x)) = 0 or A^k = 0.

With the annihilating polynomial, exp(A) = sum_{j<k} A^j / j! + c_k(q) A^k + c_{k+1}(q) A^{k+1}, where
c_j(z) = sum_m (-z)^m / (j + 2 m)! (Stumpff), so that k + 1 products of matrices do what the degree of the polynomial would: 2
on so3, 3 on se3 and SE_2(3), 1 on su2 and sl2. Cut at the same total degree, it is the same polynomial of A. No angle, no root, no
division: for steps, where x is small.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from math import factorial
from typing import Any

from lie_codegen.exact.quadratic_form import QuadraticForm
from lie_codegen.exact.spectral_pattern import spectral_pattern
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.matrix_pattern import RealMatrices
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.structural_zeros import is_zero


@dataclass(frozen=True)
class ShortPattern:
    """A^zeros (A^2 + form) = 0, or A^zeros = 0 where there is no form."""

    zeros: int
    form: QuadraticForm | None


@lru_cache(maxsize=64)
def short_pattern(group: MatrixGroup) -> ShortPattern | None:
    """The annihilating polynomial of hat(x), one for all columns; None where there is none of this kind."""
    columns = spectral_pattern(RealMatrices(group).basis)
    if columns is None or any(column.pairs > 1 for column in columns):
        return None
    forms = {column.form for column in columns if column.form is not None}
    if len(forms) > 1:
        return None
    return ShortPattern(max(column.zeros for column in columns), next(iter(forms), None))


def times_short_exp(
    ops: Arithmetic,
    pattern: ShortPattern,
    X: Sequence[Sequence[Any]],
    A: Sequence[Sequence[Any]],
    x: Sequence[Scalar],
    degree: int,
) -> list[list[Any]]:
    """X (I + A + ... + A^degree / degree!), as X plus a small correction, so that rounding does not gather in X."""
    k = pattern.zeros
    if pattern.form is None:
        top = min(k - 1, degree)
        value = X
        for order in range(top, 0, -1):
            value = _sum(X, 1, _product(value, A), ops.constant(Fraction(1, order)))
        return [list(row) for row in value]
    z = _form(ops, pattern.form, x)
    if k == 0:
        return _sum(X, 1, _sum(_product(X, A), _tail(ops, 1, z, degree), X, -z * _tail(ops, 2, z, degree)), 1)
    value = _sum(X, _tail(ops, k, z, degree), _product(X, A), _tail(ops, k + 1, z, degree))
    for order in range(k - 1, -1, -1):
        weight = 1 if order < 2 else ops.constant(Fraction(1, factorial(order)))
        value = _sum(X, weight, _product(value, A), 1)
    return value


def _tail(ops: Arithmetic, j: int, z: Scalar, degree: int) -> Scalar:
    """sum_m (-z)^m / (j + 2 m)!, up to the term of A^degree, by Horner's rule."""
    terms = max(0, (degree - j) // 2)
    value = ops.constant(Fraction(1, factorial(j + 2 * terms)))
    for m in range(terms - 1, -1, -1):
        value = ops.constant(Fraction(1, factorial(j + 2 * m))) - z * value
    return value


def _form(ops: Arithmetic, form: QuadraticForm, x: Sequence[Scalar]) -> Scalar:
    total: Scalar = None
    for (i, j), value in form.coefficients:
        term = x[i] * x[j] if value == 1 else ops.constant(value) * (x[i] * x[j])
        total = term if total is None else total + term
    return total


def _product(a: Sequence[Sequence[Any]], b: Sequence[Sequence[Any]]) -> list[list[Any]]:
    size = len(b)
    return [[_dot((row[m], b[m][j]) for m in range(size)) for j in range(size)] for row in a]


def _dot(pairs: Any) -> Any:
    total: Any = 0
    for a, b in pairs:
        if not is_zero(a) and not is_zero(b):
            total = a * b if is_zero(total) else total + a * b
    return total


def _sum(a: Sequence[Sequence[Any]], weight: Any, b: Sequence[Sequence[Any]], other: Any) -> list[list[Any]]:
    """weight a + other b; plain zeros and ones stay plain."""
    return [[_entry(u, weight, v, other) for u, v in zip(p, q, strict=True)] for p, q in zip(a, b, strict=True)]


def _entry(u: Any, weight: Any, v: Any, other: Any) -> Any:
    first = u if is_zero(u) or _one(weight) else u * weight
    second = v if is_zero(v) or _one(other) else v * other
    return second if is_zero(first) else first if is_zero(second) else first + second


def _one(weight: Any) -> bool:
    return isinstance(weight, int) and weight == 1
