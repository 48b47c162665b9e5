"""Trajectory: what `lc.simulate` returns; plain data, from which other times, coordinates and charts follow."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.flow.events import EventHits
from lie_codegen.flow.inputs import drive_signal
from lie_codegen.flow.magnus.drive import Drive
from lie_codegen.flow.magnus.norms import norms_of
from lie_codegen.flow.magnus.run import MOST_STEPS, flow, magnus_run
from lie_codegen.flow.magnus.steps import plan_steps
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.saved import Saved

if TYPE_CHECKING:
    from lie_codegen.flow.chart import Samples
    from lie_codegen.flow.grid import Grid
    from lie_codegen.flow.restarts import Chart

_WHOLE = np.array([0.0, 0.5, 1.0])


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(Saved):
    """A solution of X' = X hat(eps u).

    Attributes:
        t: (k,) times.
        X: (k, d, d) group elements, on the group to rounding; (k, N, d, d) of N trajectories.
        steps: number of integration steps taken.
        error_estimate: of the entries of X: from the runs with longer steps, and what reading u left out; NaN for a number
            of steps that was given.
        method: "magnus8", "magnus6", "magnus4", "rkmk4" or "commutator_free".
        evaluations: how many values of a function u were read; 0 for a formula, which compiled loops evaluate themselves.
        resolution: the longest gap between two of them: what is shorter may have been missed; 0 for a formula, of which
            nothing can be missed.
        events: what was found of each event, in their order.
        drive: u as it was integrated, plain data.
        rtol: the tolerance, relative to max(1, |X|).
        multiple: how many times the coarsest steps were divided; 0 for a number of steps that was given.
        g: (k, n) Wei-Norman coordinates with X = X0 exp(g_1 A_1) ... exp(g_n A_n), from g = 0 at t[0]; raises
            ChartError, naming the time, if the chart ends on the way.
        charts: the same with restarts: charts that cover the whole trajectory, see `restarts.Chart`.
    """

    group: MatrixGroup
    t: Array
    X: Array
    steps: int
    error_estimate: float
    method: str
    evaluations: int
    resolution: float
    events: tuple[EventHits, ...]
    drive: Drive = field(repr=False)
    rtol: float = field(repr=False)
    multiple: int = field(repr=False)

    def __repr__(self) -> str:
        many = "" if self.X.ndim == 3 else f", {self.X.shape[1]} trajectories"
        return (
            f"Trajectory({self.group.name}, {len(self.t)} times from {self.t[0]:.6g} to {self.t[-1]:.6g}{many}, "
            f"{self.method}, {self.steps} steps, error_estimate={self.error_estimate:.2g})"
        )

    def at(self, t: ArrayLike) -> Array:
        """X at other times of the run.

        By fresh steps from the output time before, as fine as those of the run, u read at their own nodes: an interpolant
        of whole steps would be worse than the run.

        Args:
            t: one time or (k,) times within the run.

        Returns:
            (d, d) of one time, (k, d, d) of (k,); (N, d, d) and (k, N, d, d) of N trajectories.

        Raises:
            InputError: a time outside the run.
        """
        moments = np.asarray(t, dtype=float)
        wanted = np.atleast_1d(moments)
        if wanted.ndim != 1 or not np.all((wanted >= self.t[0]) & (wanted <= self.t[-1])):
            raise InputError(
                f"Trajectory.at({self.group.name}): t must be a number or (k,) numbers from {self.t[0]:.9g} to "
                f"{self.t[-1]:.9g}, the times of the run"
            )
        stops, where = np.unique(wanted, return_inverse=True)
        first = int(np.searchsorted(self.t, stops[0], side="right")) - 1
        start = np.ascontiguousarray(self.X[first])
        later = stops[stops > self.t[first]]
        found = start[None]
        if len(later):
            found = np.concatenate([found, self._flow(np.concatenate([[self.t[first]], later]), start)])
        found = found[len(found) - len(stops) :][where.reshape(wanted.shape)]
        return found if moments.ndim else found[0]

    def _flow(self, times: Array, start: Array) -> Array:
        """X at the times after the first, from X = start there."""
        if not self.multiple:
            return magnus_run(self.group, self.drive, times, start, order=8, rtol=self.rtol).X
        steps = plan_steps(self.drive, norms_of(self.group), times, MOST_STEPS)
        if steps is None:
            raise InputError(f"Trajectory.at({self.group.name}): the run has too many steps")
        return flow(self.group, self.drive, steps.times(self.multiple), int(self.method[-1]), start)

    @cached_property
    def g(self) -> Array:
        """(k, n) Wei-Norman coordinates; see the class."""
        from lie_codegen.flow.chart import follow_chart

        return follow_chart(self.group, self._grid, self._samples, self.X)

    @cached_property
    def charts(self) -> tuple[Chart, ...]:
        """Wei-Norman charts that cover the trajectory, each restarted before the last one ends."""
        from lie_codegen.flow.restarts import restarted_charts

        return restarted_charts(self.group, self._grid, self._samples, self.X)

    @cached_property
    def _grid(self) -> Grid:
        """Steps at which RKMK4 meets the tolerance; those of the coordinates are as many."""
        from lie_codegen.flow.libraries import step_of
        from lie_codegen.flow.refined import refined

        if self.X.ndim != 3:
            raise InputError(f"{self.group.name}: coordinates are of one trajectory; simulate it alone")
        signal = drive_signal(self.drive, self.t)
        step = step_of(self.group, "rkmk4")
        rtol = max(self.rtol, 1e-13)
        return refined(step, signal, np.array(1.0), self.X[0], self.t, rtol=rtol, name=self.group.name)[1]

    @property
    def _samples(self) -> Samples:
        grid = self._grid

        def between(first: int, last: int) -> tuple[Array, Array, Array, Array]:
            starts, h = grid.spans.steps(first, last)
            u = self.drive.values(starts, h, _WHOLE)
            return u[:, 0], u[:, 1], u[:, 2], h

        return between
