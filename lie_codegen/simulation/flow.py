"""lc.simulate: X' = X hat(eps u(t)) on the group, by RKMK4 in compiled loops."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lie_codegen.errors import ComputationError, InputError, NotFiniteError, ShapeError
from lie_codegen.groups.invariants import check_invariants
from lie_codegen.groups.matrix_group import MatrixGroup, require_group
from lie_codegen.simulation.chart import follow_chart
from lie_codegen.simulation.grid import Grid, refine, sample
from lie_codegen.simulation.inputs import Signal, as_signal
from lie_codegen.simulation.libraries import integrators
from lie_codegen.simulation.restarts import Chart, restarted_charts

Array = NDArray[Any]

_LARGEST_STEP = 0.25
_MOST_STEPS = 2**22


@dataclass(frozen=True)
class Trajectory:
    """A solution of X' = X hat(eps u).

    Attributes:
        t: (k,) times.
        X: (k, d, d) group elements, on the group to rounding.
        steps: number of integration steps taken.
        error_estimate: difference to the run with half the steps, over 15 (Richardson).
        g: (k, n) Wei-Norman coordinates with X = X0 exp(g_1 A_1) ... exp(g_n A_n), from g = 0 at t[0]; raises
            ChartError, naming the time, if the chart ends on the way.
        charts: the same with restarts: charts that cover the whole trajectory, see `restarts.Chart`.
    """

    group: MatrixGroup
    t: Array
    X: Array
    steps: int
    error_estimate: float
    _grid: Grid = field(repr=False)
    _u: Signal = field(repr=False)
    _eps: float = field(repr=False)

    @cached_property
    def g(self) -> Array:
        """(k, n) Wei-Norman coordinates; see the class."""
        u0, um, u1 = sample(self._u, self._grid, self._eps)
        return follow_chart(self.group, self._grid, (u0, um, u1), self.X)

    @cached_property
    def charts(self) -> tuple[Chart, ...]:
        """Wei-Norman charts that cover the trajectory, each restarted before the last one ends."""
        samples = sample(self._u, self._grid, self._eps)
        states = _states(self.group, self._grid, samples, self.X[0])
        return restarted_charts(self.group, self._grid, samples, states)


def simulate(
    group: MatrixGroup,
    u: Any,
    *,
    t: ArrayLike,
    eps: float = 1.0,
    X0: ArrayLike | None = None,
    tolerance: float = 1e-11,
) -> Trajectory:
    """The flow X' = X hat(eps u(t)) from X(t[0]) = X0, at the times t.

    Args:
        group: the group.
        u: u(t) -> (n,) (vectorised or not; an attribute `breakpoints` names the times at which it is not smooth), a
            constant (n,), or samples (len(t), n).
        t: (k,) increasing times; the first is the initial one.
        eps: scales u.
        X0: (d, d) initial element, the identity if not given.
        tolerance: the steps are halved until the estimated error is below it (absolute, in the entries of X).

    Raises:
        ShapeError, NotFiniteError, InputError: naming the argument.
        NotOnGroupError: X0 breaks a condition that every element of the group meets.
        ComputationError: if the tolerance is not reached with four million steps.
    """
    require_group(group, "simulate")
    times = _check_times(group, t)
    if not isinstance(eps, int | float | np.number) or not np.isfinite(eps):
        raise NotFiniteError(f"simulate({group.name}): eps is {eps!r}; give a finite number")
    if not tolerance > 0:
        raise InputError(f"simulate({group.name}): tolerance must be positive, got {tolerance}")
    start = _initial(group, X0)
    signal = as_signal(group, u, times)
    grid = Grid.coarse(times, signal.breakpoints)
    while grid.largest_move(sample(signal, grid, eps)) > _LARGEST_STEP:
        grid = refine(grid, _MOST_STEPS, group.name)
    coarse = _run(group, grid, signal, eps, start)
    while True:
        grid = refine(grid, _MOST_STEPS, group.name)
        fine = _run(group, grid, signal, eps, start)
        estimate = float(np.max(np.abs(fine - coarse), initial=0.0)) / 15
        scale = max(1.0, float(np.max(np.abs(fine))))
        if not np.isfinite(estimate):
            raise ComputationError(f"simulate({group.name}): the solution left the range of double precision")
        if estimate <= max(tolerance * scale, 4e-16 * scale * np.sqrt(grid.steps)):
            return Trajectory(group, times, fine, grid.steps, estimate, grid, signal, float(eps))
        coarse = fine


def _run(group: MatrixGroup, grid: Grid, signal: Signal, eps: float, start: Array) -> Array:
    samples = sample(signal, grid, eps)
    for values in samples:
        if not np.all(np.isfinite(values)):
            raise NotFiniteError(f"simulate({group.name}): u(t) is NaN or infinite at some t")
    return _states(group, grid, samples, start)[grid.outputs]


def _states(group: MatrixGroup, grid: Grid, samples: tuple[Array, Array, Array], start: Array) -> Array:
    """(steps + 1, d, d) the flow at every step."""
    u0, um, u1 = samples
    states = integrators(group).rkmk4_step.scan(start, n=grid.steps, every=1, u0=u0, um=um, u1=u1, h=grid.h)
    return np.asarray(states)


def _check_times(group: MatrixGroup, t: ArrayLike) -> Array:
    try:
        times = np.asarray(t, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"simulate({group.name}): t must be an array of numbers, got {t!r}") from None
    if times.ndim != 1 or len(times) < 2:
        raise ShapeError(f"simulate({group.name}): t has shape {times.shape}; give two or more times")
    if not np.all(np.isfinite(times)):
        raise NotFiniteError(f"simulate({group.name}): t holds NaN or infinity")
    if np.any(np.diff(times) <= 0):
        raise InputError(f"simulate({group.name}): t must increase strictly")
    return times


def _initial(group: MatrixGroup, X0: ArrayLike | None) -> Array:
    kind = complex if group.is_complex else float
    d = group.degree
    if X0 is None:
        return np.eye(d, dtype=kind)
    given = np.asarray(X0)
    if given.dtype.kind not in "biufc":
        raise ShapeError(f"simulate({group.name}): X0 must be a ({d}, {d}) array of numbers, got {X0!r}")
    if not group.is_complex and np.iscomplexobj(given):
        raise ShapeError(f"simulate({group.name}): X0 is complex, the group is real")
    start = np.ascontiguousarray(given, dtype=kind)
    if start.shape != (d, d):
        raise ShapeError(f"simulate({group.name}): X0 has shape {start.shape}; it must be ({d}, {d})")
    if not np.all(np.isfinite(start)):
        raise NotFiniteError(f"simulate({group.name}): X0 holds NaN or infinity")
    check_invariants(group, start, f"simulate({group.name}): X0")
    return start
