"""The Levi-Civita connection of a left-invariant metric, on the algebra; and symmetric products.

nabla_x y = [x, y]/2 - I^{-1}(ad*_x I y + ad*_y I x)/2                                              (8)
nabla_{A_i} A_j = sum_k G[k][i, j] A_k

It is the one connection without torsion, G[k][i, j] - G[k][j, i] = c[i, j, k], that keeps the metric,
I[l, k] G[k][i, j] + I[j, k] G[k][i, l] = 0. On SO(3) with I = diag(I_1, I_2, I_3),
G[k][i, j] = eps_ijk (1 + (I_j - I_i)/I_k)/2. Bullo and Murray, CIT-CDS 97-003, (8).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.exact.numbers import exact_number
from lie_codegen.exact.positive_matrix import positive_matrix
from lie_codegen.groups.catalogue_load import GroupLike, as_algebra
from lie_codegen.kernel.brackets import ad_star, bracket
from lie_codegen.kernel.linear import plus
from lie_codegen.mechanics.euler_poincare import EXACT
from lie_codegen.on_demand import sympy as sp
from lie_codegen.shapes import entries_of


def connection(algebra: LieAlgebra, inertia: sp.MatrixBase) -> tuple[sp.ImmutableMatrix, ...]:
    """(n) exact matrices G[k] with nabla_{A_i} A_j = sum_k G[k][i, j] A_k."""
    n = algebra.dim
    units = [[sp.Integer(int(i == j)) for j in range(n)] for i in range(n)]
    inverse = inertia.inv()
    table = [[_nabla(algebra, inertia, inverse, units[i], units[j]) for j in range(n)] for i in range(n)]
    return tuple(sp.ImmutableMatrix(n, n, lambda i, j, k=k: table[i][j][k]) for k in range(n))


def nabla(algebra: LieAlgebra, inertia: sp.MatrixBase, x: Sequence[sp.Expr], y: Sequence[sp.Expr]) -> list[sp.Expr]:
    """nabla_x y for constant x and y of the algebra."""
    return _nabla(algebra, inertia, inertia.inv(), x, y)


def symmetric_product(group: GroupLike | LieAlgebra, inertia: Any, x: Sequence[Any], y: Sequence[Any]) -> list[sp.Expr]:
    """<x : y> = nabla_x y + nabla_y x = -I^{-1}(ad*_x I y + ad*_y I x), exact.

    Args:
        group: the group, its name, its file, or its algebra.
        inertia: a number, (n,) or (n, n), positive definite; numbers or exact texts.
        x, y: (n,) vectors of the algebra, numbers or exact texts.

    Raises:
        ShapeError, InputError: naming the culprit.
    """
    algebra = as_algebra(group, "symmetric_product")
    inertia = metric_of(algebra, inertia)
    x, y = (entries_of(each, algebra.dim, f"symmetric_product: {name}") for each, name in ((x, "x"), (y, "y")))
    x, y = ([entry if isinstance(entry, sp.Expr) else exact_number(entry) for entry in each] for each in (x, y))
    inverse = inertia.inv()
    a, b = (_nabla(algebra, inertia, inverse, *pair) for pair in ((x, y), (y, x)))
    return [sp.expand(p + q) for p, q in zip(a, b, strict=True)]


def metric_of(algebra: LieAlgebra, inertia: Any) -> sp.MatrixBase:
    """(n, n) exact; a SymPy matrix, which may hold symbols, as it is.

    Raises:
        ShapeError, InputError: not (n, n), not symmetric, not positive definite.
    """
    return inertia if isinstance(inertia, sp.MatrixBase) else positive_matrix(inertia, algebra.dim, "inertia")


def torsion(algebra: LieAlgebra, table: Sequence[sp.MatrixBase]) -> sp.Expr:
    """The largest |G[k][i, j] - G[k][j, i] - c[i, j, k]|; 0."""
    indices = product(range(algebra.dim), repeat=3)
    return sp.Max(*[abs(table[k][i, j] - table[k][j, i] - algebra.c[i, j, k]) for i, j, k in indices])


def metric_defect(inertia: sp.MatrixBase, table: Sequence[sp.MatrixBase]) -> sp.Expr:
    """The largest |I[l, k] G[k][i, j] + I[j, k] G[k][i, l]|; 0."""
    n = inertia.rows
    return sp.Max(
        *[
            abs(sum((inertia[m, k] * table[k][i, j] + inertia[j, k] * table[k][i, m] for k in range(n)), sp.S.Zero))
            for i in range(n)
            for j in range(n)
            for m in range(n)
        ]
    )


def _nabla(
    algebra: LieAlgebra, inertia: sp.MatrixBase, inverse: sp.MatrixBase, x: Sequence[sp.Expr], y: Sequence[sp.Expr]
) -> list[sp.Expr]:
    lowered_x, lowered_y = list(inertia * sp.Matrix(list(x))), list(inertia * sp.Matrix(list(y)))
    symmetric = plus(ad_star(EXACT, algebra, x, lowered_y), ad_star(EXACT, algebra, y, lowered_x))
    raised = list(inverse * sp.Matrix(symmetric))
    return [sp.expand((a - b) / 2) for a, b in zip(bracket(EXACT, algebra, x, y), raised, strict=True)]
