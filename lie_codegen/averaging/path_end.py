"""X(T) of X' = X hat(u(t)): Magnus steps of order six, until the end is settled."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.flow.magnus.exponent import GAUSS, from_gauss, reversed_bracket
from lie_codegen.groups.matrix_group import MatrixGroup

_MOST_STEPS = 2**14


def end_of(group: MatrixGroup, velocity: Any, knots: Array, tolerance: float = 1e-12) -> Array:
    """X(T) of X' = X hat(u(t)) by Magnus steps of order six between the knots, doubled until it is settled."""
    parts = max(8, 32 // (len(knots) - 1))
    before: Array | None = None
    while True:
        ends = np.concatenate([np.linspace(a, b, parts, endpoint=False) for a, b in pairwise(knots)])
        h = np.repeat(np.diff(knots) / parts, parts)
        now = product_of(expm(group.hat(magnus_six(group, velocity, ends, h))))
        if before is not None:
            change, size = np.abs(now - before).max(), max(1.0, float(np.abs(now).max()))
            if change <= tolerance * size or parts * (len(knots) - 1) >= _MOST_STEPS:
                return now
        before, parts = now, 2 * parts


def magnus_six(group: MatrixGroup, velocity: Any, starts: Array, h: Array) -> Array:
    """(N, n) exponents of steps X(t + h) = X(t) exp(Omega), from u at Gauss's three points; signs for X' = X hat(u)."""
    times = starts[:, None] + h[:, None] * GAUSS
    u = h[:, None, None] * velocity(times.ravel()).reshape(len(starts), 3, -1)
    return from_gauss(reversed_bracket(group.algebra), *np.moveaxis(u, 1, 0))


def product_of(steps: Array) -> Array:
    """The product of matrices (N, d, d) in order, by halves."""
    while len(steps) > 1:
        odd = steps[len(steps) // 2 * 2 :]
        steps = np.concatenate([steps[0 : len(steps) // 2 * 2 : 2] @ steps[1::2], odd])
    return np.asarray(steps[0])
