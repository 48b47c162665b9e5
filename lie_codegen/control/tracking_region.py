"""Whether a tracking law is proved to converge from a state: phi + |xi_e|_I^2/2 < L (Theorem 4.2, Lemmas 5.2 and 5.3)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.control.certificate_record import loop_state
from lie_codegen.control.claims import check_constant, is_claimed
from lie_codegen.control.error_catalogue import as_error
from lie_codegen.control.error_function import ErrorFunction
from lie_codegen.errors import InputError
from lie_codegen.exact.positive_matrix import attitude_gain, eigenvalues, positive_matrix
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.kernel.saved import Saved


@dataclass(frozen=True, eq=False, repr=False)
class TrackingRegion(Saved):
    """Where a state lies.

    Attributes:
        W: total error energy, phi + <I xi_e, xi_e>/2.
        bound: L of the error function, None where it is not known.
        inside: W < L; None where L is not known. Outside nothing is claimed: such states often converge too.
        reason: one sentence.
    """

    W: float
    bound: float | None
    inside: bool | None
    reason: str


def tracking_region(
    group: GroupLike,
    *,
    inertia: Any,
    error: Any,
    gains: Mapping[str, Any],
    X: ArrayLike,
    xi: ArrayLike,
    X_d: ArrayLike,
    xi_d: ArrayLike,
) -> TrackingRegion:
    """The proved region of attraction at a state; arguments as `tracking_law`, then the state and the reference.

    On SE(n) rows 5 and 6 are quadratic only while |p| and |p_d| stay bounded: they converge, but the exponential
    rate falls with the distance from the origin (phi/|d phi|^2 grows as |p|^2).

    Args:
        group: object, catalogue name or file.
        inertia, error, gains: as in `tracking_law`.
        X, xi: (d, d) and (n,), the configuration and its body velocity.
        X_d, xi_d: (d, d) and (n,), those of the reference.

    Raises:
        InputError: as `tracking_law`; phi is negative somewhere; a constant that was claimed is not valid.
        ShapeError, NotOnGroupError: an element or a velocity that is none.
    """
    group = as_group(group, "tracking_region")
    pair = as_error(group, error, gains)
    metric = np.array(positive_matrix(inertia, group.dim, "inertia").tolist(), dtype=float)
    return _region(pair, loop_state(pair, metric, X, xi, X_d, xi_d).W)


@dataclass(frozen=True, eq=False, repr=False)
class QuadraticConstants(Saved):
    """b_1 >= phi/|d phi|^2 >= b_2 where phi < L - epsilon (A1), norms by the inertia."""

    L: float
    b_1: float
    b_2: float


def attitude_constants(K_p: Any, inertia: Any, epsilon: float) -> QuadraticConstants:
    """The constants of phi = tr(K_p (1 - R))/2 on SO(3).

    With H = tr(K_p) - K_p: (lambda_min(H) - phi) phi <= |d phi|^2 <= lambda_max(H) phi, so b_1 = 1/epsilon and
    b_2 = 1/lambda_max(H) in the plain norm (Lemma A.1 (3), where the printed bounds do not hold), times the largest
    and the smallest principal moment in the norm of the inertia.

    Raises:
        InputError: a gain or inertia that is not positive as it must be, or epsilon outside (0, L).
    """
    K = attitude_gain(K_p, 3, "K_p")
    moments = eigenvalues(positive_matrix(inertia, 3, "inertia"))
    values = eigenvalues(K)
    sums = sorted(float(values[i] + values[j]) for i in range(3) for j in range(i))
    if not 0 < epsilon < sums[0]:
        raise InputError(f"epsilon = {epsilon:g} must lie between 0 and L = {sums[0]:g}")
    return QuadraticConstants(sums[0], float(moments[-1]) / epsilon, float(moments[0]) / sums[-1])


def _region(pair: ErrorFunction, W: float) -> TrackingRegion:
    """W against the constant L, which for a pair of the user's is a claim that its critical points must bear out."""
    if pair.constant is None:
        words = f"no region is known for the error function {pair.name}: lc.certificate looks for its constant L"
        return TrackingRegion(W, None, None, words)
    bound, how = pair.constant, "convergence is proved"
    if is_claimed(pair):
        found = check_constant(pair)
        if found.status not in ("complete", "degenerate", "cut"):
            words = f"L = {bound:.6g} of {pair.name} lies below all critical points found ({found.status}): nothing is proved"
            return TrackingRegion(W, bound, None, words)
        how = f"convergence follows, as L lies below the critical points of phi ({found.status})"
    inside = bound > W
    words = f"W = {W:.6g} is below L = {bound:.6g}: {how}"
    if not inside:
        words = f"W = {W:.6g} is not below L = {bound:.6g}: outside the proved region, nothing is claimed"
    return TrackingRegion(W, bound, inside, words)
