"""Wei-Norman coordinates along a trajectory of any length: the chart restarts before it ends, by left invariance.

X(t) = X_k Phi(g(t)) with g = 0 at the start of chart k. Chart k ends where det M(g)^-1 has fallen to a quarter of its value
at g = 0, or where |M(g)| has grown tenfold (finite escape, or plainly a long way).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.errors import ChartError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.simulation.chart import newton
from lie_codegen.simulation.grid import Grid
from lie_codegen.simulation.libraries import integrators

Array = NDArray[Any]

_SMALLEST_DETERMINANT = 0.25
_LARGEST_GROWTH = 10.0
_BLOCK = 512


@dataclass(frozen=True)
class Chart:
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


def restarted_charts(
    group: MatrixGroup, grid: Grid, samples: tuple[Array, Array, Array], states: Array
) -> tuple[Chart, ...]:
    """The charts that cover a trajectory.

    Args:
        group: the group.
        grid: the time grid.
        samples: u at the start, middle and end of each step.
        states: (steps + 1, d, d) the trajectory at every step.

    Raises:
        ChartError: if a single step crosses a whole chart.
    """
    times = np.append(grid.starts(), grid.knots[-1])
    charts = []
    begin = 0
    while begin < grid.steps:
        g, reason = _until_edge(group, grid, samples, begin)
        last = begin + len(g) - 1
        if last == begin:
            raise ChartError(
                f"{group.name}: one step at t = {times[begin]:.6g} crosses a whole chart; lower `tolerance`"
            )
        outputs = grid.outputs[(grid.outputs >= begin) & (grid.outputs <= last)]
        relative = np.linalg.inv(states[begin]) @ states[outputs]
        inside = newton(group, g[outputs - begin], relative) if len(outputs) else np.empty((0, group.dim))
        charts.append(Chart(float(times[begin]), float(times[last]), states[begin], times[outputs], inside, reason))
        begin = last
    return tuple(charts)


def _until_edge(group: MatrixGroup, grid: Grid, samples: tuple[Array, Array, Array], begin: int) -> tuple[Array, str]:
    """Coordinates at the steps from `begin` to the last one well inside the chart, and why it is the last."""
    lib = integrators(group)
    pieces = [np.zeros((1, group.dim))]
    h = grid.h
    position = begin
    while position < grid.steps:
        stop = min(position + _BLOCK, grid.steps)
        u0, um, u1 = (values[position:stop] for values in samples)
        with np.errstate(all="ignore"):
            block = lib.wei_norman_step.scan(
                pieces[-1][-1], n=stop - position, every=1, u0=u0, um=um, u1=u1, h=h[position:stop]
            )[1:]
        wall, growth = _edges(group, block)
        out = np.flatnonzero(wall | growth)
        if len(out):
            return np.concatenate([*pieces, block[: out[0]]]), "wall" if wall[out[0]] else "growth"
        pieces.append(block)
        position = stop
    return np.concatenate(pieces), "end"


def _edges(group: MatrixGroup, g: Array) -> tuple[Array, Array]:
    """(k,) whether the determinant is too small, and whether M is too large."""
    finite = np.all(np.isfinite(g), axis=1)
    M = integrators(group).wei_norman_matrix.batch(np.where(finite[:, None], g, 0.0))
    good = finite & np.all(np.isfinite(M), axis=(1, 2))
    M = np.where(good[:, None, None], M, np.eye(group.dim))
    sign, size = np.linalg.slogdet(M)
    wall = good & ((sign <= 0) | (size > -np.log(_SMALLEST_DETERMINANT)))
    growth = ~good | (np.linalg.norm(M, axis=(1, 2)) > _LARGEST_GROWTH * np.sqrt(group.dim))
    return wall, growth
