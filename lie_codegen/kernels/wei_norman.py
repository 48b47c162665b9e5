"""The exact Wei-Norman equations of a group, for reading and for exact tests.

    X = exp(g_1 A_1) ... exp(g_n A_n),  X' = X hat(u),  g' = M(g) u.

Column j of M^{-1} is exp(-g_n ad_n) ... exp(-g_{j+1} ad_{j+1}) e_j. Wei and Norman, Proc. AMS 15 (1964) 327; Leonard and
Krishnaprasad, TR 93-59, (12)-(15). Code is generated from `wei_norman_body`, not from these expressions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import sympy as sp

from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernels.block_solve import blocks_of
from lie_codegen.kernels.ring_solve import adjugate, determinant
from lie_codegen.kernels.trigonometric_ring import Element, TrigonometricRing
from lie_codegen.kernels.wei_norman_body import WeiNormanData, inverse_columns


@dataclass(frozen=True)
class WeiNorman:
    """g' = M(g) u, exact; each part is computed when it is first read.

    Attributes:
        group: the group, with its basis order.
        g: (n) the symbols g1..gn.
        data: the exponentials of every ad_{A_k}.
    """

    group: MatrixGroup
    g: tuple[sp.Symbol, ...]
    data: WeiNormanData

    @cached_property
    def M_inverse(self) -> sp.ImmutableMatrix:
        """(n, n) exact M(g)^{-1}."""
        n = self.group.dim
        return sp.ImmutableMatrix(
            n, n, lambda i, j: self._ring.expression(self._columns[i, j]) if (i, j) in self._columns else sp.S.Zero
        )

    @cached_property
    def determinant(self) -> sp.Expr:
        """det M(g)^{-1}, factored; the chart ends where it vanishes."""
        unit, factors = self.determinant_factors
        return unit * sp.Mul(*(factor**multiplicity for factor, multiplicity in factors))

    @cached_property
    def determinant_factors(self) -> tuple[sp.Expr, tuple[tuple[sp.Expr, int], ...]]:
        """(unit, ((factor, multiplicity), ...)): the unit, a number times exponentials, never vanishes."""
        unit = sp.S.One
        powers: dict[sp.Expr, int] = {}
        for block in self._blocks:
            block_unit, factors = self._ring.factors(determinant(self._ring, self._dense(block, block)))
            unit *= block_unit
            for factor, multiplicity in factors:
                powers[factor] = powers.get(factor, 0) + multiplicity
        return unit, tuple(sorted(powers.items(), key=lambda item: sp.default_sort_key(item[0])))

    @cached_property
    def M(self) -> sp.ImmutableMatrix:
        """(n, n) exact M(g), block by block over the block-triangular form of M^{-1}."""
        ring, n = self._ring, self.group.dim
        rows: list[list[tuple[Element, Element]]] = [[(ring.ring.zero, ring.ring.one)] * n for _ in range(n)]
        solved: list[int] = []
        for block in self._blocks:
            dense = self._dense(block, block)
            cofactors, det = adjugate(ring, dense), determinant(ring, dense)
            coupling = self._dense(block, solved)
            for column in range(n):
                residual = [
                    self._residual(i, row, column, solved, rows) for i, row in zip(block, coupling, strict=True)
                ]
                for i, row in zip(block, cofactors, strict=True):
                    numerator, denominator = _combination(ring, row, residual)
                    rows[i][column] = ring.fraction(numerator, ring.reduce(denominator * det))
            solved += block
        return sp.ImmutableMatrix(n, n, lambda i, j: ring.quotient(*rows[i][j]))

    def _residual(
        self, i: int, row: list[Element], column: int, solved: list[int], rows: list[list[tuple[Element, Element]]]
    ) -> tuple[Element, Element]:
        """Entry i of e_column - (what the solved coordinates contribute)."""
        ring = self._ring
        numerator, denominator = _combination(ring, row, [rows[j][column] for j in solved])
        one = denominator if i == column else ring.ring.zero
        return one - numerator, denominator

    @cached_property
    def _ring(self) -> TrigonometricRing:
        return TrigonometricRing(self.g, self.data.adjoint)

    @cached_property
    def _columns(self) -> dict[tuple[int, int], Element]:
        ring = self._ring
        columns = inverse_columns(ring, self.data, ring.coordinates, printed=True)
        return {place: ring.ring(value) for place, value in columns.items() if value != 0}

    @cached_property
    def _blocks(self) -> list[list[int]]:
        return blocks_of(self._columns, self.group.dim)

    def _dense(self, rows: list[int], columns: list[int]) -> list[list[Element]]:
        zero = self._ring.ring.zero
        return [[self._columns.get((i, j), zero) for j in columns] for i in rows]


def _combination(
    ring: TrigonometricRing, row: list[Element], fractions: list[tuple[Element, Element]]
) -> tuple[Element, Element]:
    """sum of row[j] * fractions[j] over a common denominator."""
    numerator, denominator = ring.ring.zero, ring.ring.one
    for entry, (above, below) in zip(row, fractions, strict=True):
        if not entry or not above:
            continue
        term = ring.reduce(entry * above)
        if below == denominator:
            numerator = numerator + term
        elif below == ring.ring.one:
            numerator = numerator + ring.reduce(term * denominator)
        else:
            numerator = ring.reduce(numerator * below + term * denominator)
            numerator, denominator = ring.fraction(numerator, ring.reduce(denominator * below))
    return numerator, denominator


def wei_norman(group: MatrixGroup) -> WeiNorman:
    """The exact Wei-Norman equations of a group in its basis order.

    M_inverse, determinant and M follow when they are read. The determinant is factored; that it never vanishes does not
    make the coordinates global: see `wei_norman_order`.
    """
    symbols = tuple(sp.Symbol(f"g{k}") for k in range(1, group.dim + 1))
    return WeiNorman(group, symbols, WeiNormanData(group))
