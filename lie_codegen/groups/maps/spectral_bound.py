"""Whether all eigenvalues are within a radius, from the power sums or the coefficients of their polynomial."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.linear import total
from lie_codegen.kernel.structural_zeros import add, is_zero, product


def definite_within(ops: Arithmetic, power_sum: Scalar, k: int, radius: int) -> Any:
    """Whether |sum_i mu_i^k| <= radius^k, for mu_i that are real with k even, or of one sign: then no mu_i is larger.

    Of r numbers of one size the sum is r times as large as it need be, and its k-th root, with k = r, little more than one.
    """
    return ops.less(ops.fabs(power_sum) if k % 2 else power_sum, ops.constant(radius**k))


def roots_within(ops: Arithmetic, coefficients: Sequence[Scalar], radius: int, squarings: int) -> Any:
    """Whether all roots of t^r + c_{r-1} t^{r-1} + .. + c_0 are below the radius, by sum_k |c_k| radius^(k - r) < 1.

    Then t^r is the largest term where |t| >= radius, and no root is there (Cauchy). The roots' squares, `squarings` times (Graeffe), are told
    apart better.
    """
    c, r = list(coefficients), len(coefficients)
    for _ in range(squarings):
        c = _squared(c)
    share = Fraction(1, radius ** (2**squarings))
    terms = [
        product(ops.constant(share ** (r - k)), _modulus(ops, value)) for k, value in enumerate(c) if not is_zero(value)
    ]
    return ops.less(total(terms), 1) if terms else True


def guarded(ops: Arithmetic, near: Any, coefficients: Sequence[Scalar]) -> list[Scalar]:
    """The coefficients; where `near` does not hold and the side of a choice that is not taken matters, ones: its roots are not large."""
    if near is True or not getattr(ops, "differentiated", False):
        return list(coefficients)
    return [_chosen(ops, near, c, 1) for c in coefficients]


def _chosen(ops: Arithmetic, near: Any, value: Scalar, other: Scalar) -> Scalar:
    if is_zero(value):
        return value
    if isinstance(value, Complex):
        z = Complex.of(other)
        return Complex(_chosen(ops, near, value.re, z.re), _chosen(ops, near, value.im, z.im))
    return ops.where(near, value, other)


def _squared(coefficients: Sequence[Scalar]) -> list[Scalar]:
    """Of the monic polynomial with the squared roots: (-1)^r p(t) p(-t) in t^2 (Graeffe)."""
    a, r = [*coefficients, 1], len(coefficients)
    result = []
    for k in range(r):
        value = product((-1) ** (r - k), product(a[k], a[k]))
        for i in range(1, min(k, r - k) + 1):
            value = add(value, product(2 * (-1) ** (r - k + i), product(a[k - i], a[k + i])))
        result.append(value)
    return result


def _modulus(ops: Arithmetic, value: Scalar) -> Scalar:
    if isinstance(value, Complex):
        return total(part for part in (_modulus(ops, value.re), _modulus(ops, value.im)))
    return value if is_zero(value) else ops.fabs(value)
