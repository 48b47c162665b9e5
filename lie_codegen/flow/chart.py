"""Wei-Norman coordinates along a trajectory, and the end of their chart."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import ChartError
from lie_codegen.flow.grid import Grid
from lie_codegen.flow.libraries import integrators
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.runtime.rows import row_by_row

#: (first, last) -> u at the start, the middle and the end of these steps, and their lengths.
Samples = Callable[[int, int], tuple[Array, Array, Array, Array]]

_BLOCK = 16_384
_AGREEMENT = 1e-9
#: log det M above which the chart's edge is reached to rounding.
_EDGE = 32.0
_SMALL = 6


def follow_chart(group: MatrixGroup, grid: Grid, samples: Samples, X: Array) -> Array:
    """(k, n) coordinates with X(t) = X(t_0) Phi(g(t)), g(t_0) = 0: g' = M(g) u, corrected to X by Newton's method.

    Raises:
        ChartError: where the chart ends, naming the time.
    """
    step = integrators(group).wei_norman_step
    g, inside = np.zeros((len(grid.outputs), group.dim)), np.zeros(len(grid.outputs), dtype=bool)
    current, still = np.zeros(group.dim), True
    inside[0] = True
    with np.errstate(all="ignore"):
        for first in range(0, grid.steps, _BLOCK):
            last = min(first + _BLOCK, grid.steps)
            u0, um, u1, h = samples(first, last)
            block = step.scan(current, n=last - first, every=1, u0=u0, um=um, u1=u1, h=h)
            well = np.logical_and.accumulate(_inside(group, block)) & still
            here = (grid.outputs > first) & (grid.outputs <= last)
            g[here], inside[here] = block[grid.outputs[here] - first], well[grid.outputs[here] - first]
            current, still = block[-1], bool(well[-1])
            if not still:
                break
        relative = np.linalg.inv(X[0]) @ X
        g = newton(group, g, relative)
        off = mismatch(group, g, relative)
    bad = np.flatnonzero(~(inside & (off <= _AGREEMENT * np.maximum(1.0, np.max(np.abs(relative), axis=(1, 2))))))
    if len(bad):
        last, first = grid.knots[grid.at[max(bad[0] - 1, 0)]], grid.knots[grid.at[bad[0]]]
        raise ChartError(
            f"{group.name}: the Wei-Norman chart in the order {', '.join(group.labels)} ends between t = {last:.6g} "
            f"and t = {first:.6g}{_why(group)}; the trajectory itself (.X) is right, and .charts restarts the "
            "coordinates before they end; or reorder the basis"
        )
    return g


def _why(group: MatrixGroup) -> str:
    """A vanishing determinant told apart from an escape in finite time, where the exact domain is quickly derived."""
    if group.dim > _SMALL:
        return ""
    from lie_codegen.groups.wei_norman.chart_domain import chart_domain

    return f" ({chart_domain(group).text})"


def _inside(group: MatrixGroup, g: Array) -> Array:
    """(k,) whether det M(g)^-1 is finite and positive, as at g = 0; the chart ends where it vanishes."""
    finite = np.all(np.isfinite(g), axis=1)
    M = row_by_row(integrators(group).wei_norman_matrix, np.where(finite[:, None], g, 0.0))[0]
    sign, size = np.linalg.slogdet(np.where(np.isfinite(M), M, 0.0))
    return np.asarray(finite & (sign > 0) & (size < _EDGE))


def newton(group: MatrixGroup, g: Array, X: Array, iterations: int = 4) -> Array:
    """Improves (k, n) coordinates g towards Phi(g) = X by g += M(g) vee(Phi(g)^-1 X - I)."""
    lib = integrators(group)
    identity = np.eye(group.degree)
    for _ in range(iterations):
        finite = np.all(np.isfinite(g), axis=1)
        safe = np.where(finite[:, None], g, 0.0)
        residual = group.project(np.linalg.inv(row_by_row(lib.product_exp, safe)[0]) @ X - identity)
        step = np.einsum("kij,kj->ki", row_by_row(lib.wei_norman_matrix, safe)[0], residual)
        g = np.where(finite[:, None] & (np.linalg.norm(residual, axis=1) < 0.5)[:, None], g + step, g)
    return g


def mismatch(group: MatrixGroup, g: Array, X: Array) -> Array:
    """(k,) max |Phi(g) - X|; NaN where g is not finite."""
    phi = row_by_row(integrators(group).product_exp, np.ascontiguousarray(g))[0]
    return np.asarray(np.max(np.abs(phi - X), axis=(1, 2)))
