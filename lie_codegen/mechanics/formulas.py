"""Formulas and parameters that users write: text in the closed grammar, SymPy, or plain numbers."""

from __future__ import annotations

import re
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import numpy as np

from lie_codegen.errors import ExpressionError, InputError, NotFiniteError
from lie_codegen.exact.expression import FORMULA_FUNCTIONS, parse_expression
from lie_codegen.exact.numbers import exact_number
from lie_codegen.on_demand import sympy as sp

_NAME = re.compile(r"(?<![\w.])([A-Za-z_]\w*)(?!\s*\(|\w)", re.ASCII)


def quantity(value: Any, what: str) -> sp.Expr:
    """A physical value as an exact number: a float is the decimal it prints as, 9.81 is 981/100.

    Raises:
        InputError: naming `what`, for anything that is not a real number.
    """
    if isinstance(value, float | np.floating):
        if not np.isfinite(value):
            raise NotFiniteError(f"{what} is {value}")
        return sp.Rational(Fraction(repr(float(value))))
    try:
        number = exact_number(value)
    except InputError as error:
        raise InputError(f"{what}: {error}") from error
    if not number.is_real:
        raise InputError(f"{what}: {value!r} is not real")
    return number


def parameter_values(parameters: Mapping[str, Any] | None) -> dict[str, sp.Expr]:
    """name -> exact value, or a real symbol where the value is None (it stays an argument)."""
    return {
        name: sp.Symbol(name, real=True) if value is None else quantity(value, f"parameter {name!r}")
        for name, value in (parameters or {}).items()
    }


def formula(value: Any, names: Mapping[str, sp.Expr], what: str) -> sp.Expr:
    """The SymPy expression of a text, a number, or an expression in the same names.

    Raises:
        ExpressionError: naming `what`, with the column of a text.
        InputError: for another type, or an expression with symbols of other names.
    """
    if isinstance(value, str):
        try:
            return parse_expression(value, {"pi": sp.pi, **names}, FORMULA_FUNCTIONS)
        except ExpressionError as error:
            raise ExpressionError(f"{what}: {error}") from error
    if isinstance(value, sp.Expr) and value.free_symbols:
        unknown = sorted(str(symbol) for symbol in value.free_symbols if str(symbol) not in names)
        if unknown:
            raise ExpressionError(f"{what}: no name {', '.join(unknown)}; known: {', '.join(sorted(names))}")
        return value.xreplace({symbol: names[str(symbol)] for symbol in value.free_symbols})
    return quantity(value, what)


def names_in(value: Any) -> list[str]:
    """The names a formula mentions, functions left out, in order of first appearance."""
    if isinstance(value, str):
        return list(dict.fromkeys(_NAME.findall(value)))
    if isinstance(value, sp.Expr):
        return sorted(str(symbol) for symbol in value.free_symbols)
    return []
