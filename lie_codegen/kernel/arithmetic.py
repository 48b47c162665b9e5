"""The abstract arithmetic over which every kernel body is written once.

A body receives an `Arithmetic` and scalars that understand + - * /. Run with Python floats it gives
numbers, with SymPy symbols the exact form, with CasADi SX the expression graph that becomes C, with
mpmath an oracle of any precision. Plain Python zeros and ones stay plain, so that sparsity survives.
"""

from __future__ import annotations

import math
from typing import Any, Protocol

#: float, sympy.Expr, casadi.SX, mpmath.mpf ...: anything with + - * / and unary minus.
Scalar = Any


class Arithmetic(Protocol):
    """What a kernel body may do beside + - * /."""

    def constant(self, value: Any) -> Scalar:
        """An exact number (int, Fraction, SymPy number) as a scalar of this arithmetic."""

    def sin(self, x: Scalar) -> Scalar: ...

    def cos(self, x: Scalar) -> Scalar: ...

    def tan(self, x: Scalar) -> Scalar: ...

    def exp(self, x: Scalar) -> Scalar: ...

    def expm1(self, x: Scalar) -> Scalar: ...

    def log(self, x: Scalar) -> Scalar: ...

    def sqrt(self, x: Scalar) -> Scalar: ...

    def sinh(self, x: Scalar) -> Scalar: ...

    def cosh(self, x: Scalar) -> Scalar: ...

    def tanh(self, x: Scalar) -> Scalar: ...

    def acos(self, x: Scalar) -> Scalar: ...

    def asin(self, x: Scalar) -> Scalar: ...

    def atan(self, x: Scalar) -> Scalar: ...

    def atan2(self, y: Scalar, x: Scalar) -> Scalar: ...

    def fabs(self, x: Scalar) -> Scalar: ...

    def less(self, a: Scalar, b: Scalar) -> Any:
        """The condition a < b, for `where`."""

    def where(self, condition: Any, then: Scalar, otherwise: Scalar) -> Scalar:
        """`then` where the condition holds, else `otherwise`.

        Both branches are evaluated: neither may be infinite or NaN, nor its derivatives, where the
        other is meant; guard the argument of the branch with a `where` of its own.
        """


#: Unit roundoff of the numbers a kernel is printed for.
ROUNDOFF = {"double": 2.0**-53, "float": 2.0**-24}


def unit_roundoff(ops: Arithmetic) -> float:
    """Half the distance from 1 to the next number: double's, unless the arithmetic says that it writes for another."""
    return float(getattr(ops, "unit_roundoff", ROUNDOFF["double"]))


def terms(ops: Arithmetic, double: int, single: int) -> int:
    """How many terms of a series are summed: in doubles, or where the numbers are floats, of which further terms are no part."""
    return double if unit_roundoff(ops) == ROUNDOFF["double"] else single


class FloatArithmetic:
    """Python floats: the plain meaning of a kernel, without any library."""

    routines = True

    def constant(self, value: Any) -> float:
        return float(value)

    sin = staticmethod(math.sin)
    cos = staticmethod(math.cos)
    tan = staticmethod(math.tan)
    exp = staticmethod(math.exp)
    expm1 = staticmethod(math.expm1)
    log = staticmethod(math.log)
    sqrt = staticmethod(math.sqrt)
    sinh = staticmethod(math.sinh)
    cosh = staticmethod(math.cosh)
    tanh = staticmethod(math.tanh)
    acos = staticmethod(math.acos)
    asin = staticmethod(math.asin)
    atan = staticmethod(math.atan)
    atan2 = staticmethod(math.atan2)
    fabs = staticmethod(math.fabs)

    def less(self, a: float, b: float) -> bool:
        return a < b

    def where(self, condition: bool, then: float, otherwise: float) -> float:
        return then if condition else otherwise

    def call(self, routine: Any, values: list[Any], when: Any = None) -> list[float]:
        """The outputs of a `Routine`; zeros where `when` is given and does not hold."""
        if when is not None and not when:
            return [0.0] * int(routine.outputs)
        return [float(value) for value in routine.evaluate([float(value) for value in values])]
