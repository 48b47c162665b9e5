"""Covariances on any group from its structure constants: to second and fourth order, and along a noisy flow.

An uncertain element is X exp(hat xi), xi ~ (0, S): the body side. With S1' = Ad_{X2}^-1 S1 Ad_{X2}^-T,

    second order    S = S1' + S2
    fourth order    S = S1' + S2 + B/4 + (A1 S2 + S2 A1^T + A2 S1' + S1' A2^T) / 12,
                    B = sum_jk S1'_jk ad_j S2 ad_k^T,  A1 = sum_jk S1'_jk ad_j ad_k,  A2 = sum_jk S2_jk ad_j ad_k,
                    mean of xi: -1/24 sum_lm S2_lm ad_l A1 e_m

as the Baker-Campbell-Hausdorff series to fourth order gives for independent Gaussians. A1 is of S1', not of S1: from S1
the order drops to two. Barfoot and Furgale, IEEE Trans. Robotics 30 (2014) 679, perturb on the left, where Ad moves to
the other factor. Along X' = X hat(u + w), w white of density Q: S' = -ad_u S - S ad_u^T + Q.
"""

from __future__ import annotations

import math

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.on_demand import scipy

#: The largest |ad_u| T: an angle of this size is known to 1e-4.
LONGEST = 1e12


def compounded(ads: Array, first: Array, second: Array, order: int) -> tuple[Array, Array]:
    """(covariance, mean of xi) of exp(a) exp(b), a ~ (0, first), b ~ (0, second), to order 2 or 4 in the deviations."""
    shift = np.zeros(len(first))
    total = first + second
    if order == 2:
        return total, shift
    a1, a2 = (np.einsum("jk,jab,kbc->ac", s, ads, ads, optimize=True) for s in (first, second))
    b = np.einsum("jk,jab,bc,kdc->ad", first, ads, second, ads, optimize=True)
    mixed = a1 @ second + a2 @ first
    shift = -np.einsum("lm,lab,bm->a", second, ads, a1, optimize=True) / 24
    return total + b / 4 + (mixed + mixed.T) / 12, shift


def transported(adjoint: Array, covariance: Array) -> Array:
    """Ad S Ad^T, symmetric to the last bit."""
    moved = adjoint @ covariance @ adjoint.T
    return np.asarray((moved + moved.T) / 2)


def flowed(ads: Array, u: Array, duration: float, covariance: Array, noise: Array) -> Array:
    """The covariance after `duration` at the body velocity u: F S F^T + int_0^T e^{-s ad_u} Q e^{-s ad_u^T} ds.

    Both parts come from one exponential, Van Loan's: exp([[ad_u, Q], [0, -ad_u^T]] T) holds the integral beside F^-1.
    It squares the conditioning of F, so long times are cut into pieces over which F stays moderate; pieces are put together two by two.

    Raises:
        InputError: so long a motion that rounding leaves nothing of it.
    """
    n = len(u)
    ad_u = np.einsum("k,kab->ab", u, ads)
    amount = float(np.linalg.norm(ad_u, 1)) * duration
    if not amount <= LONGEST:
        raise InputError(
            f"Uncertain.flow: |ad_u| T = {amount:g} is beyond {LONGEST:g}, from where rounding leaves nothing of the motion; give a smaller u or duration"
        )
    doublings = max(0, math.ceil(math.log2(amount))) if amount > 0 else 0
    h = duration / 2**doublings
    block = scipy.linalg.expm(h * np.block([[ad_u, noise], [np.zeros((n, n)), -ad_u.T]]))
    step = block[n:, n:].T  # exp(-h ad_u)
    added = step @ block[:n, n:]
    for _ in range(doublings):
        added = step @ added @ step.T + added
        step = step @ step
    covariance = step @ covariance @ step.T + added
    return np.asarray((covariance + covariance.T) / 2)
