"""The adjoint representation of the algebra and the forms built on it."""

from __future__ import annotations

import sympy as sp

from lie_codegen.algebra.lie_algebra import LieAlgebra


def ad(algebra: LieAlgebra, i: int) -> sp.Matrix:
    """(n, n) exact matrix of ad_{A_i}: column j holds the coordinates of [A_i, A_j]."""
    matrix = sp.zeros(algebra.dim, algebra.dim)
    for a, b, k, value in algebra.constants():
        if a == i:
            matrix[k, b] = value
    return matrix


def killing_form(algebra: LieAlgebra) -> sp.Matrix:
    """(n, n) exact K_ij = trace(ad_i ad_j)."""
    ads = [ad(algebra, i) for i in range(algebra.dim)]
    return sp.Matrix(algebra.dim, algebra.dim, lambda i, j: sp.expand((ads[i] * ads[j]).trace()))
