"""The loops of templates/ode.c in numpy, where there is no compiler: the same steps, errors and events."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.kernel.runge_kutta import ARRAYS, CLASSICAL, increment
from lie_codegen.runtime import dop853

_REACHED, _EVENT, _STUCK = 0, 1, 3
Function = Callable[[float, Array], Array]
_ROWS = [(np.array(list(row)), np.array(list(row.values()))) for row in dop853.A]
_B, _E3, _E5 = np.array(dop853.B), np.array(dop853.E3), np.array(dop853.E5)


def partial(f: Function, t: float, y: Array, h: float) -> Array:
    """The state a step of length h later."""
    return y if h == 0 else _step(f, t, y, h, f(t, y))[0]


def _step(f: Function, t: float, y: Array, h: float, first: Array) -> tuple[Array, Array]:
    k = np.empty((len(_B), y.size))
    k[0] = first
    for s in range(1, len(_B)):
        places, weights = _ROWS[s]
        k[s] = f(t + dop853.C[s] * h, y + h * (weights @ k[places]))
    return y + h * (_B @ k), k


def _error(y: Array, after: Array, h: float, k: Array, rtol: float, atol: Array) -> float:
    if not np.all(np.isfinite(after)):
        return math.inf
    scale = atol + rtol * np.maximum(np.abs(y), np.abs(after))
    five, three = (float(np.sum(((weights @ k) / scale) ** 2)) for weights in (_E5, _E3))
    if five == 0 and three == 0:
        return 0.0
    both = abs(h) * five / math.sqrt((five + 0.01 * three) * y.size)
    return both if math.isfinite(both) else math.inf


def run(
    f: Function, y0: Array, t0: float, t1: float, rtol: float, atol: Array, events: Function | None,
    directions: Sequence[int], longest: float,
) -> tuple[Array, Array, int, int, int]:  # fmt: skip
    """Knots, states, status, event, evaluations; see `integrate`."""
    times, states, slope, count = [t0], [y0], f(t0, y0), 2
    h = _first_step(f, t0, y0, slope, t1 - t0, atol + rtol * np.abs(y0))
    before = events(t0, y0) if events is not None else np.zeros(0)
    grow = 10.0
    while times[-1] != t1:
        t, y = times[-1], states[-1]
        h = math.copysign(min(abs(h), longest), h)
        # A step that would end a hair before t1 is stretched to it: what is left would be a step made of rounding.
        reached = t1 if abs(t1 - t) <= abs(h) * (1 + 1e-10) else t + h
        # About twenty units in the last place of t: the time stands still. Written so that NaN ends here too.
        if not abs(reached - t) > 4e-15 * abs(t):
            return np.array(times), np.array(states), _STUCK, -1, count
        after, k = _step(f, t, y, reached - t, slope)
        count += len(_B)
        error = _error(y, after, reached - t, k, rtol, atol)
        # After a refusal the next step may not grow: the estimate has just been wrong once.
        if error >= 1:
            h, grow = (reached - t) * (max(0.2, 0.9 * error ** (-1 / 8)) if math.isfinite(error) else 0.2), 1.0
            continue
        h, grow = (reached - t) * (grow if error == 0 else min(grow, max(0.2, 0.9 * error ** (-1 / 8)))), 10.0
        which = -1
        if events is not None:
            values = events(reached, after)
            parts = {
                i: _locate(f, events, i, (t, y, reached - t, slope), before[i])
                for i, way in enumerate(directions)
                if (before[i] < 0 <= values[i] and way >= 0) or (before[i] > 0 >= values[i] and way <= 0)
            }
            if parts:
                which = min(parts, key=lambda i: parts[i])
                reached = t + parts[which] * (reached - t)
                after = _step(f, t, y, reached - t, slope)[0]
            before = values
        times.append(reached)
        states.append(after)
        if which >= 0:
            return np.array(times), np.array(states), _EVENT, which, count
        slope = f(reached, after)
    return np.array(times), np.array(states), _REACHED, -1, count


def _first_step(f: Function, t: float, y: Array, slope: Array, span: float, scale: Array) -> float:
    """See first_step of templates/ode.c."""

    def size(values: Array) -> float:
        return float(np.sqrt(np.mean((values / scale) ** 2)))

    d0, d1, tau = size(y), size(slope), abs(span)
    known = d0 > 1e-5 and d1 > 0
    tau = min(tau, d0 / d1) if known else tau
    probe = math.copysign((0.01 if known else 1e-6) * tau, span)
    if not math.isfinite(tau):
        return probe
    d2 = size(f(t + probe, y + probe * slope) - slope) / abs(probe)
    if d1 > 0 and d2 > 0:
        tau = min(tau, d1 / d2)
    moved = max(d1 * tau, d2 * tau * tau)
    tau *= (0.01 / moved) ** (1 / 8) if moved > 0 else 1e-3
    return math.copysign(min(tau, abs(span)), span) if tau > 0 else probe


def _locate(f: Function, events: Function, which: int, at: tuple[float, Array, float, Array], before: float) -> float:
    """The fraction of the step just behind the change of sign, by halving."""
    t, y, h, slope = at
    low, high = 0.0, 1.0
    while high - low > 1e-15 and low < (low + high) / 2 < high:
        middle = (low + high) / 2
        value: Any = events(t + middle * h, _step(f, t, y, middle * h, slope)[0])[which]
        low, high = (middle, high) if value * before > 0 else (low, middle)
    return high


def fixed(f: Function, states: Array, t0: float, h: float, parts: int) -> Array:
    """The classical method of order 4; fills the rows behind the first."""

    def slope(t: float, y: Array, c: float, change: Array) -> Array:
        return f(t + c * h, y + change)

    y = states[0]
    for s in range(len(states) - 1):
        for j in range(parts):
            t = t0 + (s * parts + j) * h
            y = y + increment(ARRAYS, CLASSICAL, functools.partial(slope, t, y), 0.0, h)
        states[s + 1] = y
    return states
