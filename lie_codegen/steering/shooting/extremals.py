"""Extremals: what shooting returns for a batch of targets."""

from __future__ import annotations

from dataclasses import dataclass

from lie_codegen.arrays import Array
from lie_codegen.kernel.saved import Saved

#: Values of `Extremals.status`, as in the generated header.
NOTHING_FOUND, SOLVED, NOT_CONVERGED = 0, 1, 2


@dataclass(frozen=True, eq=False, repr=False)
class Extremals(Saved):
    """The cheapest extremal found for each of K targets, in unit time.

    Attributes:
        mu0: (K, n) costates at t = 0.
        cost: (K,) int sum_i w_i u_i^2 dt.
        residual: (K,) |X(1) - target|, Frobenius.
        jacobian: (K, n, n) [i, c]: component i of X^-1 dX(1) / d mu0_c, to about 1e-4; singular at
            conjugate points.
        status: (K,) SOLVED, NOT_CONVERGED or NOTHING_FOUND.
        starts, converged: (K,) starts run, and of them near an extremal to the target.
        agreeing: (K,) converged starts within 1 % of the best cost (of the 8 cheapest candidates, which alone are kept).
        linearisations: (K,) Jacobians computed.
    """

    mu0: Array
    cost: Array
    residual: Array
    jacobian: Array
    status: Array
    starts: Array
    converged: Array
    agreeing: Array
    linearisations: Array
