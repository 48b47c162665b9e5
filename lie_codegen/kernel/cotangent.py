"""h cot h with h = sqrt(z) / 2, the even part of lambda / (e^lambda - 1) at lambda^2 = mu = -z.

    E(mu) = h cot h = 1 + mu T(mu),   T(mu) = 2 sum_k 1 / (4 pi^2 k^2 + mu) = 1/12 - mu/720 + ...

The pole at z = 4 pi^2 is kept as it stands and the rest is summed as a series, so that nothing cancels anywhere in the
principal domain of the logarithm, and every derivative is as good as the value. h coth h for z < 0.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from math import comb

from lie_codegen.kernel.arithmetic import Arithmetic, Scalar, terms
from lie_codegen.kernel.structural_zeros import is_zero

#: |z| below which pole and series are used: beyond pi^2, the principal domain of a rotation's logarithm.
SWITCH = 12
#: The series has the ratio z / (16 pi^2) < 0.076: the first term left out is below 1e-20.
TERMS = 17
#: In floats: below 1e-9.
FLOAT_TERMS = 8


class CotangentFunctions:
    """Tails of E and their derivatives in mu at one z; signed for a z that may be negative."""

    def __init__(self, ops: Arithmetic, z: Scalar, *, signed: bool) -> None:
        self.ops = ops
        self.z = z
        self._done: dict[tuple[int, int], Scalar] = {}
        if is_zero(z):
            return
        size = ops.fabs(z) if signed else z
        self.near = ops.less(size, SWITCH)
        self.inner = ops.where(self.near, z, 1)
        self.outer = ops.where(self.near, SWITCH, z)
        self._inverse = 1 / (ops.constant(four_pi_squared()) - self.inner)  # one division for all remainders
        self.signed = signed
        self._outer: dict[tuple[int, int], Scalar] = {}

    def remainder(self, a: int, order: int) -> Scalar:
        """(1/order!) d^order/d mu^order of E[0, .., 0 (a times), mu], the a-th remainder of E; order up to 2."""
        if is_zero(self.z):
            return self.ops.constant(taylor(a + order))
        if (a, order) not in self._done:
            near = self._near_tail(a, order)
            self._done[a, order] = self.ops.where(self.near, near, self._outer_tail(a, order))
        return self._done[a, order]

    def _near_tail(self, a: int, order: int) -> Scalar:
        ops, mu = self.ops, -self.inner
        if a == 0:
            if order == 0:
                return 1 + mu * self._near_tail(1, 0)
            return self._near_tail(1, order - 1) + mu * self._near_tail(1, order)
        # 2 / (pole + mu), shifted down a - 1 places and differentiated: the geometric series is its own remainder.
        scale = Fraction(2) * (-1) ** (a - 1 + order) / four_pi_squared() ** (a - 1)
        fraction = ops.constant(scale) * _power(self._inverse, order + 1)
        count = terms(ops, TERMS, FLOAT_TERMS)
        coefficients = [remainder(j) * comb(j - a + 1, order) for j in range(a - 1 + order, a - 1 + order + count)]
        series: Scalar = ops.constant(coefficients[-1])
        for value in reversed(coefficients[:-1]):
            series = series * mu + ops.constant(value)
        return fraction + series

    def _outer_tail(self, a: int, order: int) -> Scalar:
        """E by the cotangent, its derivatives by 2 z dE/dmu = E^2 - E + z/4, remainders T_a = (T_{a-1} - T_{a-1}(0)) / mu."""
        if (a, order) not in self._outer:
            self._outer[a, order] = self._compute_outer(a, order)
        return self._outer[a, order]

    def _compute_outer(self, a: int, order: int) -> Scalar:
        z = self.outer
        if a and order:
            return (self._outer_tail(a, order - 1) - self._outer_tail(a - 1, order)) / z
        if a:
            return (self.ops.constant(taylor(a - 1)) - self._outer_tail(a - 1, 0)) / z
        if order == 0:
            return self._outer_value()
        E = self._outer_tail(0, 0)
        if order == 1:
            return (E * E - E + z / 4) / (2 * z)
        slope = self._outer_tail(0, 1)
        return (((2 * E - 1) * slope - self.ops.constant(Fraction(1, 4))) / 2 + slope) / (2 * z)

    def _outer_value(self) -> Scalar:
        ops = self.ops
        if not self.signed:
            half = ops.sqrt(self.outer) / 2
            return half * ops.cos(half) / ops.sin(half)
        negative = ops.less(self.outer, 0)
        half = ops.sqrt(ops.where(negative, SWITCH, self.outer)) / 2
        other = ops.sqrt(ops.where(negative, -self.outer, SWITCH)) / 2
        return ops.where(negative, other / ops.tanh(other), half * ops.cos(half) / ops.sin(half))


def _power(x: Scalar, exponent: int) -> Scalar:
    result = x
    for _ in range(exponent - 1):
        result = result * x
    return result


@cache
def four_pi_squared() -> Fraction:
    """4 pi^2 to 60 digits."""
    import sympy as sp

    return Fraction(str(sp.N(4 * sp.pi**2, 60)))


@cache
def taylor(j: int) -> Fraction:
    """B_{2 j} / (2 j)!, the coefficient of mu^j in E, exactly."""
    import sympy as sp

    value = sp.bernoulli(2 * j) / sp.factorial(2 * j)
    return Fraction(int(value.p), int(value.q))


@cache
def remainder(j: int) -> Fraction:
    """The coefficient of mu^j in T(mu) - 2 / (4 pi^2 + mu), to 40 digits or more."""
    pole: Fraction = Fraction(2) * (-1) ** j / four_pi_squared() ** (j + 1)
    return taylor(j + 1) - pole
