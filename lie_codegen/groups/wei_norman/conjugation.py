"""exp(x ad_k) as y -> coordinates of exp(x A_k) hat(y) exp(-x A_k), where the spectrum of ad_k is no numbers to work with.

Eigenvalues of ad_k are differences of those of A_k. In the usual bases both are short; in others A_k may have roots of a cubic, which three
nested radicals write, while the six differences lie in a field of degree 6 or more: SU(3) took minutes, SO(5) and Sp(4) were refused.
"""

from __future__ import annotations

from dataclasses import dataclass

from lie_codegen.exact.exponential import MatrixExponential
from lie_codegen.exact.numbers import domain_matrix
from lie_codegen.groups.matrix_pattern import RealMatrices, reached
from lie_codegen.groups.wei_norman.exponential_entries import ExponentialEntries
from lie_codegen.groups.wei_norman.products import times_matrix
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.block_solve import SparseMatrix
from lie_codegen.kernel.linear import number
from lie_codegen.kernel.structural_zeros import add, product
from lie_codegen.on_demand import sympy as sp

#: Degrees of the irreducible factors of a spectrum, those up to 2 left out: together they may be so large.
_MOST = 4


@dataclass(frozen=True)
class Conjugation:
    """exp(x ad_k) by exp(x A_k).

    Attributes:
        entries: the places (i, j) that are not zero for every x.
        defining: exp(x A_k), real matrices of size m.
    """

    entries: frozenset[tuple[int, int]]
    defining: MatrixExponential

    def is_one(self, place: tuple[int, int]) -> bool:
        """Whether an entry is known to be 1 for every x."""
        return False

    def values(self, ops: Arithmetic, real: RealMatrices, x: Scalar, forward: bool) -> SparseMatrix:
        """exp(x ad_k), or exp(-x ad_k)."""
        backward = self.defining.reflected
        left, right = (self.defining, backward) if forward else (backward, self.defining)
        E, inverse = (ExponentialEntries(ops, x, each).sparse() for each in (left, right))
        result: dict[tuple[int, int], Scalar] = {}
        for j, matrix in enumerate(real.basis):
            A = {place: number(ops, value) for place, value in matrix.todok().items()}
            # Column j: the image of A_j in coordinates.
            image = times_matrix(times_matrix(E, A), inverse)
            for i, row in enumerate(real.coordinates):
                if (i, j) in self.entries:
                    total: Scalar = 0
                    for place, weight in row.items():
                        total = add(total, product(number(ops, weight), image.get(place, 0)))
                    result[i, j] = total
        return result


def places(ad: sp.MatrixBase) -> frozenset[tuple[int, int]]:
    """Where exp(x ad) may be other than zero."""
    return reached({(i, i) for i in range(ad.rows)} | set(ad.todok()))


def is_involved(ad: sp.MatrixBase) -> bool:
    """Whether the spectrum has irreducible factors of high degree over the rationals; of a polynomial with other coefficients, whose factors take long to
    find, whether it has many roots."""
    matrix = domain_matrix(ad.tolist())
    coefficients = [matrix.domain.to_sympy(value) for value in matrix.charpoly()]
    if not all(value.is_Rational for value in coefficients):
        distinct = sp.Poly(coefficients, sp.Symbol("x"), domain=matrix.domain).sqf_part()
        return bool(distinct.degree() > _MOST)
    factors = sp.Poly(coefficients, sp.Symbol("x"), domain="QQ").factor_list()[1]
    return bool(sum(factor.degree() for factor, _ in factors if factor.degree() > 2) > _MOST)
