"""Many propagations at once, and a power of one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.kernel.saved import Saved


@dataclass(frozen=True, eq=False, repr=False)
class Power(Saved):
    """X(T)^n.

    Attributes:
        X: (d, d).
        n: the power.
        error_estimate: n times that of one period and of rounding it: M^n cannot be known better than n |dM|.
    """

    X: Array
    n: int
    error_estimate: float

    def __repr__(self) -> str:
        return f"Power(n={self.n}, error_estimate={self.error_estimate:.2g})"


def power_of(X: Array, n: int, error_estimate: float) -> Power:
    """X^n by squaring, in extended precision: what a product rounds is then small beside the error of X itself, n times."""
    wide = np.clongdouble if X.dtype.kind == "c" else np.longdouble
    result, square, left = np.eye(len(X), dtype=wide), X.astype(wide), n
    while left:
        if left & 1:
            result = result @ square
        square = square @ square
        left >>= 1
    found = result.astype(X.dtype)
    growth = max(1.0, float(np.max(np.abs(found))))
    return Power(found, n, n * (error_estimate + 2.2e-16) * growth)


@dataclass(frozen=True, eq=False, repr=False)
class PropagationBatch(Saved):
    """X(T; p) at N values of p.

    Attributes:
        X: (N, d, d).
        error_estimate: of the entries of all.
        steps: of each, the same for all.
    """

    X: Array
    error_estimate: float
    steps: int

    def __repr__(self) -> str:
        return f"PropagationBatch({len(self.X)} members, {self.steps} steps, error_estimate={self.error_estimate:.2g})"
