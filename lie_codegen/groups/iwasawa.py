"""Iwasawa decomposition of the semisimple part of a group: s = k + a + n, exact.

The Cartan involution is theta(X) = -X^H in the group's own matrices where the algebra is closed under the conjugate
transpose; elsewhere it is found from the brackets (`algebra.cartan`), so that no verdict depends on the representation. k are its fixed points, a is a maximal abelian subspace of -1, n the sum of root spaces that are
positive on a. G = K A N then holds globally; K compact, A N solvable (Knapp, Lie Groups Beyond an Introduction, VI.4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from lie_codegen.algebra.cartan import cartan_involution_of
from lie_codegen.algebra.ideal_chain import adapted_basis
from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.algebra.subspace import Subspace, Vector, annihilated, bracket, span
from lie_codegen.errors import AlgebraError
from lie_codegen.exact.numbers import Number, domain_matrix, real_coordinates, to_numbers
from lie_codegen.groups.cartan import restricted_to
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.on_demand import sympy as sp


@dataclass(frozen=True)
class Iwasawa:
    """Bases of k, a and n as coordinate vectors; n in the order of a chain of ideals."""

    k: tuple[Vector, ...]
    a: tuple[Vector, ...]
    n: tuple[Vector, ...]


def iwasawa(group: MatrixGroup, semisimple: Subspace) -> Iwasawa | None:
    """The decomposition of a semisimple subalgebra; None if conjugate transposes leave it or its roots are irrational."""
    theta = _cartan_involution(group, semisimple)
    if theta is None:
        return None
    identity = sp.eye(len(semisimple))
    k = _combined(semisimple, _kernel(theta - identity))
    p = _combined(semisimple, _kernel(theta + identity))
    a = _maximal_abelian(group.algebra, p)
    n = _positive_roots(group.algebra, semisimple, a)
    if n is None or len(k) + len(a) + len(n) != len(semisimple):
        return None
    return Iwasawa(k, a, adapted_basis(group.algebra, n))


def _kernel(matrix: sp.Matrix) -> Subspace:
    return annihilated(matrix.tolist(), matrix.cols)


def _combined(basis: Subspace, coordinates: Subspace) -> Subspace:
    return span(
        [sum((c * vector[i] for c, vector in zip(row, basis, strict=True)), sp.S.Zero) for i in range(len(basis[0]))]
        for row in coordinates
    )


def _matrix(group: MatrixGroup, x: Vector) -> sp.Matrix:
    total = sp.zeros(group.degree)
    for value, matrix in zip(x, group.exact_basis, strict=True):
        if value != 0:
            total += value * matrix
    return total


def _cartan_involution(group: MatrixGroup, semisimple: Subspace) -> sp.Matrix | None:
    """theta on the coordinates along the given vectors: -X^H where that is one, else from the brackets where it is rational."""
    matrices = [_matrix(group, vector) for vector in semisimple]
    size = len(matrices)
    own = [real_coordinates(matrix) for matrix in matrices]
    images = [real_coordinates(-matrix.H) for matrix in matrices]
    table = [list(row) for row in zip(*own, *images, strict=True)]
    reduced, pivots = domain_matrix(table).rref()
    if tuple(pivots) == tuple(range(size)):
        rows = to_numbers(reduced)[:size]
        return sp.Matrix([row[size:] for row in rows])
    try:
        return cartan_involution_of(restricted_to(group.algebra, semisimple)).exact
    except AlgebraError:
        return None


def _maximal_abelian(algebra: LieAlgebra, p: Subspace) -> tuple[Vector, ...]:
    a: list[Vector] = []
    candidates = p
    while True:
        new = next((v for v in candidates if len(span([*a, v])) > len(a)), None)
        if new is None:
            return tuple(a)
        a.append(new)
        images = [bracket(algebra, x, new) for x in candidates]
        kernel = annihilated([list(row) for row in zip(*images, strict=True)], len(candidates))
        candidates = _combined(candidates, kernel)


def _positive_roots(algebra: LieAlgebra, semisimple: Subspace, a: tuple[Vector, ...]) -> Subspace | None:
    """The sum of the root spaces on which a regular element of a is positive."""
    if not a:
        return ()
    rank = len(a)
    choices = ([i * (rank + 1 - i) for i in range(1, rank + 1)], list(range(rank, 0, -1)), [3**i for i in range(rank)])
    fixed = len(_zero_space(algebra, semisimple, a))
    for weights in choices:
        element = tuple(sum((w * v[i] for w, v in zip(weights, a, strict=True)), sp.S.Zero) for i in range(algebra.dim))
        if len(_zero_space(algebra, semisimple, [element])) == fixed:
            return _positive_eigenspaces(algebra, semisimple, element)
    return None


def _zero_space(algebra: LieAlgebra, inside: Subspace, elements: Sequence[Vector]) -> Subspace:
    rows: list[list[Number]] = []
    for element in elements:
        images = [bracket(algebra, element, x) for x in inside]
        rows += [list(row) for row in zip(*images, strict=True)]
    return annihilated(rows, len(inside))


def _positive_eigenspaces(algebra: LieAlgebra, inside: Subspace, element: Vector) -> Subspace | None:
    images = [bracket(algebra, element, vector) for vector in inside]
    table = [list(row) for row in zip(*inside, *images, strict=True)]
    rows = to_numbers(domain_matrix(table).rref()[0])[: len(inside)]
    matrix = sp.Matrix([row[len(inside) :] for row in rows])
    roots = sp.Poly(matrix.charpoly().all_coeffs(), sp.Dummy()).ground_roots()
    if sum(roots.values()) != len(inside):
        return None
    found: list[Vector] = []
    for root in roots:
        if root > 0:
            found += _combined(inside, _kernel(matrix - root * sp.eye(len(inside))))
    return span(found)
