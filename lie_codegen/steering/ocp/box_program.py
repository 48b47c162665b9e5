"""argmin s'Qs/2 + q's over low <= s <= high, by projected Newton steps. Bertsekas, SIAM J. Control Optim. 20 (1982) 221."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.on_demand import scipy

_EPSILON = float(np.finfo(float).eps)


def box_program(Q: Array, q: Array, low: Array, high: Array) -> tuple[Array, Array, Callable[[Array], Array]] | None:
    """The minimum, its free rows, and what solves with their block; None where that is not positive definite."""
    s, before = np.zeros(len(q)), 0.0
    free: Array = np.zeros(len(q), dtype=bool)
    factor: Any = None
    for _ in range(25):
        g = q + Q @ s
        free = ~(((s <= low) & (g > 0)) | ((s >= high) & (g < 0)))
        if not free.any():
            break
        try:
            factor = scipy.linalg.cho_factor(Q[np.ix_(free, free)])
        except (np.linalg.LinAlgError, ValueError):
            return None
        if np.max(np.abs(g[free])) <= 16 * _EPSILON * np.max(np.abs(q)):
            break
        move = np.zeros(len(q))
        move[free] = -scipy.linalg.cho_solve(factor, g[free])
        alpha = 1.0
        while True:
            trial = np.minimum(np.maximum(s + alpha * move, low), high)
            value, promised = float(trial @ (q + Q @ trial / 2)), float(-g @ (trial - s))
            if before - value >= 0.1 * promised or alpha < 1e-3:
                break
            alpha /= 2
        s, before = trial, value
        if promised <= _EPSILON * (1 + abs(before)):
            break

    def solve(b: Array) -> Array:
        return np.asarray(scipy.linalg.cho_solve(factor, b)) if free.any() else b

    return s, free, solve
