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
        search_residual: |X - target|^2 above which no start counts as converged.
        polish_share: of tolerance^2, to which polishing brings |X - target|^2: the flow's own error is to stay small beside it.
        most_damping: of Levenberg and Marquardt; a start that wants more has stalled.

    These are the numbers of when shooting stops, in C (`steering_problem.h`) and in numpy alike.
    """

    starts: int
    search_steps: int
    search_iterations: int
    polish_steps: int = 32
    polish_iterations: int = 60
    search_tolerance: float = 1e-7
    tolerance: float = 1e-10
    search_residual: float = 1e-2
    polish_share: float = 0.01
    most_damping: float = 1e4

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
