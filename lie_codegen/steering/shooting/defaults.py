"""Options of the shooting solver, by the size of the problem."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Defaults:
    """Starts and iterations at which the studies found the global minimum for all but a few targets in a thousand.

    Attributes:
        starts: first guesses.
        search_steps: Runge-Kutta steps while searching.
        search_iterations: most iterations a start.
        polish_steps, polish_iterations: the same while polishing.
        search_tolerance: predicted decrease of |X - target|^2 at which a start counts as converged.
        tolerance: |X - target| at which a target counts as solved.
    """

    starts: int
    search_steps: int
    search_iterations: int
    polish_steps: int = 32
    polish_iterations: int = 60
    search_tolerance: float = 1e-7
    tolerance: float = 1e-10

    @staticmethod
    def of(dim: int, depth: int) -> Defaults:
        """More starts where more extremals compete: in higher dimension and for deeper brackets."""
        if dim <= 3 and depth <= 1:
            return Defaults(16, 16, 16)
        if depth <= 1:
            return Defaults(32, 16, 16)
        if depth == 2:
            return Defaults(128, 24, 40, polish_iterations=100)
        return Defaults(512, 32, 40, polish_iterations=100)
