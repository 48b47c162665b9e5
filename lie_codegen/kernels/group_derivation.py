"""What the kernels of a group are made from, derived once, exactly, when first asked for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import sympy as sp

from lie_codegen.algebra.adjoint import ad
from lie_codegen.algebra.spectral_pattern import ColumnPattern, spectral_pattern
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.matrix_pattern import RealMatrices
from lie_codegen.kernels.wei_norman_body import WeiNormanData


@dataclass(frozen=True)
class GroupDerivation:
    """Exact data of one group.

    Attributes:
        group: the group.
    """

    group: MatrixGroup

    @cached_property
    def real(self) -> RealMatrices:
        """The group as real matrices; a complex X as [[Re X, -Im X], [Im X, Re X]]."""
        return RealMatrices(self.group)

    @cached_property
    def wei_norman(self) -> WeiNormanData:
        """exp(x ad_k) and exp(x A_k) of each basis element."""
        return WeiNormanData(self.group)

    @cached_property
    def ads(self) -> tuple[sp.Matrix, ...]:
        """(n) exact ad_k."""
        return tuple(ad(self.group.algebra, k) for k in range(self.group.dim))

    @cached_property
    def matrix_pattern(self) -> tuple[ColumnPattern, ...] | None:
        """Annihilating polynomials of hat(x), column by column; None where there are none of the closed kind."""
        return spectral_pattern(self.real.basis)

    @cached_property
    def adjoint_pattern(self) -> tuple[ColumnPattern, ...] | None:
        """Annihilating polynomials of ad x, column by column."""
        return spectral_pattern(self.ads)
