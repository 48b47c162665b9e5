"""Dual numbers over any arithmetic: derivatives that are as exact as the arithmetic beneath.

A `Dual` of level k is a + sum_i t_i e_i with e_i e_j = 0, where a and the t_i are scalars of a lower level. Levels keep
nested derivatives apart: a scalar of a lower level is a constant for a higher one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from lie_codegen.kernel.arithmetic import Arithmetic, Scalar, unit_roundoff
from lie_codegen.kernel.routine import Where, call_routine
from lie_codegen.kernel.structural_zeros import add, is_zero, product


@dataclass(frozen=True, slots=True, eq=False)
class Dual:
    """value + sum_i tangent[i] e_i; what is not in `tangent` is zero."""

    value: Scalar
    tangent: Mapping[int, Scalar]
    level: int = 1
    #: numpy leaves `array * dual` to the dual: the values are arrays, not the duals entries of one
    __array_ufunc__: ClassVar[None] = None

    def __add__(self, other: Any) -> Any:
        if level_of(other) > self.level:
            return other.__add__(self)
        value, tangent = split(other, self.level)
        return _merged(add(self.value, value), self.tangent, 1, tangent, 1, self.level)

    def __radd__(self, other: Any) -> Any:
        return self.__add__(other)

    def __neg__(self) -> Dual:
        return Dual(-self.value, {i: -t for i, t in self.tangent.items()}, self.level)

    def __sub__(self, other: Any) -> Any:
        return self + (-other)

    def __rsub__(self, other: Any) -> Any:
        return (-self) + other

    def __mul__(self, other: Any) -> Any:
        if level_of(other) > self.level:
            return other.__mul__(self)
        if is_zero(other):
            return 0
        value, tangent = split(other, self.level)
        return _merged(product(self.value, value), self.tangent, value, tangent, self.value, self.level)

    def __rmul__(self, other: Any) -> Any:
        return self.__mul__(other)

    def __truediv__(self, other: Any) -> Any:
        if level_of(other) > self.level:
            return other.__rtruediv__(self)
        value, tangent = split(other, self.level)
        quotient = self.value / value
        scaled = {i: t / value for i, t in self.tangent.items()}
        return _merged(quotient, scaled, 1, {i: t / value for i, t in tangent.items()}, -quotient, self.level)

    def __rtruediv__(self, other: Any) -> Any:
        quotient = other / self.value
        return Dual(quotient, {i: -(quotient * t) / self.value for i, t in self.tangent.items()}, self.level)


def level_of(x: Any) -> int:
    """0 for a plain scalar."""
    return x.level if isinstance(x, Dual) else 0


def split(x: Any, level: int = 1) -> tuple[Scalar, Mapping[int, Scalar]]:
    """Value and tangent at the given level; a scalar of a lower level has no tangent."""
    return (x.value, x.tangent) if isinstance(x, Dual) and x.level == level else (x, {})


def value_of(x: Any, level: int = 1) -> Scalar:
    """The value of a scalar at a level."""
    return split(x, level)[0]


def tangent_of(x: Any, index: int = 0, level: int = 1) -> Scalar:
    """One tangent of a scalar at a level; 0 where it has none."""
    return split(x, level)[1].get(index, 0)


def _merged(
    value: Scalar, a: Mapping[int, Scalar], by_a: Scalar, b: Mapping[int, Scalar], by_b: Scalar, level: int
) -> Dual:
    tangent = {i: product(t, by_a) for i, t in a.items()}
    for i, t in b.items():
        tangent[i] = add(tangent.get(i, 0), product(t, by_b))
    return Dual(value, {i: t for i, t in tangent.items() if not is_zero(t)}, level)


class DualArithmetic:
    """The arithmetic of `Dual` over another one; Duals of the other one nest."""

    def __init__(self, ops: Arithmetic) -> None:
        self.ops = ops
        self.level: int = getattr(ops, "level", 0) + 1
        self.unit_roundoff = unit_roundoff(ops)
        self.routines: bool | None = getattr(ops, "routines", None)
        self.differentiated: bool = getattr(ops, "differentiated", False)

    def variable(self, value: Scalar, tangent: Mapping[int, Scalar]) -> Dual:
        """value + sum tangent[i] e_i, structural zeros dropped."""
        return Dual(value, {i: t for i, t in tangent.items() if not is_zero(t)}, self.level)

    def constant(self, value: Any) -> Scalar:
        return self.ops.constant(value)

    def sin(self, x: Any) -> Scalar:
        return self._chain(x, self.ops.sin, lambda v, _: self.ops.cos(v))

    def cos(self, x: Any) -> Scalar:
        return self._chain(x, self.ops.cos, lambda v, _: -self.ops.sin(v))

    def tan(self, x: Any) -> Scalar:
        return self._chain(x, self.ops.tan, lambda _, f: 1 + f * f)

    def exp(self, x: Any) -> Scalar:
        return self._chain(x, self.ops.exp, lambda _, f: f)

    def expm1(self, x: Any) -> Scalar:
        return self._chain(x, self.ops.expm1, lambda _, f: f + 1)

    def log(self, x: Any) -> Scalar:
        return self._chain(x, self.ops.log, lambda v, _: 1 / v)

    def sqrt(self, x: Any) -> Scalar:
        return self._chain(x, self.ops.sqrt, lambda _, f: 1 / (2 * f))

    def sinh(self, x: Any) -> Scalar:
        return self._chain(x, self.ops.sinh, lambda v, _: self.ops.cosh(v))

    def cosh(self, x: Any) -> Scalar:
        return self._chain(x, self.ops.cosh, lambda v, _: self.ops.sinh(v))

    def tanh(self, x: Any) -> Scalar:
        return self._chain(x, self.ops.tanh, lambda _, f: 1 - f * f)

    def asin(self, x: Any) -> Scalar:
        return self._chain(x, self.ops.asin, lambda v, _: 1 / self.ops.sqrt(1 - v * v))

    def acos(self, x: Any) -> Scalar:
        return self._chain(x, self.ops.acos, lambda v, _: -1 / self.ops.sqrt(1 - v * v))

    def atan(self, x: Any) -> Scalar:
        return self._chain(x, self.ops.atan, lambda v, _: 1 / (1 + v * v))

    def atan2(self, y: Any, x: Any) -> Scalar:
        (a, da), (b, db) = split(y, self.level), split(x, self.level)
        value = self.ops.atan2(a, b)
        if not da and not db:
            return value
        square = a * a + b * b
        return _merged(value, da, b / square, db, -a / square, self.level)

    def fabs(self, x: Any) -> Scalar:
        return self._chain(
            x, self.ops.fabs, lambda v, _: self.ops.where(self.ops.less(v, 0), self.constant(-1), self.constant(1))
        )

    def less(self, a: Any, b: Any) -> Any:
        return self.ops.less(value_of(a, self.level), value_of(b, self.level))

    def where(self, condition: Any, then: Any, otherwise: Any) -> Scalar:
        (a, da), (b, db) = split(then, self.level), split(otherwise, self.level)
        value = self.ops.where(condition, a, b)
        if not da and not db:
            return value
        keys = {**da, **db}
        return Dual(value, {i: self.ops.where(condition, da.get(i, 0), db.get(i, 0)) for i in keys}, self.level)

    def call(self, routine: Any, values: list[Any], when: Any = None) -> list[Scalar]:
        """The routine, and its own derivative along every direction."""
        pairs = [split(value, self.level) for value in values]
        plain = [value for value, _ in pairs]
        outputs = call_routine(self.ops, routine, plain, when)
        directions = sorted({i for _, tangent in pairs for i in tangent})
        if not directions:
            return outputs
        rates: dict[int, list[Scalar]] = {}
        ops = self.ops if when is None else Where(self.ops, when)
        for i in directions:
            moved = routine.tangent(ops, plain, outputs, [tangent.get(i, 0) for _, tangent in pairs])
            rates[i] = moved if when is None else [self.ops.where(when, rate, 0) for rate in moved]
        return [
            Dual(value, {i: rates[i][k] for i in directions if not is_zero(rates[i][k])}, self.level)
            for k, value in enumerate(outputs)
        ]

    def _chain(self, x: Any, function: Callable[[Any], Any], slope: Callable[[Any, Any], Any]) -> Scalar:
        value, tangent = split(x, self.level)
        result = function(value)
        if not tangent:
            return result
        rate = slope(value, result)
        return Dual(result, {i: product(t, rate) for i, t in tangent.items()}, self.level)


class PlainArithmetic:
    """Fractions or mpmath numbers: + - * / alone; a formula that needs more is refused by the caller's choice."""

    def __init__(self, number: Callable[[Any], Any], functions: Mapping[str, Callable[..., Any]] | None = None) -> None:
        self.constant = number
        self.functions = dict(functions or {})

    def __getattr__(self, name: str) -> Callable[..., Any]:
        functions: dict[str, Callable[..., Any]] = self.__dict__.get("functions", {})
        if name in functions:
            return functions[name]
        raise AttributeError(name)

    def less(self, a: Any, b: Any) -> bool:
        return bool(a < b)

    def where(self, condition: bool, then: Any, otherwise: Any) -> Any:
        return then if condition else otherwise


def decimal_arithmetic(digits: int) -> PlainArithmetic:
    """SymPy floats of the given number of digits."""
    import sympy as sp

    def number(value: Any) -> Any:
        if isinstance(value, sp.Expr):
            return value.evalf(digits)
        numerator, denominator = value.as_integer_ratio()
        return sp.Rational(numerator, denominator).evalf(digits)

    names = ("sin", "cos", "tan", "exp", "log", "sqrt", "sinh", "cosh", "tanh", "acos", "asin", "atan", "atan2")
    functions: dict[str, Callable[..., Any]] = {name: _rounded(getattr(sp, name), number) for name in names}
    return PlainArithmetic(number, {**functions, "expm1": lambda x: functions["exp"](x) - 1, "fabs": abs})


def _rounded(function: Callable[..., Any], number: Callable[[Any], Any]) -> Callable[..., Any]:
    return lambda *arguments: number(function(*arguments))


def fraction_arithmetic() -> PlainArithmetic:
    """Python Fractions; integers and rationals alone."""
    from fractions import Fraction

    def number(value: Any) -> Fraction:
        if getattr(value, "is_Rational", False):
            return Fraction(int(value.p), int(value.q))
        if isinstance(value, int | Fraction) or (isinstance(value, float) and math.isfinite(value)):
            return Fraction(value)
        raise ArithmeticError(f"{value} is not rational")

    return PlainArithmetic(number)
