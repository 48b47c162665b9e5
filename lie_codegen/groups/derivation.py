"""What the kernels of a group are made from, derived once, exactly, when first asked for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.on_demand import sympy as sp
from lie_codegen.runtime.records import find_record, store_record

if TYPE_CHECKING:
    from lie_codegen.exact.even_spectrum import EvenSpectrum
    from lie_codegen.exact.invariant_form import Relation
    from lie_codegen.exact.spectral_pattern import ColumnPattern
    from lie_codegen.groups.maps.log_structure import LogStructure
    from lie_codegen.groups.matrix_pattern import RealMatrices
    from lie_codegen.groups.wei_norman.data import WeiNormanData


@dataclass(frozen=True)
class GroupDerivation:
    """Exact data of one group, each derived when it is first asked for, and what derives it imported with it: a group whose kernels are in
    the cache needs none of it.

    Attributes:
        group: the group.
    """

    group: MatrixGroup

    @cached_property
    def real(self) -> RealMatrices:
        """The group as real matrices; a complex X as [[Re X, -Im X], [Im X, Re X]]."""
        from lie_codegen.groups.matrix_pattern import RealMatrices

        return RealMatrices(self.group)

    @cached_property
    def wei_norman(self) -> WeiNormanData:
        """exp(x ad_k) and exp(x A_k) of each basis element."""
        from lie_codegen.groups.wei_norman.data import WeiNormanData

        return WeiNormanData(self.group)

    @cached_property
    def ads(self) -> tuple[sp.Matrix, ...]:
        """(n) exact ad_k."""
        from lie_codegen.algebra.adjoint import ad

        return tuple(ad(self.group.algebra, k) for k in range(self.group.dim))

    @cached_property
    def matrix_pattern(self) -> tuple[ColumnPattern, ...] | None:
        """Annihilating polynomials of hat(x), column by column; None where there are none of the closed kind."""
        from lie_codegen.exact.spectral_pattern import spectral_pattern

        return spectral_pattern(self.real.basis)

    @cached_property
    def closed_exponential(self) -> bool:
        """Whether exp(hat(x)) is a closed formula of x, for there is such a pattern; known from its record where it was asked before."""
        source = self.group.definition_text
        known = find_record("closed exponential", source)
        if known is None:
            known = self.matrix_pattern is not None
            store_record("closed exponential", source, known)
        return bool(known)

    @cached_property
    def adjoint_pattern(self) -> tuple[ColumnPattern, ...] | None:
        """Annihilating polynomials of ad x, column by column."""
        from lie_codegen.exact.spectral_pattern import spectral_pattern

        return spectral_pattern(self.ads)

    @cached_property
    def log_structure(self) -> LogStructure:
        """The blocks the logarithm is read from."""
        from lie_codegen.groups.maps.log_structure import log_structure

        return log_structure(self.group)

    @cached_property
    def section_pattern(self) -> tuple[ColumnPattern, ...] | None:
        """Annihilating polynomials of ad x for the x that the blocks alone determine."""
        from lie_codegen.exact.spectral_pattern import spectral_pattern

        pivots = self.log_structure.pivots
        zero = sp.zeros(self.group.dim, self.group.dim)
        return spectral_pattern([self.ads[i] if i in pivots else zero for i in range(self.group.dim)])

    @cached_property
    def real_block_of(self) -> tuple[int, ...]:
        """For each row of the real form, the number of its diagonal block in the group's own matrices."""
        from lie_codegen.exact.block_structure import diagonal_blocks

        d = self.group.degree
        place = {i: b for b, block in enumerate(diagonal_blocks(self.group.exact_basis)) for i in block}
        return tuple(place[i % d] for i in range(self.real.size))

    @cached_property
    def matrix_spectrum(self) -> EvenSpectrum | None:
        """Where the eigenvalues of hat(x) are +-lambda_i, equally often; None elsewhere and for complex matrices."""
        from lie_codegen.exact.even_spectrum import even_spectrum

        return None if self.group.is_complex else even_spectrum(self.group.exact_basis)

    @cached_property
    def adjoint_spectrum(self) -> EvenSpectrum | None:
        """The same of ad x."""
        from lie_codegen.exact.even_spectrum import even_spectrum

        return even_spectrum(self.ads)

    @cached_property
    def is_unitary(self) -> bool:
        """Whether the matrices of the group are complex and unitary."""
        return self.group.is_complex and all(
            (m + m.H).applyfunc(sp.expand).is_zero_matrix for m in self.group.exact_basis
        )

    @cached_property
    def is_antisymmetric(self) -> bool:
        """Whether the matrices of the algebra are real and antisymmetric."""
        return not self.group.is_complex and all((m + m.T).is_zero_matrix for m in self.group.exact_basis)

    @cached_property
    def adjoint_is_antisymmetric(self) -> bool:
        """The same of ad x."""
        return all((m + m.T).is_zero_matrix for m in self.ads)

    @cached_property
    def matrix_relation(self) -> Relation:
        """Which entries of a function of hat(x) follow from others."""
        from lie_codegen.exact.invariant_form import matrix_relation

        return {} if self.group.is_complex else matrix_relation(self.group.exact_basis)

    @cached_property
    def adjoint_relation(self) -> Relation:
        """Which entries of a function of ad x follow from others: by antisymmetry, else by the Killing form."""
        from lie_codegen.algebra.adjoint import killing_form
        from lie_codegen.exact.invariant_form import entry_relation, matrix_relation

        return matrix_relation(self.ads) or entry_relation(killing_form(self.group.algebra))


@lru_cache(maxsize=64)
def derivation_of(group: MatrixGroup) -> GroupDerivation:
    """The exact data of a group, one for all who ask: what was derived for one kernel is there for the next."""
    return GroupDerivation(group)
