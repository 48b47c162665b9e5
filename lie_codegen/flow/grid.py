"""The time grid of a simulation: output times and breakpoints, each span divided evenly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError
from lie_codegen.flow.inputs import Signal
from lie_codegen.runtime.drive_arguments import Spans


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
        # A breakpoint beside an output time stays a knot, however short the span between: without it the jump would lie within a step.
        knots = np.unique(np.concatenate([times, inside]))
        parts = max(1, -(-32 // (len(knots) - 1)))
        return Grid(knots, parts, np.searchsorted(knots, times))

    @property
    def steps(self) -> int:
        """Number of steps."""
        return (len(self.knots) - 1) * self.parts

    @property
    def spans(self) -> Spans:
        """As the loops take it."""
        return Spans(len(self.knots) - 1, self.parts, self.knots)

    @property
    def largest_step(self) -> float:
        """The longest step."""
        return float(np.max(np.diff(self.knots))) / self.parts

    @property
    def outputs(self) -> NDArray[np.int64]:
        """Positions of the output times among the steps."""
        return self.at * self.parts


def refine(grid: Grid, most: int, name: str, factor: int = 2) -> Grid:
    """The grid with its steps divided by `factor`.

    Raises:
        ComputationError: beyond `most` steps.
    """
    finer = Grid(grid.knots, factor * grid.parts, grid.at)
    if finer.steps > most:
        raise ComputationError(
            f"simulate({name}): {grid.steps} steps do not reach the tolerance, and {finer.steps} are more than the {most} "
            "that are taken; loosen `tolerance`, shorten t, or name the times at which u is not smooth in an attribute "
            "`breakpoints` of u"
        )
    return finer


def sample(signal: Signal, grid: Grid, first: int, last: int) -> tuple[Array, Array, Array, Array]:
    """u at the start, the middle and the end of steps first .. last - 1, (steps, n) each, and the lengths of the steps.

    At a breakpoint u is read from inside the step, a hair (1e-13 of the step) away from the jump.
    """
    a, h = grid.spans.steps(first, last)
    if len(signal.breakpoints):
        hair = 1e-13 * h + 4 * np.spacing(np.maximum(np.abs(a), np.abs(a + h)))
        return signal(a + hair), signal(a + h / 2), signal(a + h - hair), h
    return signal(a), signal(a + h / 2), signal(a + h), h
