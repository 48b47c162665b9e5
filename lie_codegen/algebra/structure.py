"""Killing form, derived and lower central series, centre, radical, nilradical and Levi decomposition, all exact.

Humphreys, Introduction to Lie Algebras and Representation Theory, sections 3 to 6; the Levi subalgebra by lifting through
the derived series of the radical, each lift a linear system (de Graaf, Lie Algebras: Theory and Algorithms, 4.13).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from lie_codegen.algebra.adjoint import ad, killing_form
from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.algebra.subspace import (
    Subspace,
    Vector,
    annihilated,
    bracket,
    brackets,
    complement,
    span,
    whole,
)
from lie_codegen.errors import ComputationError
from lie_codegen.exact.numbers import Number, domain_matrix, to_numbers
from lie_codegen.on_demand import sympy as sp
from lie_codegen.values import Value


@dataclass(frozen=True, eq=False, repr=False)
class Structure(Value):
    """What an algebra is made of; subspaces are tuples of coordinate vectors in reduced row echelon form.

    Attributes:
        algebra: the algebra.
    """

    algebra: LieAlgebra

    @cached_property
    def killing(self) -> sp.ImmutableMatrix:
        """(n, n) K_ij = trace(ad_i ad_j)."""
        return sp.ImmutableMatrix(killing_form(self.algebra))

    @cached_property
    def derived_series(self) -> tuple[Subspace, ...]:
        """g, [g, g], [[g, g], [g, g]], ... down to the first that repeats (left out) or is 0 (kept)."""
        return _series(self.algebra, lambda h: brackets(self.algebra, h, h))

    @cached_property
    def lower_central_series(self) -> tuple[Subspace, ...]:
        """g, [g, g], [g, [g, g]], ... down to the first that repeats (left out) or is 0 (kept)."""
        everything = whole(self.algebra)
        return _series(self.algebra, lambda h: brackets(self.algebra, everything, h))

    @property
    def abelian(self) -> bool:
        """Whether all brackets vanish."""
        return not self.algebra.table

    @property
    def nilpotent(self) -> bool:
        """Whether the lower central series ends in 0."""
        return not self.lower_central_series[-1]

    @property
    def solvable(self) -> bool:
        """Whether the derived series ends in 0."""
        return not self.derived_series[-1]

    @cached_property
    def semisimple(self) -> bool:
        """Whether the Killing form is nondegenerate (Cartan's criterion)."""
        rows = self.killing.tolist()
        return any(map(any, rows)) and int(domain_matrix(rows).rank()) == self.algebra.dim

    @property
    def reductive(self) -> bool:
        """Whether the radical is the centre."""
        return self.radical == self.centre

    @cached_property
    def centre(self) -> Subspace:
        """All x with [x, g] = 0."""
        n = self.algebra.dim
        ads = [ad(self.algebra, i) for i in range(n)]
        return annihilated([[ads[i][k, j] for i in range(n)] for j in range(n) for k in range(n)], n)

    @cached_property
    def radical(self) -> Subspace:
        """The largest solvable ideal: all x with K(x, [g, g]) = 0."""
        derived = brackets(self.algebra, whole(self.algebra), whole(self.algebra))
        rows = [list(sp.Matrix([vector]) * self.killing) for vector in derived]
        return annihilated(rows, self.algebra.dim)

    @cached_property
    def levi(self) -> Subspace:
        """A semisimple subalgebra s with g = s + radical (direct sum of spaces); () for a solvable algebra."""
        return _levi(self.algebra, self.radical)

    @property
    def kind(self) -> str:
        """One of abelian, nilpotent, solvable, semisimple, reductive, "Levi + radical" (none of these)."""
        if self.abelian:
            return "abelian"
        if self.nilpotent:
            return "nilpotent"
        if self.solvable:
            return "solvable"
        if self.semisimple:
            return "semisimple"
        return "reductive" if self.reductive else "Levi + radical"


def structure(algebra: LieAlgebra) -> Structure:
    """The structure of an algebra; each part is computed when it is first read."""
    return Structure(algebra)


def _series(algebra: LieAlgebra, following: Callable[[Subspace], Subspace]) -> tuple[Subspace, ...]:
    found = [whole(algebra)]
    while found[-1]:
        smaller = following(found[-1])
        if smaller == found[-1]:
            break
        found.append(smaller)
    return tuple(found)


def _levi(algebra: LieAlgebra, radical: Subspace) -> Subspace:
    lifted = list(complement(radical, whole(algebra)))
    if not radical or not lifted:
        return span(lifted)
    constants = _quotient_constants(algebra, lifted, radical)
    layer = radical
    while layer:
        smaller = brackets(algebra, layer, layer)
        lifted = _lift(algebra, lifted, constants, complement(smaller, layer), smaller)
        layer = smaller
    return span(lifted)


def _quotient_constants(
    algebra: LieAlgebra, lifted: list[Vector], radical: Subspace
) -> dict[tuple[int, int], list[Number]]:
    """c with [x_i, x_j] = sum_k c_k x_k modulo the radical."""
    basis = [*lifted, *radical]
    return {
        (i, j): _coordinates(basis, bracket(algebra, lifted[i], lifted[j]))[: len(lifted)]
        for i in range(len(lifted))
        for j in range(i + 1, len(lifted))
    }


def _coordinates(basis: list[Vector], vector: Vector) -> list[Number]:
    """Coordinates in a basis of a subspace that holds the vector."""
    augmented = [[*(b[k] for b in basis), vector[k]] for k in range(len(vector))]
    reduced, pivots = domain_matrix(augmented).rref()
    rows = to_numbers(reduced)
    if len(basis) in pivots:
        raise ComputationError("a vector lies outside the subspace whose coordinates are asked for")
    found = [sp.S.Zero] * len(basis)
    for row, pivot in enumerate(pivots):
        found[pivot] = rows[row][-1]
    return found


def _lift(
    algebra: LieAlgebra,
    lifted: list[Vector],
    constants: dict[tuple[int, int], list[Number]],
    freedom: tuple[Vector, ...],
    modulo: Subspace,
) -> list[Vector]:
    """x_i + y_i, y_i in the span of `freedom`, whose brackets close modulo a smaller ideal.

    [x_i, y_j] + [y_i, x_j] - sum_k c_ijk y_k = sum_k c_ijk x_k - [x_i, x_j] modulo the ideal: linear in the y_i.
    """
    m, r, n = len(lifted), len(freedom), algebra.dim
    images = [[bracket(algebra, x, y) for y in freedom] for x in lifted]
    rows: list[list[Number]] = []
    for (i, j), row in constants.items():
        closed = bracket(algebra, lifted[i], lifted[j])
        block = [[sp.S.Zero] * (m * r + 1) for _ in range(n)]
        for k in range(n):
            for a in range(r):
                block[k][j * r + a] += images[i][a][k]
                block[k][i * r + a] -= images[j][a][k]
                for b, value in enumerate(row):
                    block[k][b * r + a] -= value * freedom[a][k]
            block[k][-1] = sum((value * x[k] for value, x in zip(row, lifted, strict=True)), sp.S.Zero) - closed[k]
        rows += _modulo(block, modulo)
    solution = _solve(rows, m * r)
    return [
        tuple(x[k] + sum((solution[i * r + a] * freedom[a][k] for a in range(r)), sp.S.Zero) for k in range(n))
        for i, x in enumerate(lifted)
    ]


def _modulo(block: list[list[Number]], modulo: Subspace) -> list[list[Number]]:
    """The equations left when vectors count modulo an ideal: its pivots are eliminated."""
    pivots = [next(k for k, value in enumerate(vector) if value != 0) for vector in modulo]
    width = len(block[0])
    kept = []
    for k, row in enumerate(block):
        if k in pivots:
            continue
        reduced = [
            row[c] - sum((vector[k] * block[p][c] for vector, p in zip(modulo, pivots, strict=True)), sp.S.Zero)
            for c in range(width)
        ]
        kept.append([sp.expand(value) for value in reduced])
    return kept


def _solve(rows: list[list[Number]], unknowns: int) -> list[Number]:
    """One solution of the linear equations rows[:, :-1] y = rows[:, -1]."""
    rows = [row for row in rows if any(row)]
    found = [sp.S.Zero] * unknowns
    if not rows:
        return found
    reduced, pivots = domain_matrix(rows).rref()
    values = to_numbers(reduced)
    if unknowns in pivots:
        raise ComputationError("the Levi decomposition met equations without a solution")
    for row, pivot in enumerate(pivots):
        found[pivot] = values[row][-1]
    return found
