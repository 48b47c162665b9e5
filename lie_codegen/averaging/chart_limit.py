"""Where the theorems' domains D end: eps b beyond the chart.

Theorem 3 asks that zbar(t) = eps^2 t F_2 (and the initial coordinates) stay where M(g) is defined and Phi is one-to-one;
Theorem 4 that exp be one-to-one near Zbar(t). The secular part is linear in time, so one line is to be searched.
"""

from __future__ import annotations

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.averaging.averaged import Averaged
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.groups.matrix_group import MatrixGroup

_SAMPLES = 400


def chart_end(averaged: Averaged, eps: float, horizon: float) -> float | None:
    """The first t in [0, horizon / eps] at which the secular exponent leaves its chart; None if there is none.

    product: det M(g)^{-1} vanishes or changes sign at g = eps^2 t F_2.
    single and order 1: an eigenvalue of hat(t sum eps^q F_q) reaches imaginary part pi, where the logarithm branches.
    floquet of order 2 and more needs no chart.
    """
    if averaged.form == "floquet" and averaged.order > 1:
        return None
    times = np.linspace(0, horizon / eps, _SAMPLES + 1)
    line = times[:, None] * averaged.rate(eps)
    if averaged.form == "product" and averaged.order > 1:
        determinant = inverse_determinant(averaged.group, line)
        outside = determinant * determinant[0] <= 1e-9
    else:
        turns = np.abs(np.linalg.eigvals(averaged.group.hat(line)).imag).max(axis=1)
        outside = turns >= np.pi
    if not outside.any():
        return None
    return float(times[np.argmax(outside)])


def inverse_determinant(group: MatrixGroup, g: Array) -> Array:
    """(k,) det M(g)^{-1}, numerically: column j is exp(-g_n ad_n) ... exp(-g_{j+1} ad_{j+1}) e_j."""
    n = group.dim
    ad = group.algebra.ad_matrices
    columns = np.zeros((len(g), n, n))
    for j in range(n):
        vector = np.broadcast_to(np.eye(n)[j], (len(g), n))
        for k in range(j + 1, n):
            vector = np.einsum("tij,tj->ti", expm(-g[:, k, None, None] * ad[k]), vector)
        columns[:, :, j] = vector
    return np.asarray(np.linalg.det(columns))
