"""The Cartan involution of a semisimple algebra, from its brackets alone: the same whatever the representation.

With a_i = ad e_i and the Killing form K, the metrics G(x, y) = -K(x, theta y) are the fixed points of

    G_ij <- tr(G^-1 a_i^T G a_j),        theta = -K^-1 G,

since a_x* = -a_(theta x) in such a metric. The iteration converges quadratically from G = 1 wherever it was tried; that is
measured, not proved, so that every result is checked: theta is an involution and an automorphism, and -K(x, theta y) is
positive. Where the limit is rational the three are checked exactly. Knapp, Lie Groups Beyond an Introduction, VI.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.algebra.structure import structure
from lie_codegen.algebra.subspace import annihilated, brackets, contains, span, unit
from lie_codegen.arrays import Array
from lie_codegen.errors import AlgebraError
from lie_codegen.exact.numbers import domain_matrix, is_positive_definite, to_numbers
from lie_codegen.on_demand import sympy as sp

_STEPS = 40
#: Relative residual of the checks beyond which a numeric result is refused; generic bases of condition 10^3 end at 1e-9.
_CHECKED = 1e-7
_LARGEST_DENOMINATOR = 10**4


@dataclass(frozen=True)
class Involution:
    """theta on the basis of a semisimple algebra.

    Attributes:
        numeric: (n, n) doubles, column j holds theta(e_j).
        exact: the same as exact numbers, proved; None where the limit is not rational.
    """

    numeric: tuple[tuple[float, ...], ...]
    exact: sp.ImmutableMatrix | None

    @property
    def compact(self) -> int:
        """The dimension of the maximal compact subalgebra k, (n + tr theta) / 2."""
        trace = sum(row[i] for i, row in enumerate(self.numeric))
        return round((len(self.numeric) + trace) / 2)


def cartan_involution_of(algebra: LieAlgebra) -> Involution:
    """A Cartan involution of a semisimple algebra.

    Raises:
        AlgebraError: the algebra is not semisimple, or the iteration ends at no involution.
    """
    parts = structure(algebra)
    killing = parts.killing
    if not parts.semisimple:
        raise AlgebraError(
            f"{algebra.name}: a Cartan involution belongs to a semisimple algebra; the Killing form is singular"
        )
    ads = algebra.ad_matrices
    K = np.array([[float(entry) for entry in row] for row in killing.tolist()])
    G = _limit(ads)
    theta = -np.linalg.solve(K, G)
    off = _defect(ads, K, theta)
    if not off <= _CHECKED:
        raise AlgebraError(f"{algebra.name}: no Cartan involution found; the candidate is off by {off:.3g}")
    numeric = tuple(tuple(float(entry) for entry in row) for row in theta)
    return Involution(numeric, _proved(algebra, killing, theta))


def _limit(ads: Array) -> Array:
    """The metric where the iteration stops to move, in the given basis."""
    n = len(ads)
    root = np.eye(n)  # columns: a basis orthonormal in the present metric
    last = np.inf
    for _ in range(_STEPS):
        # In an orthonormal basis the formula is tr(a_i^T a_j), which loses the least digits.
        back = np.linalg.inv(root)
        own = np.einsum("ia,ipq->apq", root, np.einsum("pr,irs,sq->ipq", back, ads, root, optimize=True), optimize=True)
        G = np.einsum("ipq,jpq->ij", own, own)
        change = float(np.max(np.abs(G / np.trace(G) * n - np.eye(n))))
        shape = np.linalg.cholesky((G + G.T) / 2)
        root = root @ np.linalg.inv(shape).T
        if change >= last and change < 1e-6:
            break
        last = change
    back = np.linalg.inv(root)
    own = np.einsum("ia,ipq->apq", root, np.einsum("pr,irs,sq->ipq", back, ads, root, optimize=True), optimize=True)
    G = np.einsum("ipq,jpq->ij", own, own)
    return np.asarray(back.T @ G @ back)


def _defect(ads: Array, K: Array, theta: Array) -> float:
    """How far theta is from an involution, an automorphism and a positive metric, relative."""
    n = len(K)
    involution = float(np.max(np.abs(theta @ theta - np.eye(n)))) / max(1.0, float(np.max(np.abs(theta))) ** 2)
    images = np.einsum("ka,kpq->apq", theta, ads)
    changed = np.einsum("pr,irs->ips", theta, ads) - np.einsum("ipq,qs->ips", images, theta)
    automorphism = float(np.max(np.abs(changed))) / max(1.0, float(np.max(np.abs(theta)) ** 2 * np.max(np.abs(ads))))
    metric = -K @ theta
    positive = float(np.linalg.eigvalsh((metric + metric.T) / 2)[0])
    return max(involution, automorphism) if positive > 0 else np.inf


def _proved(algebra: LieAlgebra, killing: sp.ImmutableMatrix, theta: Array) -> sp.ImmutableMatrix | None:
    """The rational matrix near theta, if it is a Cartan involution exactly."""
    if any(not value.is_Rational for *_, value in algebra.constants()):
        return None
    n = algebra.dim
    snapped = [[Fraction(float(entry)).limit_denominator(_LARGEST_DENOMINATOR) for entry in row] for row in theta]
    rows = [[sp.Rational(entry.numerator, entry.denominator) for entry in row] for row in snapped]
    exact = domain_matrix(rows)
    if to_numbers(exact * exact) != sp.eye(n).tolist():
        return None
    columns = [{k: rows[k][j] for k in range(n) if rows[k][j] != 0} for j in range(n)]
    for i in range(n):
        for j in range(i):
            mapped: dict[int, sp.Expr] = {}
            for k, value in algebra.bracket({i: sp.S.One}, {j: sp.S.One}).items():
                for m, entry in columns[k].items():
                    mapped[m] = mapped.get(m, sp.S.Zero) + value * entry
            direct = algebra.bracket(columns[i], columns[j])
            if {m: v for m, v in mapped.items() if v != 0} != {m: v for m, v in direct.items() if v != 0}:
                return None
    metric = -sp.Matrix(killing) * sp.Matrix(rows)
    return (
        sp.ImmutableMatrix(rows)
        if metric.is_symmetric() and is_positive_definite(domain_matrix(metric.tolist()))
        else None
    )


def is_maximal_compact(algebra: LieAlgebra, part: Sequence[int]) -> bool:
    """Whether some basis elements span the fixed points k of a Cartan involution of a semisimple algebra; exact.

    Then p is the complement of k for the Killing form K, and the involution, +1 on k and -1 on p, is an automorphism if
    [k, k] and [p, p] lie in k ([k, p] lies in p as K is invariant), and Cartan's if K is negative on k and positive on p.
    """
    parts = structure(algebra)
    if not parts.semisimple:
        return False
    killing = sp.Matrix(parts.killing)
    k = span(unit(algebra, i) for i in part)
    p = annihilated([list(killing.row(i)) for i in part], algebra.dim)
    if len(k) + len(p) != algebra.dim:
        return False
    if not contains(k, brackets(algebra, k, k)) or not contains(k, brackets(algebra, p, p)):
        return False
    return all(
        is_positive_definite(domain_matrix((sign * rows * killing * rows.T).tolist()))
        for sign, rows in ((-1, sp.Matrix(k)), (1, sp.Matrix(p)))
        if rows.rows
    )
