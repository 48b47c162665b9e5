"""Wei-Norman coordinates along a trajectory of any length: the chart restarts before it ends, by left invariance.

X(t) = X_k Phi(g(t)) with g = 0 at the start of chart k. Chart k ends where det M(g)^-1 has fallen to a quarter of its value
at g = 0, or where |M(g)| has grown tenfold (finite escape, or plainly a long way).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import ChartError
from lie_codegen.flow.chart import Samples, newton
from lie_codegen.flow.grid import Grid
from lie_codegen.flow.libraries import integrators
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.saved import Saved
from lie_codegen.runtime.rows import row_by_row

_SMALLEST_DETERMINANT = 0.25
_LARGEST_GROWTH = 10.0
_BLOCK = 512


@dataclass(frozen=True, eq=False, repr=False)
class Chart(Saved):
    """One chart of a trajectory: X(t) = origin exp(g_1 A_1) ... exp(g_n A_n) for start <= t <= end.

    Attributes:
        start, end: the times between which the chart is used.
        origin: (d, d) X(start), where g = 0.
        t: (k,) the output times within.
        g: (k, n) coordinates at them.
        reason: why it was left: "wall" (the determinant vanishes ahead), "growth" (|M| grows ahead) or "end" (of the run).
    """

    start: float
    end: float
    origin: Array
    t: Array
    g: Array
    reason: str


def restarted_charts(group: MatrixGroup, grid: Grid, samples: Samples, X: Array) -> tuple[Chart, ...]:
    """The charts that cover a trajectory.

    Args:
        group: the group.
        grid: the time grid.
        samples: u at the steps.
        X: (k, d, d) the trajectory at the output times.

    Raises:
        ChartError: if a single step crosses a whole chart.
    """
    charts: list[Chart] = []
    begin, origin = 0, X[0]
    while begin < grid.steps:
        piece = _until_edge(group, grid, samples, begin, origin)
        start, end = _time(grid, begin), _time(grid, piece.last)
        if piece.last == begin:
            raise ChartError(f"{group.name}: one step at t = {start:.6g} crosses a whole chart; lower `tolerance`")
        here = np.flatnonzero((grid.outputs >= begin) & (grid.outputs <= piece.last))
        relative = np.linalg.inv(origin) @ X[here]
        inside = newton(group, piece.g, relative) if len(here) else np.empty((0, group.dim))
        charts.append(Chart(start, end, origin, grid.knots[grid.at[here]], inside, piece.reason))
        begin, origin = piece.last, piece.end
    return tuple(charts)


@dataclass(frozen=True)
class _Piece:
    """One chart: its last step, X there, the coordinates at the output times within, why it ends."""

    last: int
    end: Array
    g: Array
    reason: str


def _time(grid: Grid, step: int) -> float:
    """When a step begins."""
    span, inside = divmod(step, grid.parts)
    if inside == 0:
        return float(grid.knots[span])
    return float(grid.spans.steps(step, step + 1)[0][0])


def _until_edge(group: MatrixGroup, grid: Grid, samples: Samples, begin: int, origin: Array) -> _Piece:
    """The steps from `begin` to the last one well inside the chart."""
    lib = integrators(group)
    g, X, position = np.zeros(group.dim), origin, begin
    kept = [np.zeros((int(np.isin(begin, grid.outputs)), group.dim))]
    while position < grid.steps:
        stop = min(position + _BLOCK, grid.steps)
        u0, um, u1, h = samples(position, stop)
        inputs = {"u0": u0, "um": um, "u1": u1, "h": h}
        with np.errstate(all="ignore"):
            block = lib.wei_norman_step.scan(g, n=stop - position, every=1, **inputs)
        wall, growth = _edges(group, block[1:])
        out = np.flatnonzero(wall | growth)
        count = int(out[0]) if len(out) else stop - position
        here = grid.outputs[(grid.outputs > position) & (grid.outputs <= position + count)]
        kept.append(block[here - position])
        X = lib.rkmk4_step.scan(X, n=stop - position, every=1, **inputs)[count]
        g = block[count]
        if len(out):
            return _Piece(position + count, X, np.concatenate(kept), "wall" if wall[out[0]] else "growth")
        position = stop
    return _Piece(position, X, np.concatenate(kept), "end")


def _edges(group: MatrixGroup, g: Array) -> tuple[Array, Array]:
    """(k,) whether the determinant is too small, and whether M is too large."""
    finite = np.all(np.isfinite(g), axis=1)
    M = row_by_row(integrators(group).wei_norman_matrix, np.where(finite[:, None], g, 0.0))[0]
    good = finite & np.all(np.isfinite(M), axis=(1, 2))
    M = np.where(good[:, None, None], M, np.eye(group.dim))
    sign, size = np.linalg.slogdet(M)
    wall = good & ((sign <= 0) | (size > -np.log(_SMALLEST_DETERMINANT)))
    growth = ~good | (np.linalg.norm(M, axis=(1, 2)) > _LARGEST_GROWTH * np.sqrt(group.dim))
    return wall, growth
