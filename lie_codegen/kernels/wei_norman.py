"""The exact Wei-Norman equations of a group, for reading and for exact tests.

    X = exp(g_1 A_1) ... exp(g_n A_n),  X' = X hat(u),  g' = M(g) u.

Column j of M^{-1} is exp(-g_n ad_n) ... exp(-g_{j+1} ad_{j+1}) e_j. Wei and Norman, Proc. AMS 15 (1964) 327; Leonard
and Krishnaprasad, TR 93-59, (12)-(15). Code is generated from `wei_norman_body`, not from these expressions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import cast

import sympy as sp

from lie_codegen.algebra.adjoint import ad
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernels.arithmetic import Arithmetic
from lie_codegen.kernels.block_solve import SparseMatrix, blocks_of
from lie_codegen.kernels.exponential_entries import ExponentialEntries
from lie_codegen.kernels.ring_solve import adjugate, determinant
from lie_codegen.kernels.trigonometric_ring import Element, TrigonometricRing
from lie_codegen.kernels.wei_norman_body import WeiNormanData, inverse_columns, times_vector


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
        ring = self._ring
        powers: dict[sp.Expr, int] = {}
        columns, unit = _balanced_columns(ring, self.data)
        for block in blocks_of(columns, self.group.dim):
            dense = [[columns.get((i, j), ring.ring.zero) for j in block] for i in block]
            block_unit, factors = ring.factors(determinant(ring, dense))
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
        # The printed form asks an arithmetic for constants, sin, cos and exp alone, and those a ring has.
        columns = inverse_columns(cast(Arithmetic, ring), self.data, ring.coordinates, printed=True)
        return {place: ring.ring(value) for place, value in columns.items() if value != 0}

    @cached_property
    def _blocks(self) -> list[list[int]]:
        return blocks_of(self._columns, self.group.dim)

    def _dense(self, rows: list[int], columns: list[int]) -> list[list[Element]]:
        zero = self._ring.ring.zero
        return [[self._columns.get((i, j), zero) for j in columns] for i in rows]


def _balanced_columns(ring: TrigonometricRing, data: WeiNormanData) -> tuple[SparseMatrix, sp.Expr]:
    """N and a unit with det M^{-1} = unit * det N, N with shorter products of exponentials than M^{-1}.

    M^{-1} = exp(-g_n ad_n) ... exp(-g_m ad_m) N with m near n / 2; the determinant of the exponentials is that of the
    exponentials of traces. Column j of N is exp(-g_{m-1} ad_{m-1}) ... exp(-g_{j+1} ad_{j+1}) e_j below m, and
    exp(g_m ad_m) ... exp(g_{j-1} ad_{j-1}) e_j from m on.
    """
    n = data.group.dim
    middle = (n + 1) // 2
    ops = cast(Arithmetic, ring)
    factors = {
        k: ExponentialEntries(
            ops, ring.coordinates[k] * (-1 if k < middle else 1), data.adjoint[k], printed=True
        ).sparse()
        for k in range(n)
    }
    columns: dict[tuple[int, int], Element] = {}
    for j in range(n):
        column: dict[int, Element] = {j: ring.ring.one}
        for k in range(j + 1, middle) if j < middle else reversed(range(middle, j)):
            column = times_vector(factors[k], column)
        columns.update({(i, j): value for i, value in column.items() if value})
    traces = (ad(data.group.algebra, k).trace() * ring.symbols[k] for k in range(middle, n))
    return columns, sp.Mul(*(sp.exp(-trace) for trace in traces))


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
