"""Formulas of a manifold in its coordinates q1 .. qN: constraints, inertia and frames, from texts, numbers or expressions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.expression import FORMULA_FUNCTIONS, parse_expression
from lie_codegen.exact.positive_matrix import real_number
from lie_codegen.on_demand import sympy as sp


def symbols_of(letter: str, size: int) -> tuple[sp.Symbol, ...]:
    """q1 .. qN."""
    return tuple(sp.Symbol(f"{letter}{k + 1}", real=True) for k in range(size))


def read_formula(entry: Any, names: Mapping[str, sp.Expr], what: str) -> sp.Expr:
    """A text, a number or an expression in the given names.

    Raises:
        InputError, ExpressionError: a symbol that is none of them, a text outside the grammar.
    """
    if isinstance(entry, str):
        return parse_expression(entry, names, FORMULA_FUNCTIONS)
    if isinstance(entry, sp.Expr):
        made = entry.subs({symbol: names[symbol.name] for symbol in entry.free_symbols if symbol.name in names})
        unknown = sorted(str(s) for s in made.free_symbols if s.name not in names)
        if unknown:
            raise InputError(f"{what} holds {', '.join(unknown)}; known: {', '.join(names)}")
        return made
    return real_number(entry, what)


def read_rows(rows: Any, size: int, names: Mapping[str, sp.Expr], what: str) -> sp.ImmutableMatrix:
    """A number (times the identity), a diagonal or rows of texts.

    Raises:
        ShapeError: another shape. InputError, ExpressionError: as `read_formula`.
    """
    given = rows.tolist() if hasattr(rows, "tolist") else rows
    if not isinstance(given, list | tuple):
        return sp.ImmutableMatrix(sp.eye(size) * read_formula(given, names, what))
    if len(given) != size:
        raise ShapeError(f"{what} has {len(given)} rows; give a number, {size} entries or {size} x {size}")
    if not any(isinstance(row, list | tuple) or hasattr(row, "tolist") for row in given):
        return sp.ImmutableMatrix(sp.diag(*[read_formula(entry, names, what) for entry in given]))
    table = [row.tolist() if hasattr(row, "tolist") else list(row) for row in given]
    if any(len(row) != size for row in table):
        raise ShapeError(f"{what} must be {size} x {size}")
    return sp.ImmutableMatrix([[read_formula(entry, names, what) for entry in row] for row in table])
