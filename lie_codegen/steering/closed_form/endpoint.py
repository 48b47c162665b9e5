"""The true endpoint of controls that depend on parameters, its derivative, and the parameters that hit a target exactly."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow.libraries import integrators
from lie_codegen.groups.matrix_group import MatrixGroup

#: end(x, refine) -> X(1), (d, d), and vee(X^-1 dX / dx), (n, p).
End = Callable[[Array, int], tuple[Array, Array]]

#: Refinement of the grid with which endpoints are good to about 1e-13. Derivatives, of the coarse grid, serve Newton's method only.
FINE = 16

_SHARP = 2e-14
_NEAR = 1e-5
_ITERATIONS = 30
_HOPELESS = 6


def flow_end(
    group: MatrixGroup, controls: Sequence[int], velocity: Callable[[Array], Array], steps: int, refine: int = 1
) -> tuple[Array, Array, Array]:
    """X(1) of X' = X sum_i u_i A_i, X(0) = I, and what turns variations of u into variations of X(1).

    vee(X(1)^-1 delta X(1)) = int_0^1 sum_i delta u_i(s) vee(Ad_{X(1)^-1 X(s)} A_i) ds, by Simpson's rule.

    Args:
        group: the group.
        controls: (m,) positions.
        velocity: s (k,) in [0, 1] -> u (k, m).
        steps: of Simpson's rule, even; the flow takes `refine` times as many RKMK4 steps.
        refine: see `steps`.

    Returns:
        X(1), (d, d), with refine > 1 extrapolated (Richardson); the nodes s, (steps + 1,); Simpson's weights times the carried
        A_i, (steps + 1, m, n).
    """
    count = refine * steps
    t = np.linspace(0, 1, 2 * count + 1)
    u = np.zeros((2 * count + 1, group.dim))
    u[:, list(controls)] = velocity(t)
    start = np.eye(group.degree, dtype=complex if group.is_complex else float)
    step = integrators(group).rkmk4_step

    def flow(skip: int) -> Array:
        u0, um, u1 = (u[first : len(u) - 2 * skip + first : 2 * skip].copy() for first in (0, skip, 2 * skip))
        return np.asarray(step.scan(start, n=count // skip, u0=u0, um=um, u1=u1, h=skip / count))

    X = flow(1)
    relative = np.linalg.solve(X[-1], X[::refine])
    moved = relative[:, None] @ group.basis[list(controls)] @ np.linalg.inv(relative)[:, None]
    simpson = np.full(steps + 1, 2.0)
    simpson[1::2] = 4.0
    simpson[[0, -1]] = 1.0
    end = X[-1] if refine == 1 else _extrapolated(flow(2)[-1], X[-1])
    return end, t[:: 2 * refine], group.project(moved) * (simpson / (3 * steps))[:, None, None]


def _extrapolated(coarse: Array, fine: Array) -> Array:
    """The limit of a fourth-order method from steps 2 h and h: fine exp(log(coarse^-1 fine) / 15), to second order in the log."""
    d = np.linalg.solve(coarse, fine) - np.eye(len(fine))
    d = (d - d @ d / 2) / 15
    return np.asarray(fine + fine @ (d + d @ d / 2))


def retune(group: MatrixGroup, target: Array, x: Array, end: End) -> tuple[Array, float]:
    """Parameters near x whose true endpoint is the target, to rounding; and max |target^-1 X(1) - I| that is left.

    `approach`, then, if that arrived, `sharpen`.
    """
    x, off = approach(group, target, x, end)
    return (x, off) if off > 100 * _NEAR else sharpen(group, target, x, end)


def approach(group: MatrixGroup, target: Array, x: Array, end: End) -> tuple[Array, float]:
    """Levenberg-Marquardt on target^-1 X(1) - I from x, on the coarse grid, down to 1e-5; and what is left.

    Args:
        group: the group.
        target: (d, d).
        x: (p,) first guess.
        end: the endpoint and its derivative.
    """
    gap, slope = _attempt(group, target, x, end)
    cost, damping, refused = float(gap @ gap), 1e-3, 0
    for _ in range(_ITERATIONS):
        if not np.max(np.abs(gap)) > _NEAR or refused > _HOPELESS:
            break
        normal = slope.T @ slope
        diagonal = np.diag(normal) + 1e-3 * np.trace(normal) / len(x)
        trial = x - np.linalg.solve(normal + damping * np.diag(diagonal), slope.T @ gap)
        trial_gap, trial_slope = _attempt(group, target, trial, end)
        trial_cost = float(trial_gap @ trial_gap)
        if trial_cost < cost:  # false for NaN
            x, gap, slope, damping, refused = trial, trial_gap, trial_slope, damping / 10, 0
            cost = trial_cost
        else:
            damping, refused = min(damping * 6, 1e12), refused + 1
    left = float(np.max(np.abs(gap)))
    return x, left if np.isfinite(left) else np.inf


def sharpen(group: MatrixGroup, target: Array, x: Array, end: End) -> tuple[Array, float]:
    """Newton's method, least change, on the fine grid, from parameters that nearly hit; the best met and what is left."""
    best, off = x, np.inf
    for _ in range(8):
        gap, slope = _attempt(group, target, x, end, FINE)
        now = float(np.max(np.abs(gap)))
        if now < off:
            best, off = x, now
        elif now < 1e-11:  # rounding: no further gain
            break
        if now < _SHARP or not np.isfinite(now):
            break
        x = x - np.linalg.lstsq(slope, gap, rcond=1e-9)[0]
    return best, off


def _attempt(group: MatrixGroup, target: Array, x: Array, end: End, refine: int = 1) -> tuple[Array, Array]:
    """As `_linearised`; NaN where the flow leaves the range of double precision."""
    lost = np.array([np.nan])
    if not np.all(np.isfinite(x)):
        return lost, lost
    try:
        with np.errstate(all="ignore"):
            gap, slope = _linearised(group, target, end(x, refine))
    except np.linalg.LinAlgError:
        return lost, lost
    return (gap, slope) if np.all(np.isfinite(slope)) else (lost, lost)


def _linearised(group: MatrixGroup, target: Array, found: tuple[Array, Array]) -> tuple[Array, Array]:
    """target^-1 X - I and its derivative, real and imaginary parts of the entries one after the other."""
    X, slope = found
    relative = np.linalg.solve(target, X)
    gap = (relative - np.eye(group.degree)).ravel()
    columns = (relative @ group.basis).reshape(group.dim, -1).T @ slope
    if group.is_complex:
        return np.concatenate([gap.real, gap.imag]), np.concatenate([columns.real, columns.imag])
    return gap, columns
