"""Subspaces of a Lie algebra, exact, by their reduced row echelon form."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.exact.numbers import Number, domain_matrix, to_numbers
from lie_codegen.on_demand import sympy as sp

#: Coordinates of a vector.
Vector = tuple[Number, ...]
#: Rows of a reduced row echelon form: equal subspaces are equal tuples.
Subspace = tuple[Vector, ...]


def whole(algebra: LieAlgebra) -> Subspace:
    """The algebra itself."""
    return tuple(unit(algebra, i) for i in range(algebra.dim))


def unit(algebra: LieAlgebra, i: int) -> Vector:
    """The coordinates of A_i."""
    return tuple(sp.Integer(int(i == k)) for k in range(algebra.dim))


def span(vectors: Iterable[Sequence[Number]]) -> Subspace:
    """The span of some vectors."""
    rows = [list(vector) for vector in vectors]
    rows = [row for row in rows if any(row)]
    if not rows:
        return ()
    reduced, pivots = domain_matrix(rows).rref()
    return tuple(tuple(row) for row in to_numbers(reduced)[: len(pivots)])


def bracket(algebra: LieAlgebra, x: Sequence[Number], y: Sequence[Number]) -> Vector:
    """[x, y] of two coordinate vectors."""
    left = {i: value for i, value in enumerate(x) if value != 0}
    right = {i: value for i, value in enumerate(y) if value != 0}
    found = algebra.bracket(left, right)
    return tuple(found.get(k, sp.S.Zero) for k in range(algebra.dim))


def brackets(algebra: LieAlgebra, first: Subspace, second: Subspace) -> Subspace:
    """[U, V], the span of all [x, y]."""
    return span(bracket(algebra, x, y) for x in first for y in second)


def contains(subspace: Subspace, vectors: Iterable[Sequence[Number]]) -> bool:
    """Whether all vectors lie in the subspace."""
    return len(span([*subspace, *vectors])) == len(subspace)


def annihilated(rows: Sequence[Sequence[Number]], width: int) -> Subspace:
    """All x with row . x = 0 for every row."""
    rows = [row for row in rows if any(row)]
    if not rows:
        return tuple(tuple(sp.Integer(int(i == k)) for k in range(width)) for i in range(width))
    return span(to_numbers(domain_matrix(rows).nullspace().to_dense()))


def complement(subspace: Subspace, inside: Subspace) -> tuple[Vector, ...]:
    """Vectors among the rows of `inside` that extend a basis of the subspace to one of `inside`."""
    chosen: list[Vector] = []
    current = subspace
    for vector in inside:
        larger = span([*current, vector])
        if len(larger) > len(current):
            chosen.append(vector)
            current = larger
    return tuple(chosen)
