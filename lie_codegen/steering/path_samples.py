"""A path as a guess: elements at equal times, or with their times, and the velocities between them."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import ShapeError
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.flow.logarithm import matrix_log
from lie_codegen.groups.matrix_group import MatrixGroup


def path_of(group: MatrixGroup, guess: Any, where: str) -> Array | None:
    """(k, d, d) elements at equal times of a guess that is such a path, or a pair of elements (k, d, d) and increasing times (k,);
    None where the guess is something else.

    Raises:
        ShapeError: times that do not increase, or are not as many as the elements.
    """
    shape = (group.degree, group.degree)
    timed = isinstance(guess, tuple) and len(guess) == 2 and np.ndim(guess[1]) == 1 and np.shape(guess[0])[1:] == shape
    if not timed:
        try:
            samples = np.asarray(guess)
        except ValueError:
            return None
        return samples if samples.ndim == 3 and samples.shape[1:] == shape and len(samples) > 1 else None
    X, t = np.asarray(guess[0]), np.asarray(guess[1], dtype=float)
    if len(t) != len(X) or len(t) < 2 or not np.all(np.diff(t) > 0):
        raise ShapeError(f"{where}: a path with times is (k, d, d) elements and k increasing times, k at least 2")
    equal = np.linspace(t[0], t[-1], len(t))
    piece = np.clip(np.searchsorted(t, equal, side="right") - 1, 0, len(t) - 2)
    share = (equal - t[piece]) / np.diff(t)[piece]
    steps = np.array([matrix_log(group, np.linalg.solve(a, b))[0] for a, b in pairwise(X)])
    return np.asarray(X[piece] @ expm(group.hat(share[:, None] * steps[piece])))


def path_velocities(group: MatrixGroup, X: Array, h: float, *, right: bool = False) -> Array:
    """(k - 1, n) velocities between neighbours: log(X_k^-1 X_(k+1)) / h, or log(X_(k+1) X_k^-1) / h of X' = hat(a) X."""
    steps = [b @ np.linalg.inv(a) if right else np.linalg.solve(a, b) for a, b in pairwise(X)]
    return np.array([matrix_log(group, step)[0] for step in steps]) / h
