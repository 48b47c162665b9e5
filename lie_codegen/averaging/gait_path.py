"""Gaits: closed paths r(t) of a shape, with their velocities, from periodic inputs or from corners."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.signals.periodic_input import PeriodicInput

_SAMPLES, _HIGHEST = 1024, 128
_DEGREE, _PANELS = 24, 8
_CLOSED = 1e-9


@dataclass(frozen=True, eq=False)
class GaitPath:
    """A closed path of a shape.

    Attributes:
        at: (N,) times -> r and r', (N, k) each.
        knots: times from 0 to T between which it is smooth.
        fourier: (k, H + 1) complex c_n of r = Re(c_0) + sum 2 Re(c_n e^{2 pi i n t / T}); None where it is no short series.
    """

    at: Callable[[Array], tuple[Array, Array]]
    knots: Array
    fourier: Array | None

    @property
    def T(self) -> float:
        """The period."""
        return float(self.knots[-1])


def gait_path(gait: Any, shape: int, amplitude: float = 1.0, centre: ArrayLike | None = None) -> GaitPath:
    """r(t) = centre + amplitude s(t).

    Args:
        gait: s as a PeriodicInput of `shape` components (or its formulas), or (N, shape) corners joined by straight lines, the last one equal to the first.

    Raises:
        InputError: it does not close, or has parameters without values; ShapeError: another number of components.
    """
    middle = np.zeros(shape) if centre is None else np.asarray(centre, dtype=float)
    if middle.shape != (shape,):
        raise ShapeError(f"centre has shape {middle.shape}; the shape space has {shape} coordinates")
    size = float(amplitude)
    if not (np.isfinite(size) and np.all(np.isfinite(middle))):
        raise InputError("amplitude and centre must be finite")
    if isinstance(gait, list | tuple) and gait and all(isinstance(each, str) for each in gait):
        gait = PeriodicInput(list(gait))
    if isinstance(gait, PeriodicInput):
        return _of_input(gait, shape, size, middle)
    return _of_corners(gait, shape, size, middle)


def gait_of_fourier(coefficients: Array, period: float) -> GaitPath:
    """The path of complex Fourier coefficients (k, H + 1)."""
    n, w = np.arange(coefficients.shape[1]), 2 * np.pi / period
    weights = np.where(n > 0, 2, 1) * coefficients

    def at(t: Array) -> tuple[Array, Array]:
        waves = np.exp(1j * w * t[:, None] * n)
        return (waves @ weights.T).real, ((waves * 1j * w * n) @ weights.T).real

    return GaitPath(at, np.array([0.0, period]), coefficients)


def _of_input(gait: PeriodicInput, shape: int, size: float, middle: Array) -> GaitPath:
    if gait.symbols:
        raise InputError(f"gait: the parameters {', '.join(map(str, gait.symbols))} have no values; use gait.at(...)")
    if gait.dim != shape:
        raise ShapeError(f"gait: {gait.dim} components; the shape space has {shape} coordinates")
    T = float(gait.period)
    knots = np.array([0.0, *gait.breakpoints, T])
    _check_closed(gait, knots)
    if len(knots) == 2:
        waves = np.fft.rfft(gait(np.arange(_SAMPLES) * T / _SAMPLES).T, axis=1) / _SAMPLES
        scale = np.abs(waves).max(initial=0.0)
        waves[np.abs(waves) <= 1e-15 * scale] = 0
        used = np.flatnonzero(np.abs(waves).max(axis=0) > 1e-14 * scale)
        highest = int(used[-1]) if len(used) else 0
        if highest <= _HIGHEST:
            coefficients = size * waves[:, : highest + 1]
            coefficients[:, 0] += middle
            return gait_of_fourier(coefficients, T)
    fine = np.unique(np.concatenate([np.linspace(a, b, _PANELS + 1) for a, b in itertools.pairwise(knots)]))
    return GaitPath(_interpolated(lambda t: middle + size * gait(t), fine), knots, None)


def _interpolated(function: Callable[[Array], Array], ends: Array) -> Callable[[Array], tuple[Array, Array]]:
    """Chebyshev interpolants on panels, with their derivatives; nodes lie inside, so that jumps at joints do no harm."""
    angles = np.pi * (np.arange(_DEGREE) + 0.5) / _DEGREE
    nodes = np.cos(angles)
    lengths = np.diff(ends)
    times = ends[:-1, None] + lengths[:, None] * (nodes + 1) / 2
    values = function(times.ravel()).reshape(*times.shape, -1)
    orders = np.arange(_DEGREE)
    transform = np.cos(orders[:, None] * angles) * np.where(orders[:, None] == 0, 1, 2) / _DEGREE
    series = np.einsum("cj,pjk->pck", transform, values)

    def at(t: Array) -> tuple[Array, Array]:
        panel = np.clip(np.searchsorted(ends, t, side="right") - 1, 0, len(lengths) - 1)
        angle = np.arccos(np.clip(2 * (t - ends[panel]) / lengths[panel] - 1, -1, 1))[:, None]
        here = series[panel]
        sine = np.sin(angle)
        # d/dx T_n = n sin(n a) / sin(a), n^2 (+-1)^(n+1) at the ends
        with np.errstate(invalid="ignore", divide="ignore"):
            inner = orders * np.sin(orders * angle) / sine
        edge = orders**2 * np.where(np.cos(angle) > 0, 1.0, (-1.0) ** (orders + 1))
        slope = np.where(sine > 1e-12, inner, edge) * 2 / lengths[panel][:, None]
        return np.einsum("tc,tck->tk", np.cos(orders * angle), here), np.einsum("tc,tck->tk", slope, here)

    return at


def _check_closed(gait: PeriodicInput, knots: Array) -> None:
    T = float(knots[-1])
    before = gait(np.array([*knots[1:-1], T]) - 1e-11 * T)
    after = gait(np.array([*knots[1:-1], 0.0]) + 1e-11 * T)
    scale = max(1.0, float(np.abs(after).max(initial=0.0)))
    gap = np.abs(before - after).max(axis=1)
    if np.any(gap > 1e-6 * scale):
        where = [*knots[1:-1], T][int(np.argmax(gap))]
        raise InputError(
            f"the gait does not close: it jumps by {gap.max():.3g} at t = {where:g}; a shape that winds on, as the angle of a wheel, is given by "
            "its rates instead: lc.average(group, u) with u = -A r'"
        )


def _of_corners(gait: Any, shape: int, size: float, middle: Array) -> GaitPath:
    try:
        corners = np.asarray(gait, dtype=float)
    except (TypeError, ValueError):
        raise InputError("gait: give a PeriodicInput of the shape, or corners (N, k)") from None
    if corners.ndim != 2 or corners.shape[1] != shape or len(corners) < 3:
        raise ShapeError(f"gait: corners have shape {corners.shape}; give (N, {shape}), N at least 3")
    if np.abs(corners[0] - corners[-1]).max() > _CLOSED * max(1.0, float(np.abs(corners).max())):
        raise InputError(
            f"the gait does not close: it ends at {corners[-1].tolist()} and began at {corners[0].tolist()}; repeat the first corner at the end, or "
            "give a shape that winds on by its rates: lc.average(group, u) with u = -A r'"
        )
    moved = middle + size * corners
    steps = np.diff(moved, axis=0)

    def at(t: Array) -> tuple[Array, Array]:
        leg = np.clip(t.astype(int), 0, len(steps) - 1)
        return moved[leg] + (t - leg)[:, None] * steps[leg], steps[leg]

    return GaitPath(at, np.arange(len(moved), dtype=float), None)
