"""The adjoint representation of the algebra and the forms built on it."""

from __future__ import annotations

from typing import Any

from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.exact.numbers import field_elements
from lie_codegen.on_demand import sympy as sp


def ad(algebra: LieAlgebra, i: int) -> sp.Matrix:
    """(n, n) exact matrix of ad_{A_i}: column j holds the coordinates of [A_i, A_j]."""
    matrix = sp.zeros(algebra.dim, algebra.dim)
    for a, b, k, value in algebra.constants():
        if a == i:
            matrix[k, b] = value
    return matrix


def killing_form(algebra: LieAlgebra) -> sp.Matrix:
    """(n, n) exact K_ij = trace(ad_i ad_j) = sum_ab c_iab c_jba, in the field of the constants (SymPy's sums take a hundred
    times as long in a generic basis)."""
    n = algebra.dim
    entries = list(algebra.constants())
    domain, values = field_elements([value for *_, value in entries])
    by_places: dict[tuple[int, int], list[tuple[int, Any]]] = {}
    for (i, a, b, _), value in zip(entries, values, strict=True):
        by_places.setdefault((a, b), []).append((i, value))
    form = [[domain.zero] * n for _ in range(n)]
    for (a, b), left in by_places.items():
        for i, x in left:
            for j, y in by_places.get((b, a), ()):
                form[i][j] += x * y
    return sp.Matrix(n, n, lambda i, j: domain.to_sympy(form[i][j]))
