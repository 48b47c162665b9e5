"""exp and log of many small matrices at once, in numpy: scaling, a series, squaring; roots, a series, doubling."""

from __future__ import annotations

from math import factorial
from typing import Any

import numpy as np
from numpy.typing import NDArray

_RADIUS = 0.5
_NEAR = 0.25
_MOST_ROOTS = 40
_ROOT_STEPS = 30


def expm(A: NDArray[Any]) -> NDArray[Any]:
    """(..., d, d) -> (..., d, d); relative error a few ulp times the largest number of squarings.

    Taylor's polynomial of degree 15, of norms up to 1/2 exact to 1e-18, in four blocks of powers up to the third: six products where Horner's
    rule takes fifteen (Paterson and Stockmeyer).
    """
    size = float(np.max(np.sum(np.abs(A), axis=-1), initial=0.0))
    squarings = max(0, int(np.ceil(np.log2(size / _RADIUS)))) if size > _RADIUS else 0
    first = A / 2.0**squarings
    second = first @ first
    powers = (np.eye(A.shape[-1], dtype=A.dtype), first, second, second @ first)
    fourth = second @ second
    result = _block(powers, 12)
    for start in (8, 4, 0):
        result = result @ fourth + _block(powers, start)
    with np.errstate(over="ignore", invalid="ignore"):  # what is too large is infinite or NaN
        for _ in range(squarings):
            result = result @ result
    return np.asarray(result)


def _block(powers: tuple[NDArray[Any], ...], start: int) -> NDArray[Any]:
    """The sum of powers[j] / (start + j)!"""
    one, *others = (power * (1 / factorial(start + j)) for j, power in enumerate(powers))
    return np.asarray(sum(others, one))


def logm(X: NDArray[Any]) -> NDArray[Any]:
    """Principal logarithms, (..., d, d) -> (..., d, d); NaN where an eigenvalue is on the negative real axis.

    Square roots by the product form of Denman and Beavers until |X - I| <= 1/4, then 2 artanh((X - I) / (X + I)).
    """
    identity = np.eye(X.shape[-1])
    root, roots = X, 0
    with np.errstate(all="ignore"):
        while roots < _MOST_ROOTS and np.max(np.sum(np.abs(root - identity), axis=-1), initial=0.0) > _NEAR:
            root, roots = _square_root(root), roots + 1
        if not np.all(np.isfinite(root)):
            return np.full_like(X, np.nan) if X.ndim == 2 else np.array([logm(matrix) for matrix in X])
    ratio = np.linalg.solve(root + identity, root - identity)
    square = ratio @ ratio
    total = np.zeros_like(ratio)
    for k in range(21, 0, -2):
        total = identity / k + square @ total
    return np.asarray(2.0 ** (roots + 1) * (ratio @ total))


def _square_root(X: NDArray[Any]) -> NDArray[Any]:
    identity = np.eye(X.shape[-1])
    m, root = X, X
    for _ in range(_ROOT_STEPS):
        usable = np.all(np.isfinite(m), axis=(-2, -1)) & (np.abs(np.linalg.det(m)) > 1e-300)
        finite = usable[..., None, None]
        inverse = np.linalg.inv(np.where(finite, m, identity))
        root = root @ (identity + inverse) / 2
        m = np.where(finite, identity / 2 + (m + inverse) / 4, np.nan)
        if np.nanmax(np.abs(m - identity), initial=0.0) < 1e-15:
            break
    return np.asarray(np.where(np.all(np.isfinite(m), axis=(-2, -1), keepdims=True), root, np.nan))
