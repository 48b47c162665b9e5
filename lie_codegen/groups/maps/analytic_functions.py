"""The functions that are known in closed form at a matrix: exp, (e^t - 1)/t and t/(e^t - 1), each by the remainders of its Taylor series.

`matrix_function` interpolates by them; a remainder is the series after its first terms, divided by the next power, and is entire in mu = lambda^2.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import factorial
from typing import Protocol

from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.cotangent import CotangentFunctions, taylor
from lie_codegen.kernel.stumpff import StumpffFunctions, derivative_weights

#: (odd, a, order): the remainder after a Taylor terms of the even or odd part, differentiated.
Remainder = tuple[bool, int, int]


class Values(Protocol):
    """The remainders of one function at one z."""

    def remainder(self, remainder: Remainder) -> Scalar: ...


class MatrixFunction(Protocol):
    """An analytic function of a matrix, by the series of its even and odd parts in mu = lambda^2."""

    def taylor(self, odd: bool, i: int) -> Fraction:
        """The coefficient of mu^i."""

    def at(self, ops: Arithmetic, z: Scalar, remainders: Sequence[Remainder], *, signed: bool) -> Values:
        """The remainders wanted at mu = -z."""


@dataclass(frozen=True)
class ExponentialFunction:
    """sum_j lambda^j / (j + shift)! with the sign of its odd part: exp (shift 0), (e^t - 1)/t (shift 1), both at +-t."""

    shift: int
    sign: int = 1

    def taylor(self, odd: bool, i: int) -> Fraction:
        return Fraction(self.sign if odd else 1, factorial(2 * i + odd + self.shift))

    def at(self, ops: Arithmetic, z: Scalar, remainders: Sequence[Remainder], *, signed: bool) -> Values:
        return _StumpffValues(self, ops, z, remainders, signed)

    def index(self, remainder: Remainder) -> int:
        """The k of the c_k that the remainder is."""
        return 2 * remainder[1] + remainder[0] + self.shift


class _StumpffValues:
    def __init__(
        self, function: ExponentialFunction, ops: Arithmetic, z: Scalar, remainders: Sequence[Remainder], signed: bool
    ) -> None:
        self.function = function
        top = max((max(derivative_weights(function.index(t), t[2])) for t in remainders), default=0)
        self.c = StumpffFunctions(ops, z, top, signed=signed)

    def remainder(self, remainder: Remainder) -> Scalar:
        value = self.c.derivative(self.function.index(remainder), remainder[2])
        return -value if remainder[0] and self.function.sign < 0 else value


@dataclass(frozen=True)
class BernoulliFunction:
    """t/(e^t - 1) = (t/2) coth(t/2) - t/2; the sign of its odd part is that of t in (e^{-t} - 1)."""

    sign: int = 1

    def taylor(self, odd: bool, i: int) -> Fraction:
        if odd:
            return Fraction(-self.sign, 2) if i == 0 else Fraction(0)
        return taylor(i)

    def at(self, ops: Arithmetic, z: Scalar, remainders: Sequence[Remainder], *, signed: bool) -> Values:
        return _CotangentValues(self, ops, z, signed)


class _CotangentValues:
    def __init__(self, function: BernoulliFunction, ops: Arithmetic, z: Scalar, signed: bool) -> None:
        self.function = function
        self.ops = ops
        self.values = CotangentFunctions(ops, z, signed=signed)

    def remainder(self, remainder: Remainder) -> Scalar:
        odd, a, order = remainder
        if odd:
            return 0 if a + order else self.ops.constant(self.function.taylor(True, 0))
        return self.values.remainder(a, order)


EXP = ExponentialFunction(0)
RIGHT_JACOBIAN_INVERSE = BernoulliFunction(-1)
#: Of exp: (side, whether it is the inverse).
JACOBIANS: Mapping[tuple[str, bool], MatrixFunction] = {
    ("left", False): ExponentialFunction(1),
    ("right", False): ExponentialFunction(1, -1),
    ("left", True): BernoulliFunction(),
    ("right", True): RIGHT_JACOBIAN_INVERSE,
}
