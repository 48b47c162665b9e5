"""Resonances n1 2 pi Lambda + n2 m = 0 that an averaged motion meets."""

from __future__ import annotations

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.rigid_body.torus_map import TorusSeries, resonant_ratios, torus_series
from lie_codegen.rigid_body.tumbling_body import BodyAxes, TumblingBody
from lie_codegen.rigid_body.tumbling_run import Resonance
from lie_codegen.runtime.broadcast import broadcast_call
from lie_codegen.runtime.ode import Motion
from lie_codegen.runtime.ode_field import Field

_FINER = 8


def resonances_met(model: TumblingBody, axes: BodyAxes, motion: Motion, rate: Field) -> tuple[Resonance, ...]:
    """Where n1 2 pi Lambda + n2 m changes sign, on the cubics through the knots of the run: where, not exactly what."""
    from scipy.interpolate import CubicHermiteSpline

    if len(motion.t) < 2 or not _between(_frequencies(model, axes, motion.y)):
        return ()
    slopes = np.array([rate(t, y) for t, y in zip(motion.t, motion.y, strict=True)])
    if not np.all(np.isfinite(slopes)):
        return ()
    cubic = CubicHermiteSpline(motion.t, motion.y, slopes)
    moments = np.linspace(motion.t[0], motion.t[-1], _FINER * len(motion.t))
    frequencies = _frequencies(model, axes, cubic(moments))
    found = []
    for n1, n2 in _between(frequencies):
        value = frequencies @ (n1, n2)
        for i in np.flatnonzero(value[:-1] * value[1:] < 0):
            part = value[i] / (
                value[i] - value[i + 1]
            )  # the chord's zero: moments are so dense that the value is nearly straight
            when = float(moments[i] + part * (moments[i + 1] - moments[i]))
            found.append(Resonance(when, n1, n2, series_at(model, axes, cubic(when), when).harmonic(n1, n2)))
    return tuple(sorted(found, key=lambda each: each.t))


def series_at(model: TumblingBody, axes: BodyAxes, y: Array, t: float) -> TorusSeries:
    """The rates on the torus through a mean state, the directions held at t."""
    _, rate, m, b = model.library["shape"](y[:3], float(y[3]), axes.inertia)
    function, given = model.library["torque_at"], model.given(t)

    def sample(phi: Array, alpha: Array) -> tuple[Array, Array]:
        rates, N, _, _ = broadcast_call(function, y[:3], y[3], phi, alpha, t, axes.paper, axes.inertia, *given)
        return rates, N

    return torus_series(sample, float(rate), float(m), np.asarray(b))


def _frequencies(model: TumblingBody, axes: BodyAxes, y: Array) -> Array:
    """(n, 2): 2 pi Lambda and m."""
    count = len(y)
    inertia = np.broadcast_to(axes.inertia, (count, 3))
    _, rate, m, _ = model.library["shape"].batch(*(np.ascontiguousarray(each) for each in (y[:, :3], y[:, 3], inertia)))
    return np.column_stack([2 * np.pi * np.asarray(rate), m])


def _between(frequencies: Array) -> list[tuple[int, int]]:
    """The ratios that lie between the smallest and the largest quotient of the frequencies."""
    quotient = frequencies[:, 0] / frequencies[:, 1]
    low, high = float(quotient.min()), float(quotient.max())
    return [(n1, n2) for n1, n2 in resonant_ratios() if low <= -n2 / n1 <= high]
