"""Derivatives by differences of 50 digits: an oracle for derivative kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mpmath as mp
import numpy as np
import sympy as sp

import lie_codegen as lc
from lie_codegen.kernel.dual import PlainArithmetic

DIGITS = 50
STEP = mp.mpf(10) ** -15  # central differences: right to 1e-30


def matrices(group: lc.MatrixGroup) -> list[Any]:
    with mp.workdps(DIGITS):
        return [
            mp.matrix([[mp.mpmathify(sp.N(x, DIGITS)) for x in m.row(i)] for i in range(m.rows)])
            for m in group.exact_basis
        ]


def combined(basis: list[Any], x: Any) -> Any:
    return sum((mp.mpmathify(c) * A for c, A in zip(x, basis, strict=True)), mp.zeros(basis[0].rows))


def components(basis: list[Any], A: Any) -> Any:
    """Least squares over the real field; A is in the span."""
    columns = [[*map(mp.re, B), *map(mp.im, B)] for B in basis]
    return mp.lu_solve(mp.matrix(columns).T, mp.matrix([*map(mp.re, A), *map(mp.im, A)]))


def slopes(f: Callable[[Any], Any], count: int) -> np.ndarray:
    """df/de_j at e = 0 for f of a list of e, as columns."""
    columns = []
    for j in range(count):
        e = [STEP if i == j else mp.mpf(0) for i in range(count)]
        difference = (mp.matrix(f(e)) - mp.matrix(f([-each for each in e]))) / (2 * STEP)
        columns.append([complex(value) for value in difference])
    found = np.array(columns).T
    return found if np.any(found.imag) else found.real


def multiprecision() -> PlainArithmetic:
    names = (
        "sin",
        "cos",
        "tan",
        "exp",
        "expm1",
        "log",
        "sqrt",
        "sinh",
        "cosh",
        "tanh",
        "acos",
        "asin",
        "atan",
        "atan2",
        "fabs",
    )

    def number(value: Any) -> Any:
        return mp.mpf(value) if isinstance(value, float) else mp.mpmathify(sp.N(value, DIGITS))

    return PlainArithmetic(number, {name: getattr(mp, name) for name in names})
