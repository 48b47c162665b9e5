"""The exact Wei-Norman equations of a group, for reading and for exact tests.

    X = exp(g_1 A_1) ... exp(g_n A_n),  X' = X hat(u),  g' = M(g) u.

Column j of M^{-1} is exp(-g_n ad_n) ... exp(-g_{j+1} ad_{j+1}) e_j. Wei and Norman, Proc. AMS 15 (1964) 327; Leonard
and Krishnaprasad, TR 93-59, (12)-(15). Code is generated from `wei_norman_body`, not from these expressions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import cast

from lie_codegen.algebra.adjoint import ad
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.wei_norman.body import inverse_columns
from lie_codegen.groups.wei_norman.data import WeiNormanData
from lie_codegen.groups.wei_norman.exponential_entries import ExponentialEntries
from lie_codegen.groups.wei_norman.products import times_vector
from lie_codegen.groups.wei_norman.ring_factors import factors as factors_of
from lie_codegen.groups.wei_norman.ring_fractions import quotient
from lie_codegen.groups.wei_norman.ring_solve import combination, dense, determinant, inverse_rows
from lie_codegen.groups.wei_norman.trigonometric_ring import Element, TrigonometricRing
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.block_solve import SparseMatrix, blocks_of
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import sympy as sp


@dataclass(frozen=True, eq=False, repr=False)
class WeiNorman(Saved):
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
        ring, n = self._ring, self.group.dim
        powers: dict[sp.Expr, int] = {}
        traces = (ad(self.group.algebra, k).trace() * self.g[k] for k in range(self._middle, n))
        unit = sp.Mul(*(sp.exp(-trace) for trace in traces))
        for block in blocks_of(self._frame, n):
            block_unit, factors = factors_of(ring, determinant(ring, dense(ring, self._frame, block, block)))
            unit *= block_unit
            for factor, multiplicity in factors:
                powers[factor] = powers.get(factor, 0) + multiplicity
        return unit, tuple(sorted(powers.items(), key=lambda item: sp.default_sort_key(item[0])))

    @cached_property
    def M(self) -> sp.ImmutableMatrix:
        """(n, n) exact M(g) = N^{-1} R, entries in lowest terms (common monomials alone over irrational fields)."""
        ring, n = self._ring, self.group.dim
        inverse = inverse_rows(ring, self._frame, n)
        entries = []
        for i in range(n):
            for j in range(n):
                column = [self._rotation.get((k, j), ring.ring.zero) for k in range(n)]
                entries.append(quotient(ring, *combination(ring, column, inverse[i])))
        return sp.ImmutableMatrix(n, n, entries)

    @cached_property
    def _ring(self) -> TrigonometricRing:
        return TrigonometricRing(self.g, self.data.adjoint)

    @cached_property
    def _columns(self) -> dict[tuple[int, int], Element]:
        ring = self._ring
        # The printed form asks an arithmetic for constants, sin, cos and exp alone, and those a ring has.
        columns = inverse_columns(cast(Arithmetic, ring), self.data, ring.coordinates)
        return {place: ring.ring(value) for place, value in columns.items() if value != 0}

    @property
    def _middle(self) -> int:
        """m in M^{-1} = exp(-g_n ad_n) ... exp(-g_m ad_m) N, counted from 0: the products in N are half as long."""
        return (self.group.dim + 1) // 2

    @cached_property
    def _frame(self) -> SparseMatrix:
        """N: column j is exp(-g_{m-1} ad_{m-1}) ... exp(-g_{j+1} ad_{j+1}) e_j below m,
        and exp(g_m ad_m) ... exp(g_{j-1} ad_{j-1}) e_j from m on."""
        backward, forward = self._factors(-1, 0, self._middle), self._factors(1, self._middle, self.group.dim)
        frame: dict[tuple[int, int], Element] = {}
        for j in range(self.group.dim):
            column: dict[int, Element] = {j: self._ring.ring.one}
            if j < self._middle:
                for k in range(j + 1, self._middle):
                    column = times_vector(backward[k], column)
            else:
                for k in reversed(range(self._middle, j)):
                    column = times_vector(forward[k], column)
            frame.update({(i, j): value for i, value in column.items() if value})
        return frame

    @cached_property
    def _rotation(self) -> SparseMatrix:
        """R = exp(g_m ad_m) ... exp(g_n ad_n), with N M = R."""
        forward = self._factors(1, self._middle, self.group.dim)
        matrix: dict[tuple[int, int], Element] = {}
        for j in range(self.group.dim):
            column: dict[int, Element] = {j: self._ring.ring.one}
            for k in reversed(range(self._middle, self.group.dim)):
                column = times_vector(forward[k], column)
            matrix.update({(i, j): self._ring.reduce(value) for i, value in column.items() if value})
        return matrix

    def _factors(self, sign: int, start: int, stop: int) -> dict[int, SparseMatrix]:
        """exp(sign g_k ad_k) for start <= k < stop."""
        ring = self._ring
        ops = cast(Arithmetic, ring)
        return {
            k: ExponentialEntries(ops, sign * ring.coordinates[k], self.data.adjoint[k], printed=True).sparse()
            for k in range(start, stop)
        }


def wei_norman(group: GroupLike) -> WeiNorman:
    """The exact Wei-Norman equations g' = M(g) u of a group in its basis order, X = exp(g_1 A_1) ... exp(g_n A_n); TR 93-59, (12)-(15).

    M_inverse, determinant and M follow when they are read. The determinant is factored; that it never vanishes does not
    make the coordinates global: see `wei_norman_order`.

    Args:
        group: object, catalogue name or file.

    Raises:
        UnknownGroupError: no such group.
    """
    group = as_group(group, "wei_norman")
    symbols = tuple(sp.Symbol(f"g{k}") for k in range(1, group.dim + 1))
    return WeiNorman(group, symbols, WeiNormanData(group))
