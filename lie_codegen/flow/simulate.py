"""lc.simulate: X' = X hat(eps u(t)) on the group, by RKMK4 in compiled loops."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lie_codegen.errors import ComputationError, InputError, NotFiniteError, ShapeError
from lie_codegen.flow.chart import Samples, follow_chart
from lie_codegen.flow.grid import Grid, refine, sample
from lie_codegen.flow.inputs import Signal, as_signal
from lie_codegen.flow.libraries import step_of
from lie_codegen.flow.restarts import Chart, restarted_charts
from lie_codegen.flow.rollout import rollout
from lie_codegen.groups.maps.admission import admitted, admitted_all
from lie_codegen.groups.matrix_group import MatrixGroup, require_group

Array = NDArray[Any]

#: |h u| and w h (of the fastest sine) that a step may span.
_LARGEST_STEP, _LARGEST_ANGLE = 0.25, 1.0
#: Steps that are taken where u is a formula, evaluated in C (some seconds on SO(3)), and where Python is asked for it.
_MOST_STEPS, _MOST_SAMPLES = 2**26, 2**23


@dataclass(frozen=True)
class Trajectory:
    """A solution of X' = X hat(eps u).

    Attributes:
        t: (k,) times.
        X: (k, d, d) group elements, on the group to rounding; (k, N, d, d) of N trajectories.
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
    _eps: Array = field(repr=False)

    @cached_property
    def g(self) -> Array:
        """(k, n) Wei-Norman coordinates; see the class."""
        return follow_chart(self.group, self._grid, self._samples(), self.X)

    @cached_property
    def charts(self) -> tuple[Chart, ...]:
        """Wei-Norman charts that cover the trajectory, each restarted before the last one ends."""
        return restarted_charts(self.group, self._grid, self._samples(), self.X)

    def _samples(self) -> Samples:
        if self.X.ndim != 3:
            raise InputError(f"{self.group.name}: coordinates are of one trajectory; simulate it alone")
        eps = float(self._eps)

        def between(first: int, last: int) -> tuple[Array, Array, Array, Array]:
            u0, um, u1, h = sample(self._u, self._grid, first, last)
            return eps * u0, eps * um, eps * u1, h

        return between


def simulate(
    group: MatrixGroup,
    u: Any,
    *,
    t: ArrayLike,
    eps: ArrayLike = 1.0,
    X0: ArrayLike | None = None,
    tolerance: float = 1e-11,
    method: str = "rkmk4",
    threads: int = 1,
) -> Trajectory:
    """The flow X' = X hat(eps u(t)) from X(t[0]) = X0, at the times t; one, or N trajectories at once.

    Args:
        group: the group.
        u: a PeriodicInput or a SampledInput (evaluated in the compiled loop where it is a Fourier series or straight
            pieces, however long the run), any u(t) -> (n,) (vectorised or not; an attribute `breakpoints` names the times
            at which it is not smooth), a constant (n,), or samples (len(t), n), joined by straight lines.
        t: (k,) increasing times; the first is the initial one.
        eps: scales u; (N,) for N trajectories.
        X0: (d, d) initial element, the identity if not given; (N, d, d) for N trajectories.
        tolerance: the steps are halved until the estimated error is below it (absolute, in the entries of X).
        method: "rkmk4" (Munthe-Kaas) or "commutator_free" (two exponentials, no brackets: for algebras with many).
        threads: over which N trajectories are shared out.

    Raises:
        ShapeError, NotFiniteError, InputError: naming the argument.
        NotOnGroupError: X0 is off the group by more than 1e-5; nearer ones are projected.
        ComputationError: the tolerance is not reached with the steps that can be taken: 67 million, 8 million for a u
            that is no formula.
    """
    require_group(group, "simulate")
    times = _check_times(group, t)
    factors = _factors(group, eps)
    if not tolerance > 0:
        raise InputError(f"simulate({group.name}): tolerance must be positive, got {tolerance}")
    start = _initial(group, X0)
    signal = as_signal(group, u, times)
    _check_trajectories(group, start, factors, signal)
    step = step_of(group, method)
    most = _MOST_SAMPLES if signal.formula is None else _MOST_STEPS
    grid = Grid.coarse(times, signal.breakpoints)
    if signal.formula is not None:
        grid = _divided(grid, signal.formula.fastest * grid.largest_step / _LARGEST_ANGLE, most, group.name)
    coarse, move = rollout(step, grid, signal, factors, start, group.name, threads)
    while move > _LARGEST_STEP:
        grid = _divided(grid, move / _LARGEST_STEP, most, group.name)
        coarse, move = rollout(step, grid, signal, factors, start, group.name, threads)
    while True:
        grid = refine(grid, most, group.name)
        fine, _ = rollout(step, grid, signal, factors, start, group.name, threads)
        estimate = float(np.max(np.abs(fine - coarse), initial=0.0)) / 15
        scale = max(1.0, float(np.max(np.abs(fine))))
        if not np.isfinite(estimate):
            raise ComputationError(f"simulate({group.name}): the solution left the range of double precision")
        if estimate <= max(tolerance * scale, 4e-16 * scale * np.sqrt(grid.steps)):
            return Trajectory(group, times, fine, grid.steps, estimate, grid, signal, factors)
        coarse = fine


def _divided(grid: Grid, ratio: float, most: int, name: str) -> Grid:
    """Steps shorter by at least the ratio, a power of two."""
    if ratio <= 1:
        return grid
    return refine(grid, most, name, 2 ** int(np.ceil(np.log2(ratio))))


def _factors(group: MatrixGroup, eps: ArrayLike) -> Array:
    try:
        factors = np.asarray(eps, dtype=float)
    except (TypeError, ValueError):
        raise NotFiniteError(f"simulate({group.name}): eps is {eps!r}; give a finite number") from None
    if not np.all(np.isfinite(factors)):
        raise NotFiniteError(f"simulate({group.name}): eps is {eps!r}; give a finite number")
    if factors.ndim > 1 or not factors.size:
        raise ShapeError(f"simulate({group.name}): eps has shape {factors.shape}; give a number, or (N,) of them")
    return factors


def _check_trajectories(group: MatrixGroup, start: Array, eps: Array, u: Signal) -> None:
    given = {
        "X0": len(start) if start.ndim == 3 else None,
        "eps": len(eps) if eps.ndim else None,
        "u": u.formula.trajectories if u.formula is not None else None,
    }
    counts = {name: count for name, count in given.items() if count is not None}
    if len(set(counts.values())) > 1:
        text = ", ".join(f"{name} has {count}" for name, count in counts.items())
        raise ShapeError(f"simulate({group.name}): give one number of trajectories; {text}")


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
    if start.ndim not in (2, 3) or start.shape[-2:] != (d, d) or not start.size:
        raise ShapeError(
            f"simulate({group.name}): X0 has shape {start.shape}; it must be ({d}, {d}), or (N, {d}, {d}) of N trajectories"
        )
    if not np.all(np.isfinite(start)):
        raise NotFiniteError(f"simulate({group.name}): X0 holds NaN or infinity")
    where = f"simulate({group.name}): X0"
    return admitted(group, start, where).X if start.ndim == 2 else admitted_all(group, start, where)[0]
