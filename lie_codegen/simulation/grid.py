"""The time grid of a simulation: output times and breakpoints, each span divided evenly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lie_codegen.errors import ComputationError
from lie_codegen.simulation.inputs import Signal

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Grid:
    """Spans between knots, each divided into `parts` equal steps.

    Attributes:
        knots: (s + 1,) output times and breakpoints, increasing.
        parts: steps in each span.
        at: positions of the output times among the knots.
    """

    knots: Array
    parts: int
    at: NDArray[np.int64]

    @staticmethod
    def coarse(times: Array, breakpoints: Array) -> Grid:
        """One step a span, and at least 32 in all."""
        inside = breakpoints[(breakpoints > times[0]) & (breakpoints < times[-1])]
        knots = np.unique(np.concatenate([times, inside]))
        smallest = 1e-13 * (times[-1] - times[0])
        keep = np.concatenate([[True], np.diff(knots) > smallest]) | np.isin(knots, times)
        knots = knots[keep]
        parts = max(1, -(-32 // (len(knots) - 1)))
        return Grid(knots, parts, np.searchsorted(knots, times))

    @property
    def steps(self) -> int:
        """Number of steps."""
        return (len(self.knots) - 1) * self.parts

    @property
    def h(self) -> Array:
        """(steps,) step lengths."""
        return np.repeat(np.diff(self.knots) / self.parts, self.parts)

    @property
    def outputs(self) -> NDArray[np.int64]:
        """Positions of the output times among the steps."""
        return self.at * self.parts

    def starts(self) -> Array:
        """(steps,) left ends."""
        fractions = np.arange(self.parts) / self.parts
        return (self.knots[:-1, None] + np.diff(self.knots)[:, None] * fractions).ravel()

    def largest_move(self, samples: tuple[Array, Array, Array]) -> float:
        """max |h u| over the grid, Euclidean in the basis."""
        h = self.h
        return float(max(np.max(h * np.linalg.norm(values, axis=1), initial=0.0) for values in samples))


def refine(grid: Grid, most: int, name: str) -> Grid:
    """The grid with its steps halved.

    Raises:
        ComputationError: beyond `most` steps.
    """
    finer = Grid(grid.knots, 2 * grid.parts, grid.at)
    if finer.steps > most:
        raise ComputationError(
            f"simulate({name}): {most} steps do not reach the tolerance; loosen `tolerance`, shorten t, or name the "
            "times at which u is not smooth in an attribute `breakpoints` of u"
        )
    return finer


def sample(signal: Signal, grid: Grid, eps: float) -> tuple[Array, Array, Array]:
    """eps u at the start, the middle and the end of each step, (steps, n) each.

    At a breakpoint u is read from inside the step, a hair (1e-13 of the step) away from the jump.
    """
    a = grid.starts()
    h = grid.h
    if len(signal.breakpoints):
        hair = 1e-13 * h + 4 * np.spacing(np.maximum(np.abs(a), np.abs(a + h)))
        return eps * signal(a + hair), eps * signal(a + h / 2), eps * signal(a + h - hair)
    return eps * signal(a), eps * signal(a + h / 2), eps * signal(a + h)
