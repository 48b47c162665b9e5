"""Orders of a basis along chains of ideals, in which products of exponentials are global coordinates.

Let h_1 < h_2 < ... < g be spans of basis elements, each an ideal of codimension 1 in the next. Adding the new element at
the left end of the list leaves det M^{-1} unchanged, at the right end it multiplies it by det(Ad | old span) != 0; and the
Wei-Norman equations become a cascade of quadratures. A real solvable algebra always has such a chain: any hyperplane that
contains [g, g] is an ideal.
"""

from __future__ import annotations

from collections.abc import Sequence

from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.algebra.subspace import Subspace, Vector, brackets, complement


def is_subalgebra(algebra: LieAlgebra, inside: Sequence[int]) -> bool:
    """Whether brackets of these basis elements stay in their span."""
    return not _leaves(algebra, inside, inside, set(inside))


def is_ideal(algebra: LieAlgebra, ideal: Sequence[int], inside: Sequence[int]) -> bool:
    """Whether [inside, ideal] stays in the span of the ideal's basis elements."""
    return not _leaves(algebra, inside, ideal, set(ideal))


def _leaves(algebra: LieAlgebra, first: Sequence[int], second: Sequence[int], target: set[int]) -> bool:
    rows = (algebra.table.get((min(i, j), max(i, j)), {}) for i in first for j in second if i != j)
    return any(k not in target for row in rows for k in row)


def is_chain_order(algebra: LieAlgebra, order: Sequence[int]) -> bool:
    """Whether the list can be emptied from its ends, one element at a time, what is left always being an ideal."""
    left = list(order)
    while left:
        if is_ideal(algebra, left[1:], left):
            del left[0]
        elif is_ideal(algebra, left[:-1], left):
            del left[-1]
        else:
            return False
    return True


def chain_order(algebra: LieAlgebra, inside: Sequence[int]) -> list[int] | None:
    """An order of these basis elements along a chain of ideals, the last added at the left; None if there is none.

    Taking away the first element that leaves an ideal never spoils a later choice, as brackets only become fewer.
    """
    left, order = list(inside), []
    while left:
        removable = next((x for x in left if is_ideal(algebra, [y for y in left if y != x], left)), None)
        if removable is None:
            return None
        left.remove(removable)
        order.append(removable)
    return order


def adapted_basis(algebra: LieAlgebra, solvable: Subspace) -> tuple[Vector, ...]:
    """A basis of a solvable subalgebra in chain order: through its derived series, from the top."""
    basis: tuple[Vector, ...] = ()
    while solvable:
        smaller = brackets(algebra, solvable, solvable)
        basis += complement(smaller, solvable)
        solvable = smaller
    return basis
