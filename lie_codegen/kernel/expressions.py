"""SymPy expressions over any arithmetic: the one closed table; a node outside it is refused."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from functools import cache, reduce
from typing import Any

from lie_codegen.errors import ExpressionError
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.on_demand import sympy as sp


@cache
def _unary() -> Mapping[Any, str]:
    """SymPy's functions -> the arithmetic's."""
    same = ("sin", "cos", "tan", "exp", "log", "sinh", "cosh", "tanh", "acos", "asin", "atan")
    return {**{getattr(sp, name): name for name in same}, sp.Abs: "fabs"}


class ExpressionEvaluator:
    """Evaluates SymPy expressions with given values of their symbols; common subexpressions once."""

    def __init__(self, ops: Arithmetic, values: Mapping[sp.Symbol, Scalar]) -> None:
        self.ops = ops
        self.memo: dict[sp.Basic, Scalar] = dict(values)

    def __call__(self, expression: sp.Expr) -> Scalar:
        """The value of one expression.

        Raises:
            ExpressionError: an unknown symbol or a node outside the table.
        """
        if expression not in self.memo:
            self.memo[expression] = self._evaluate(expression)
        return self.memo[expression]

    def _evaluate(self, expression: sp.Expr) -> Scalar:
        if expression.is_number and not expression.free_symbols:
            return int(expression) if expression.is_Integer else self.ops.constant(expression)
        if isinstance(expression, sp.Symbol):
            raise ExpressionError(
                f"the symbol {expression} has no value; known: {', '.join(map(str, self._symbols()))}"
            )
        if isinstance(expression, sp.Add):
            return reduce(operator.add, map(self, expression.args))
        if isinstance(expression, sp.Mul):
            return self._product(expression)
        if isinstance(expression, sp.Pow):
            return self._power(*expression.args)
        if isinstance(expression, sp.atan2):
            return self.ops.atan2(*map(self, expression.args))
        name = _unary().get(expression.func)
        if name is None:
            raise ExpressionError(f"{expression.func.__name__} in {expression} has no meaning in generated code")
        return getattr(self.ops, name)(self(expression.args[0]))

    def _product(self, expression: sp.Mul) -> Scalar:
        coefficient, rest = expression.as_coeff_Mul()
        if coefficient != 1:
            value = self(rest)
            return -value if coefficient == -1 else self(coefficient) * value
        above = [factor for factor in expression.args if not _is_divisor(factor)]
        below = [sp.Pow(factor.base, -factor.exp) for factor in expression.args if _is_divisor(factor)]
        numerator = reduce(operator.mul, map(self, above)) if above else 1
        return numerator / reduce(operator.mul, map(self, below)) if below else numerator

    def _power(self, base: sp.Expr, exponent: sp.Expr) -> Scalar:
        if exponent.is_Integer:
            power = _integer_power(self(base), abs(int(exponent)))
            return power if exponent > 0 else 1 / power
        if exponent.is_Rational and exponent.q == 2:
            power = _integer_power(self.ops.sqrt(self(base)), abs(int(exponent.p)))
            return power if exponent > 0 else 1 / power
        return self.ops.exp(self(exponent) * self.ops.log(self(base)))

    def _symbols(self) -> list[sp.Basic]:
        return [key for key in self.memo if isinstance(key, sp.Symbol)]


def _is_divisor(factor: sp.Expr) -> bool:
    return isinstance(factor, sp.Pow) and factor.exp.is_Rational and factor.exp < 0


def _integer_power(base: Scalar, exponent: int) -> Scalar:
    if exponent == 1:
        return base
    half = _integer_power(base, exponent // 2)
    return half * half if exponent % 2 == 0 else half * half * base


def expression_body(symbols: Sequence[Any], outputs: Sequence[Any]) -> Callable[..., tuple[Any, ...]]:
    """A kernel body from SymPy expressions.

    Args:
        symbols: for each input a symbol (scalar port), a sequence of symbols (vector port) or a matrix of them (matrix port).
        outputs: for each output an expression, a list of expressions, or a list of rows of them.
    """

    def body(ops: Arithmetic, *arguments: Any) -> tuple[Any, ...]:
        values: dict[sp.Symbol, Scalar] = {}
        for names, argument in zip(symbols, arguments, strict=True):
            if isinstance(names, sp.Symbol):
                values[names] = argument
            elif isinstance(names, sp.MatrixBase):
                values.update(zip(names.flat(), (entry for row in argument for entry in row), strict=True))
            else:
                values.update(zip(names, argument, strict=True))
        evaluate = ExpressionEvaluator(ops, values)

        def nested(output: Any) -> Any:
            return [nested(entry) for entry in output] if isinstance(output, list | tuple) else evaluate(output)

        return tuple(nested(output) for output in outputs)

    return body
