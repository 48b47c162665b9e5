"""Minimum-perturbation frames on any group: X -> X h(r), h = exp(beta(r)), A -> Ad(h^-1) A - h^-1 dh.

With h^-1 dh = rjac(beta) dbeta. In the frame that makes int |A|^2 smallest the body moves least during a gait, and -int int DA comes nearest to log X(T)
(Hatton and Choset, IEEE T-RO 29 (2013), on SE(2); here any group). beta is a polynomial with its constant terms. On a non-abelian group only the
leading part of A can be removed. Closed gaits: X(T) -> h_0^-1 X(T) h_0; DA -> Ad(h^-1) DA.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lie_codegen.algebra.brackets import ad
from lie_codegen.arrays import Array
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.saved import Saved

_NODES, _STEPS, _SETTLED = 7, 12, 1e-10
_COMPLEX_STEP = 1e-30
_SERIES = 24


@dataclass(frozen=True, eq=False, repr=False)
class ShapeFrame(Saved):
    """h(r) = exp(beta(r)).

    Attributes:
        group: whose elements h are.
        centre: (k,) about which beta is a polynomial; width: its unit.
        exponents: (m, k) of the monomials.
        coefficients: (m, n).
        cost_before, cost_after: int |A|^2 over the square, in the frame given and in this one.
    """

    group: MatrixGroup
    centre: Array
    width: float
    exponents: Array
    coefficients: Array
    cost_before: float
    cost_after: float

    def beta(self, r: Array) -> tuple[Array, Array]:
        """beta(r), (..., n), and its slopes d_i beta, (..., k, n)."""
        return polynomial_with_slopes(self.exponents, self.coefficients, (r - self.centre) / self.width, self.width)

    def element(self, r: Array) -> Array:
        """h(r): (..., k) -> (..., d, d)."""
        return expm(np.asarray(self.group.hat(self.beta(r)[0])))

    def moved(self, r: Array, A: Array) -> Array:
        """A of the new frame, (..., n, k)."""
        return moved_by(self.group, *self.beta(r), A)

    def turned(self, r: Array, DA: Array) -> Array:
        """The curvature seen from the new frame, (..., k, k, n)."""
        back = expm(-ad(self.group.algebra, self.beta(r)[0]))
        return np.asarray(np.einsum("...ab,...ijb->...ija", back, DA))


def moved_by(group: MatrixGroup, beta: Array, slopes: Array, A: Array) -> Array:
    """Ad(h^-1) A - rjac(beta) dbeta, (..., n, k); analytic in all its arguments."""
    turn = -ad(group.algebra, beta)
    # rjac(beta) = sum_j (-ad_beta)^j / (j + 1)!
    total = identity = np.broadcast_to(np.eye(group.dim), turn.shape)
    for j in range(_SERIES, 0, -1):
        total = identity + turn @ total / (j + 1)
    return np.asarray(expm(turn) @ A - np.einsum("...ab,...ib->...ai", total, slopes))


def polynomial_with_slopes(exponents: Array, coefficients: Array, x: Array, unit: float) -> tuple[Array, Array]:
    """Values (..., n) and slopes (..., k, n) in r = unit x."""
    powers = x[..., None, :] ** exponents
    values = np.prod(powers, axis=-1) @ coefficients
    slopes = []
    for i in range(exponents.shape[1]):
        lower = exponents.copy()
        lower[:, i] = np.maximum(lower[:, i] - 1, 0)
        slopes.append((np.prod(x[..., None, :] ** lower, axis=-1) * exponents[:, i]) @ coefficients / unit)
    return values, np.stack(slopes, axis=-2)
