"""Sufficient conditions for the Magnus series (38) to converge, reported as what they are.

    (39), (40): int_0^t |Lambda(eps u)| < ln 2,  Lambda_ij(v) = sum_k v_k Gamma_kj^i, the matrix of ad_v;
    (41): the same with |eps U|, for SO(3), where Lambda(v) = hat(v);
    (42): int_0^t |eps U| < bhat / M with |[A, B]| <= M |A| |B|; the paper gives no number for bhat, so only the left side
        is reported;
    a later and larger limit for matrices, int_0^t |eps U| < pi in the spectral norm (Moan and Niesen; Casas).

None is necessary: the manoeuvre of section 5.2 has int |eps u| = 2.94 > ln 2 and its series converges.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

from lie_codegen.algebra.brackets import ad
from lie_codegen.errors import InputError
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.kernel.saved import Saved
from lie_codegen.signals.periodic_reader import PeriodicLike, as_periodic

_PANELS = 64


@dataclass(frozen=True, eq=False, repr=False)
class Convergence(Saved):
    """The norms whose integrals the conditions bound, and how long each condition holds.

    Attributes:
        eps: amplitude.
        adjoint_rate: (1/T) int_0^T |ad_{eps u}|_2, (39)-(40). [1 / time unit]
        matrix_rate: (1/T) int_0^T |eps U|_2, (41)-(42).
        until_39: the conditions (39)-(40) hold for t below about this (whole periods counted by their mean).
        until_41: the same for (41); None unless ad and hat have the same norms, as on SO(3).
        until_pi: the spectral-norm condition with pi holds below this.
        statement: one sentence.
    """

    eps: float
    adjoint_rate: float
    matrix_rate: float
    until_39: float
    until_41: float | None
    until_pi: float
    statement: str


def convergence(group: GroupLike, u: PeriodicLike, eps: float) -> Convergence:
    """The convergence conditions of the Magnus series of X' = eps X hat(u).

    Args:
        group: object, catalogue name or file.
        u: n components, over one period, or a list of their formulas.
        eps: the small parameter, positive.

    Raises:
        InputError: eps is not positive and finite; u is no `PeriodicInput`, nor formulas of one.
    """
    group, u = as_group(group, "convergence"), as_periodic(u, "convergence")
    if not 0 < eps < np.inf:
        raise InputError(f"convergence: eps must be positive, got {eps}")
    x, w = leggauss(8)
    edges = np.unique(np.concatenate([np.linspace(0, u.T, _PANELS + 1), u.breakpoints]))
    halves = np.diff(edges) / 2
    times = edges[:-1, None] + halves[:, None] * (x + 1)
    values = u(times)
    ad_norm = _norms(ad(group.algebra, values))
    norm = _norms(group.hat(values))
    adjoint, matrix = (eps * float(np.einsum("p,m,pm->", halves, w, v)) / u.T for v in (ad_norm, norm))
    same = bool(np.allclose(ad_norm, norm, rtol=1e-12, atol=1e-14))
    until_39, until_pi = _until(np.log(2), adjoint), _until(np.pi, matrix)
    statement = (
        f"the series converges at least for t < {max(until_39, until_pi):.4g} (sufficient: int |ad| < ln 2 gives t < "
        f"{until_39:.4g}, int |eps U| < pi gives t < {until_pi:.4g}); beyond, nothing is claimed"
    )
    return Convergence(eps, adjoint, matrix, until_39, until_39 if same else None, until_pi, statement)


def _norms(matrices: NDArray[Any]) -> NDArray[np.float64]:
    return np.asarray(np.linalg.norm(matrices, ord=2, axis=(-2, -1)))


def _until(limit: float, rate: float) -> float:
    return float(limit / rate) if rate > 0 else float("inf")
