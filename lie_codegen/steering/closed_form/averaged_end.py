"""The averaged endpoint of Fourier controls to any order p, with its derivative.

log X(1) = sum_q Z_q, Z_q homogeneous of degree q in the controls (the Magnus series over one period, q = 1 the mean,
q = 2 the areas, q = 3 the area moments of averaging). From the iterated integrals P_q' = P_{q-1} U, P_0 = I:
    sum_{q<=p} eps^q Z_q = log(I + sum_{q<=p} eps^q P_q(1)) + O(eps^(p+1)),
with P_q by integration of Chebyshev interpolants, exact to rounding for the trigonometric polynomials at hand. To order 3, areas
and area moments, the sum is a cubic polynomial of the coefficients, whose forms are computed once a family.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import permutations

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.closed_form.fourier import Family

#: Orders up to which the averaged endpoint is a tabulated polynomial.
TABULATED = 3


def averaged_end(family: Family, c: Array, order: int) -> tuple[Array, Array]:
    """sum_{q<=p} Z_q, (n,), and its derivative by the coefficients, (n, m (1 + 2 K)).

    For p = 2 the same as `Family.averaged`.
    """
    if order <= TABULATED:
        return _by_forms(_forms(family.group, family.controls, family.harmonics)[:order], c)
    group = family.group
    t, integral = _nodes(24 + 4 * order * family.harmonics)
    waves = family.waves(t)
    basis = group.basis[list(family.controls)]
    U = np.einsum("ti,iab->tab", family.evaluate(c, t), basis)
    directions = np.einsum("tp,iab->tipab", waves, basis).reshape(len(t), -1, group.degree, group.degree)
    P, dP = _iterated(U, directions, integral, order)
    value, slope = _logarithm(P, dP)
    return group.project(value), group.project(slope).T


def _by_forms(forms: tuple[Array, ...], c: Array) -> tuple[Array, Array]:
    """sum_q F_q(c, ..., c) of symmetric forms, and its derivative q F_q(c, ..., c, .)."""
    value, slope = np.zeros(len(forms[0])), np.zeros((len(forms[0]), len(c)))
    for degree, form in enumerate(forms, start=1):
        row = form
        for _ in range(degree - 1):
            row = row @ c
        value += row @ c
        slope += degree * row
    return value, slope


@lru_cache(maxsize=8)
def _forms(group: MatrixGroup, controls: tuple[int, ...], harmonics: int) -> tuple[Array, Array, Array]:
    """(n, D), (n, D, D), (n, D, D, D): Z_1, Z_2, Z_3 as symmetric forms of the coefficients.

    Z_1 = P_1,  Z_2 = P_2 - P_1^2 / 2,  Z_3 = P_3 - (P_1 P_2 + P_2 P_1) / 2 + P_1^3 / 3, where P_q is multilinear: products of basis
    matrices times the iterated integrals of the waves.
    """
    family = Family(group, controls, harmonics)
    t, integral = _nodes(24 + 4 * TABULATED * harmonics)
    waves = family.waves(t)
    once = integral @ waves
    twice = np.tensordot(integral, once[:, :, None] * waves[:, None, :], axes=1)
    thrice = integral[-1] @ (twice[:, :, :, None] * waves[:, None, None, :]).reshape(len(t), -1)
    size = waves.shape[1]
    I1, I2, I3 = once[-1], twice[-1], thrice.reshape(size, size, size)
    second = I2 - np.multiply.outer(I1, I1) / 2
    third = I3 - (np.multiply.outer(I1, I2) + np.multiply.outer(I2, I1)) / 2
    third = third + np.multiply.outer(np.multiply.outer(I1, I1), I1) / 3
    A = group.basis[list(controls)]
    AA = np.einsum("iab,jbc->ijac", A, A)
    AAA = np.einsum("ijab,kbc->ijkac", AA, A)
    D = len(controls) * size
    # Z_2 and Z_3 lie in the algebra, single products do not; projecting is linear, so that it may be done product by product.
    quadratic = np.einsum("ijn,pq->nipjq", group.project(AA), second).reshape(-1, D, D)
    cubic = np.einsum("ijkn,pqr->nipjqkr", group.project(AAA), third).reshape(-1, D, D, D)
    linear = np.einsum("in,p->nip", np.eye(group.dim)[list(controls)], I1).reshape(-1, D)
    orders = [(0, *(1 + k for k in order)) for order in permutations(range(3))]
    symmetric = np.sum([cubic.transpose(order) for order in orders], axis=0) / len(orders)
    return linear, (quadratic + quadratic.swapaxes(1, 2)) / 2, np.asarray(symmetric)


@lru_cache(maxsize=16)
def _nodes(count: int) -> tuple[Array, Array]:
    """Chebyshev points of [0, 1] with both ends, and the matrix that integrates from 0 to each."""
    x = -np.cos(np.pi * np.arange(count) / (count - 1))
    integrals = np.polynomial.chebyshev.chebint(np.eye(count), lbnd=-1)
    running = np.polynomial.chebyshev.chebvander(x, count) @ integrals / 2
    return (x + 1) / 2, np.asarray(running @ np.linalg.inv(np.polynomial.chebyshev.chebvander(x, count - 1)))


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
