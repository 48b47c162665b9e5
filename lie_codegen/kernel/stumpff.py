"""Stumpff functions c_k(z) = sum_j (-z)^j / (2 j + k)!, the building blocks of exp and of its Jacobian.

    c_0 = cos sqrt z,  c_1 = sin sqrt z / sqrt z,  c_2 = (1 - cos sqrt z) / z,  c_3 = (sqrt z - sin sqrt z) / z^(3/2),
    c_k = 1/k! - z c_{k+2},     d c_k / d mu = (c_{k+1} - k c_{k+2}) / 2 with mu = -z.

They are entire; cosh and sinh take over for z < 0. The recurrences follow from the series term by term.
"""

from __future__ import annotations

from fractions import Fraction
from math import factorial

from lie_codegen.kernel.arithmetic import Arithmetic, Scalar, terms
from lie_codegen.kernel.structural_zeros import is_zero

#: |z| below which the two highest functions are summed as series; above it sine and cosine go up the recurrence.
SWITCH = 1
#: With the switch at 1 the first term left out is below 1e-19 relative, and below 1e-16 in second derivatives.
TERMS = 10
#: In floats: 2e-12, and 5e-10 in second derivatives.
FLOAT_TERMS = 7
#: Kernels that climb beyond c_3 switch later: each step of the recurrence from c_0 up divides rounding errors by z.
HIGH_SWITCH = 6
HIGH_TERMS = 18
HIGH_FLOAT_TERMS = 10


class StumpffFunctions:
    """c_0 .. c_top at one z, computed together; signed for a z that may be negative."""

    def __init__(self, ops: Arithmetic, z: Scalar, top: int, *, signed: bool) -> None:
        self.ops = ops
        self.z = z
        self.top = max(top, 1)
        self.high = self.top > 3
        if is_zero(z):
            self._values: list[Scalar] = [ops.constant(Fraction(1, factorial(k))) for k in range(self.top + 1)]
            return
        self.near = self._near(signed)
        self._series_values = self._downward()
        self._closed_values = self._closed(signed)
        self._chosen: dict[int, Scalar] = {}

    def c(self, k: int) -> Scalar:
        """c_k(z)."""
        if is_zero(self.z):
            return self._values[k]
        if k not in self._chosen:
            self._chosen[k] = self.ops.where(self.near, self._series_values[k], self._closed_values[k])
        return self._chosen[k]

    def derivative(self, k: int, order: int) -> Scalar:
        """(1/order!) d^order c_k / d mu^order with mu = -z."""
        total: Scalar = 0
        for index, weight in derivative_weights(k, order).items():
            term = self.c(index) if weight == 1 else self.ops.constant(weight) * self.c(index)
            total = term if is_zero(total) else total + term
        return total

    @property
    def _switch(self) -> int:
        return HIGH_SWITCH if self.high else SWITCH

    def _near(self, signed: bool) -> Scalar:
        size = self.ops.fabs(self.z) if signed else self.z
        return self.ops.less(size, self._switch)

    def _downward(self) -> list[Scalar]:
        """All by series, the two highest directly and the rest down the recurrence, which loses nothing."""
        values: list[Scalar] = [0] * (self.top + 1)
        for k in range(self.top, -1, -1):
            if k >= self.top - 1:
                values[k] = self._series(k)
            else:
                values[k] = self.ops.constant(Fraction(1, factorial(k))) - self.z * values[k + 2]
        return values

    def _series(self, k: int) -> Scalar:
        count = terms(self.ops, *((HIGH_TERMS, HIGH_FLOAT_TERMS) if self.high else (TERMS, FLOAT_TERMS)))
        coefficients = [Fraction((-1) ** j, factorial(2 * j + k)) for j in range(count)]
        total: Scalar = self.ops.constant(coefficients[-1])
        for value in reversed(coefficients[:-1]):
            total = total * self.z + self.ops.constant(value)
        return total

    def _closed(self, signed: bool) -> list[Scalar]:
        """All by sine and cosine (or their hyperbolic kin), from c_0 and c_1 up."""
        ops, switch = self.ops, self._switch
        if not signed:
            z = ops.where(self.near, switch, self.z)
            root = ops.sqrt(z)
            first = [ops.cos(root), ops.sin(root) / root]
        else:
            z = ops.where(self.near, switch, self.z)
            negative = ops.less(z, 0)
            root = ops.sqrt(ops.where(negative, switch, z))
            hyperbolic_root = ops.sqrt(ops.where(negative, -z, switch))
            first = [
                ops.where(negative, ops.cosh(hyperbolic_root), ops.cos(root)),
                ops.where(negative, ops.sinh(hyperbolic_root) / hyperbolic_root, ops.sin(root) / root),
            ]
        values = first
        for k in range(2, self.top + 1):
            values.append((ops.constant(Fraction(1, factorial(k - 2))) - values[k - 2]) / z)
        return values


def derivative_weights(k: int, order: int) -> dict[int, Fraction]:
    """(1/order!) d^order c_k / d mu^order = sum of weight * c_index."""
    weights = {k: Fraction(1)}
    for step in range(1, order + 1):
        new: dict[int, Fraction] = {}
        for index, weight in weights.items():
            for target, factor in ((index + 1, Fraction(1, 2)), (index + 2, Fraction(-index, 2))):
                if factor:
                    new[target] = new.get(target, Fraction(0)) + weight * factor / step
        weights = new
    return weights
