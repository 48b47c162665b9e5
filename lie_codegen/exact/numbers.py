"""Exact linear algebra over the smallest field that holds the entries: Q, Q(sqrt 3), Q(pi), ..."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from decimal import Decimal
from fractions import Fraction
from typing import Any, TypeAlias

import numpy as np

from lie_codegen.errors import InputError, NotFiniteError
from lie_codegen.exact.budget import current_budget, field_degree, integer_digits, over, require_within
from lie_codegen.exact.expression import parse_number
from lie_codegen.on_demand import sympy as sp

#: An exact number: what `exact_number` returns.
Number: TypeAlias = "sp.Expr"


def exact_number(value: Any) -> Number:
    """An exact SymPy number from an int, Fraction, Decimal, float, complex, text, or SymPy number.

    A float is taken at its exact binary value when that has a denominator below 10^6 or so, as 0.5 and 0.75 do;
    0.1 does not: write "1/10" or "0.1" as a text.

    Raises:
        InputError: for a symbol, an inexact float, or another type.
        NotFiniteError: for NaN and infinity.
    """
    if isinstance(value, str):
        return parse_number(value)
    if isinstance(value, bool | np.bool_):
        raise InputError(f"{value!r} is not a number")
    if isinstance(value, int | np.integer):
        if integer_digits(int(value)) > current_budget().digits:
            raise InputError(over("digits", "a number has too many digits"))
        return sp.Integer(int(value))
    if isinstance(value, Fraction):
        return require_within(sp.Rational(value.numerator, value.denominator))
    if isinstance(value, Decimal):
        if not value.is_finite():
            raise NotFiniteError(f"{value} is not finite")
        most = current_budget().digits
        if abs(value.adjusted()) > most or len(value.as_tuple().digits) > most:
            raise InputError(over("digits", f"a number of more than {most} digits"))
        return sp.Rational(str(value))
    if isinstance(value, complex | np.complexfloating):
        return exact_number(float(value.real)) + sp.I * exact_number(float(value.imag))
    if isinstance(value, float | np.floating):
        return _exact_float(float(value))
    if isinstance(value, sp.Float):
        return _exact_float(float(value))
    if isinstance(value, sp.Expr):
        if value.has(sp.nan, sp.oo, -sp.oo, sp.zoo):
            raise NotFiniteError(f"{value} is not finite")
        if value.free_symbols or not value.is_number:
            raise InputError(f"{value} is not a number")
        if value.has(sp.Float):
            raise InputError(f"{value} holds a decimal of finite precision; write it as a fraction or a text")
        return sp.expand(require_within(value))
    raise InputError(f"{value!r} ({type(value).__name__}) is not a number")


def _exact_float(value: float) -> Number:
    if not np.isfinite(value):
        raise NotFiniteError(f"{value} is not finite")
    numerator, denominator = value.as_integer_ratio()
    if denominator > 2**20:
        raise InputError(f"the float {value!r} is not exact; write it as a text, as in '1/3', '0.1' or 'sqrt(2)/2'")
    return sp.Rational(numerator, denominator)


def domain_matrix(
    rows: Sequence[Sequence[Number]], shape: tuple[int, int] | None = None
) -> sp.polys.matrices.DomainMatrix:
    """A DomainMatrix over the smallest field that holds all entries."""
    flat = [entry for row in rows for entry in row]
    height = len(rows)
    width = len(rows[0]) if rows else 0
    domain, elements = field_elements(flat)
    table = [elements[r * width : (r + 1) * width] for r in range(height)]
    return sp.polys.matrices.DomainMatrix(table, shape or (height, width), domain)


def field_elements(values: Sequence[Number]) -> tuple[Any, list[Any]]:
    """The smallest field that holds the values, and the values as its elements."""
    if all(value.is_Rational for value in values):
        from sympy.polys.domains import QQ

        return QQ, [QQ.from_sympy(value) for value in values]
    if field_degree(list(values)) > current_budget().degree:
        raise InputError(over("degree", "the roots in the entries together span a field of too high a degree"))
    domain, elements = sp.polys.constructor.construct_domain(list(values), field=True, extension=True)
    return domain, list(elements)


def is_positive_definite(form: sp.polys.matrices.DomainMatrix) -> bool:
    """Whether every pivot of the elimination without exchanges is positive (Sylvester), for a symmetric matrix."""
    domain = form.domain
    rows = [list(row) for row in form.to_dense().rep.to_ddm()]
    for k, pivot_row in enumerate(rows):
        if not domain.to_sympy(pivot_row[k]) > 0:
            return False
        for i in range(k + 1, len(rows)):
            factor = rows[i][k] / pivot_row[k]
            rows[i] = [a - factor * b for a, b in zip(rows[i], pivot_row, strict=True)]
    return True


def to_numbers(matrix: sp.polys.matrices.DomainMatrix) -> list[list[Number]]:
    """The entries as SymPy numbers."""
    domain = matrix.domain
    return [[domain.to_sympy(entry) for entry in row] for row in matrix.to_dense().rep.to_ddm()]


def nonzero(values: Iterable[Number]) -> dict[int, Number]:
    """The nonzero entries, by position."""
    return {index: value for index, value in enumerate(values) if value != 0}


def real_coordinates(matrix: sp.MatrixBase) -> list[Number]:
    """The entries of a matrix as a flat list of real and imaginary parts: 2 d^2 reals."""
    entries = list(matrix.flat())
    return [part for entry in entries for part in entry.expand().as_real_imag()]
