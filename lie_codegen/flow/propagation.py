"""Many propagations at once, and a power of one."""

from __future__ import annotations

from dataclasses import dataclass

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
