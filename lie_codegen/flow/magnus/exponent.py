"""The exponent of one Magnus step of X' = X A from the generators of a polynomial A; any bracket.

The printed formulas are for X' = A X: c(x, y) = -[x, y] turns them round. Blanes, Casas and Ros, BIT 40 (2000) 434.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from lie_codegen.algebra.brackets import bracket
from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.arrays import Array

Product = Callable[[Array, Array], Array]

#: Gauss's three points in a step of unit length.
GAUSS = 0.5 + math.sqrt(15) / 10 * np.array([-1, 0, 1])


def reversed_bracket(algebra: LieAlgebra) -> Product:
    """c(x, y) = [y, x] of coordinates (..., n)."""
    return lambda x, y: bracket(algebra, y, x)


def sixth_order(c: Product, a1: Array, a2: Array, a3: Array) -> Array:
    """Omega to sixth order: two brackets of two and one of three."""
    once = c(a1, a2)
    twice = -c(a1, 2 * a3 + once) / 60
    return np.asarray(a1 + a3 / 12 + c(-20 * a1 - a3 + once, a2 + twice) / 240)


def eighth_order(c: Product, a1: Array, a2: Array, a3: Array, a4: Array) -> Array:
    """Omega to eighth order, from the generators of a polynomial of third degree."""
    s1 = -c(a1 + a3 / 28, a2 + 3 * a4 / 28) / 28
    r1 = c(a1, s1 - a3 / 14) / 3
    s2 = c(a1 + a3 / 28 + s1, a2 + 3 * a4 / 28 + r1)
    r2 = c(a1 + 5 * s1 / 4, 2 * a3 + s2 + c(a2, s1) / 2)
    s3 = c(a1 + a3 / 12 - 7 * s1 / 3 - s2 / 6, -9 * a2 - 9 * a4 / 4 + 63 * r1 + r2)
    return np.asarray(a1 + a3 / 12 - 7 * s2 / 120 + s3 / 360)


def from_gauss(c: Product, u1: Array, u2: Array, u3: Array) -> Array:
    """Omega to sixth order from h u at Gauss's three points."""
    return sixth_order(c, u2, math.sqrt(15) / 3 * (u3 - u1), 10 / 3 * (u3 - 2 * u2 + u1))
