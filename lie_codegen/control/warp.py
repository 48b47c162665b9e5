"""The warp of a pair of attitude error functions: its direction, its size, and the gap that it opens."""

from __future__ import annotations

from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.kernel.linear import (
    Matrix,
)
from lie_codegen.on_demand import scipy

#: Two pair sums that differ by less, relative to the largest, give critical circles, on which the gap is zero.
_DISTINCT = 1e-9


def gap_matrix(X: Matrix, X_d: Matrix) -> Matrix:
    """D = X - X_d: phi = tr(K D^T D)/4 of it does not cancel near the reference, as tr(K (1 - X_d^T X))/2 would."""
    return [[a - b for a, b in zip(r, s, strict=True)] for r, s in zip(X, X_d, strict=True)]


def levels(values: Array, u: Array) -> tuple[Array, Array]:
    """A_i and m_i in the eigenbasis."""
    A = np.sum(values) - values
    square = u**2
    m = np.array([A[j] * square[k] + A[k] * square[j] for j, k in ((1, 2), (2, 0), (0, 1))])
    return A, m


def warped_level(kappa: float, A: float, m: float) -> float:
    """x = cos^2(kappa x/2) A + sin^2(kappa x/2) m, between m and A."""

    def off(x: float) -> float:
        c = np.cos(kappa * x / 2) ** 2
        return float(x - c * A - (1 - c) * m)

    low, high = min(A, m), max(A, m)
    return float(scipy.optimize.brentq(off, low - 1e-9, high + 1e-9, xtol=1e-14)) if high > low else A


def warp_of(K: Array, kappa: Any, direction: Any) -> tuple[tuple[float, ...], float, float, tuple[float, ...]]:
    """u in body axes, kappa, kappa_max and the gaps.

    Raises:
        InputError, ShapeError: as `hybrid_law`.
    """
    values, axes = np.linalg.eigh(K)
    sums = np.sum(values) - values
    if np.min(np.abs(np.diff(sums))) <= _DISTINCT * np.max(sums):
        listed = ", ".join(f"{x:.6g}" for x in values)
        raise InputError(
            f"hybrid_law: K_p has the eigenvalues {listed}; two are equal, which gives critical circles and no gap: make them differ"
        )
    if direction is None:
        u = axes @ np.sqrt(_best_square(sums))
    else:
        u = np.asarray(direction, dtype=float)
        if u.shape != (3,) or not np.all(np.isfinite(u)) or not np.any(u):
            raise ShapeError(f"hybrid_law: direction has shape {u.shape}; give three numbers, not all zero")
        u = u / np.linalg.norm(u)
    hat = np.array([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])
    singular = np.linalg.svd(hat @ K, compute_uv=False)
    most = float(2 / (singular[0] + singular[1]))
    warp = 0.9 * most if kappa is None else float(kappa)
    if not 0 < warp < most:
        raise InputError(
            f"hybrid_law: kappa = {warp:g} must lie between 0 and kappa_max = {most:.6g}, where the warp folds"
        )
    A, m = levels(values, axes.T @ u)
    gaps = tuple(float(np.sin(warp * warped_level(warp, a, b)) ** 2 * (a - b)) for a, b in zip(A, m, strict=True))
    if min(gaps) <= 0:
        raise InputError(
            f"hybrid_law: direction = {u.tolist()} leaves no gap (the least is {min(gaps):.6g}); without it the best is taken"
        )
    return tuple(float(x) for x in u), warp, most, gaps


def _best_square(A: Array) -> Array:
    """(u_i^2) that makes the least of A_i - m_i largest: maximise s with A_i - (A_j w_k + A_k w_j) >= s, w >= 0, sum w = 1."""
    rows = np.zeros((3, 4))
    for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
        rows[i, k], rows[i, j], rows[i, 3] = A[j], A[k], 1
    found = scipy.optimize.linprog(
        [0, 0, 0, -1], A_ub=rows, b_ub=A, A_eq=[[1, 1, 1, 0]], b_eq=[1], bounds=[(0, 1)] * 3 + [(None, None)]
    )
    square = np.maximum(found.x[:3], 0)
    return np.asarray(square / np.sum(square))
