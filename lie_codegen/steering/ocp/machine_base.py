"""What solves a problem, compiled or interpreted, and the workspace that both work in."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.ocp.model_sizes import Sizes
from lie_codegen.steering.ocp.problem_data import ProblemData

#: How a sample ended, as the C says it.
OK, HELD, INPUT = 4, 5, 6
#: Values of `curvature`: Gauss-Newton throughout; exact once a step gains less than 1 %; exact from the first step, near a solution.
GAUSS_NEWTON, EXACT_LATER, EXACT_AT_ONCE = 0, 1, 2


class Machine(ABC):
    """What solves a problem, whichever way.

    Attributes:
        data: the problem.
        sizes: numbers of everything.
        row_names: a name for each row of the conditions, as `worst` counts them.
        compiled: False where numpy stands in for C.
    """

    def __init__(self, data: ProblemData, sizes: Sizes, row_names: tuple[str, ...], *, compiled: bool) -> None:
        self.data = data
        self.sizes = sizes
        self.row_names = row_names
        self.compiled = compiled
        self.dtype = workspace_type(data.intervals, sizes)

    def workspace(self) -> Array:
        """A workspace of zeros, one record."""
        return np.zeros(1, self.dtype)

    @abstractmethod
    def solve(
        self, space: Array, rows: Array, t0: float, tolerance: float, allowed: float, outer: int, most: int
    ) -> None:
        """Solves from what the workspace holds."""

    @abstractmethod
    def gains(self, space: Array, rows: Array, t0: float) -> float:
        """One clean sweep."""

    @abstractmethod
    def first_guess(self, space: Array, rows: Array, t0: float) -> None:
        """Controls that cost least at the first state."""

    @abstractmethod
    def advance(self, x: Array, u: Array, p: Array, t: float, h: float, parts: int) -> Array:
        """The model's motion by h in `parts` steps, states as stored."""

    @abstractmethod
    def running_cost(self, x: Array, u: Array, p: Array, t: float) -> float:
        """l."""

    @abstractmethod
    def plan_cost(self, space: Array, rows: Array, t0: float) -> float:
        """The cost of the plan in a workspace."""

    @abstractmethod
    def step(self, space: Array, X: Array, z: Array, rows: Array, t0: float, iterations: int, u: Array) -> int:
        """One sample."""


def workspace_type(intervals: int, sizes: Sizes) -> np.dtype[Any]:
    """The layout of the C struct."""
    stored, nx, m, N = sizes.packed + sizes.q, sizes.nx, sizes.m, intervals
    numbers: list[Any] = [
        ("x", float, (N + 1, stored)),
        ("u", float, (N, m)),
        ("x_new", float, (N + 1, stored)),
        ("u_new", float, (N, m)),
        ("K", float, (N, m, nx)),
        ("kappa", float, (N, m)),
        ("lambda", float, (N, max(1, sizes.path))),
        ("lambda_end", float, (max(1, sizes.end_path + sizes.end),)),
        ("P", float, (nx, nx)),
        ("v", float, (nx,)),
        ("rho", float),
        ("cost", float),
        ("violation", float),
        ("shift", float),
        ("sample", float),
    ]
    counts = ("worst", "worst_stage", "iterations", "sweeps", "curvature", "fresh", "status", "choose", "stop")
    return np.dtype([*numbers, *[(name, np.intc) for name in counts]], align=True)
