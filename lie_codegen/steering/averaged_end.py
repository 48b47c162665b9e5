"""The averaged endpoint of Fourier controls to any order p, with its derivative.

log X(1) = sum_q Z_q, Z_q homogeneous of degree q in the controls (the Magnus series over one period, q = 1 the mean,
q = 2 the areas, q = 3 the area moments of averaging). From the iterated integrals P_q' = P_{q-1} U, P_0 = I:
    sum_{q<=p} eps^q Z_q = log(I + sum_{q<=p} eps^q P_q(1)) + O(eps^(p+1)),
with P_q by integration of Chebyshev interpolants, exact to rounding for the trigonometric polynomials at hand.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from lie_codegen.steering.fourier import Family

Array = NDArray[Any]


def averaged_end(family: Family, c: Array, order: int) -> tuple[Array, Array]:
    """sum_{q<=p} Z_q, (n,), and its derivative by the coefficients, (n, m (1 + 2 K)).

    For p = 2 the same as `Family.averaged`.
    """
    group = family.group
    t, integral = _nodes(24 + 4 * order * family.harmonics)
    waves = family.waves(t)
    basis = group.basis[list(family.controls)]
    U = np.einsum("ti,iab->tab", family.evaluate(c, t), basis)
    directions = np.einsum("tp,iab->tipab", waves, basis).reshape(len(t), -1, group.degree, group.degree)
    P, dP = _iterated(U, directions, integral, order)
    value, slope = _logarithm(P, dP)
    return group.project(value), group.project(slope).T


@lru_cache(maxsize=16)
def _nodes(count: int) -> tuple[Array, Array]:
    """Chebyshev points of [0, 1] with both ends, and the matrix that integrates from 0 to each."""
    x = -np.cos(np.pi * np.arange(count) / (count - 1))
    integrals = chebyshev.chebint(np.eye(count), lbnd=-1)
    running = chebyshev.chebvander(x, count) @ integrals / 2
    return (x + 1) / 2, np.asarray(running @ np.linalg.inv(chebyshev.chebvander(x, count - 1)))


def _iterated(U: Array, directions: Array, integral: Array, order: int) -> tuple[list[Array], list[Array]]:
    """P_1(1) .. P_p(1), and their derivatives, (D, d, d) each."""
    P: Array = np.broadcast_to(np.eye(U.shape[1], dtype=U.dtype), U.shape)
    dP: Array = np.zeros_like(directions)
    ends, slopes = [], []
    for _ in range(order):
        dP = np.tensordot(integral, dP @ U[:, None] + P[:, None] @ directions, axes=1)
        P = np.tensordot(integral, P @ U, axes=1)
        ends.append(P[-1])
        slopes.append(dP[-1])
    return ends, slopes


def _logarithm(P: list[Array], dP: list[Array]) -> tuple[Array, Array]:
    """sum_q of the coefficients of log(I + sum eps^q P_q) up to q = p, and its derivative."""
    power, dpower = dict(enumerate(P, start=1)), dict(enumerate(dP, start=1))
    first, dfirst = dict(power), dict(dpower)
    value, slope = np.sum(P, axis=0), np.sum(dP, axis=0)
    for k in range(2, len(P) + 1):
        sums: dict[int, Array] = {}
        dsums: dict[int, Array] = {}
        for q in range(k, len(P) + 1):
            pairs = [(a, q - a) for a in range(k - 1, q)]
            sums[q] = np.sum([power[a] @ first[b] for a, b in pairs], axis=0)
            dsums[q] = np.sum([dpower[a] @ first[b] + power[a] @ dfirst[b] for a, b in pairs], axis=0)
        power, dpower = sums, dsums
        sign = (-1.0) ** (k + 1) / k
        value = value + sign * np.sum(list(power.values()), axis=0)
        slope = slope + sign * np.sum(list(dpower.values()), axis=0)
    return value, slope
