"""exp(x ad_k) and exp(x A_k) of the basis elements of a group, which the Wei-Norman equations are written with."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from lie_codegen.groups.matrix_group import MatrixGroup

if TYPE_CHECKING:
    from lie_codegen.exact.exponential import MatrixExponential
    from lie_codegen.groups.matrix_pattern import RealMatrices
    from lie_codegen.groups.wei_norman.conjugation import Conjugation
    from lie_codegen.groups.wei_norman.frames import Step


@dataclass(frozen=True)
class WeiNormanData:
    """exp(x ad_k) and exp(x A_k) of every basis element, derived once a group, and what derives it imported with it, as by `GroupDerivation`."""

    group: MatrixGroup

    @cached_property
    def adjoint(self) -> tuple[MatrixExponential, ...]:
        """exp(x ad_{A_k}) for each k."""
        from lie_codegen.algebra.adjoint import ad
        from lie_codegen.exact.exponential import matrix_exponential

        return tuple(matrix_exponential(ad(self.group.algebra, k)) for k in range(self.group.dim))

    @cached_property
    def turns(self) -> tuple[MatrixExponential | Conjugation, ...]:
        """exp(x ad_{A_k}) for each k, as kernels compute it."""
        return tuple(self._turn(k) for k in range(self.group.dim))

    def _turn(self, k: int) -> MatrixExponential | Conjugation:
        from lie_codegen.algebra.adjoint import ad
        from lie_codegen.exact.exponential import matrix_exponential
        from lie_codegen.groups.wei_norman.conjugation import Conjugation, is_involved, places

        matrix = ad(self.group.algebra, k)
        return Conjugation(places(matrix), self.defining[k]) if is_involved(matrix) else matrix_exponential(matrix)

    @cached_property
    def real(self) -> RealMatrices:
        """The group as real matrices."""
        from lie_codegen.groups.matrix_pattern import RealMatrices

        return RealMatrices(self.group)

    @cached_property
    def steps(self) -> tuple[Step, ...]:
        """How M(g)^{-1} g' = u is solved."""
        from lie_codegen.groups.wei_norman.frames import cheapest_steps

        return cheapest_steps(self.turns)

    @cached_property
    def defining(self) -> tuple[MatrixExponential, ...]:
        """exp(x A_k) for each k; a complex A_k in its real form [[Re, -Im], [Im, Re]]."""
        from lie_codegen.exact.exponential import matrix_exponential

        return tuple(matrix_exponential(matrix) for matrix in self.real.basis)
