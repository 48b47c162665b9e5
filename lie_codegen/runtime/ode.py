"""Differential equations of compiled kernels, stepped in C: error control of order 8, events, dense output; see templates/ode.c."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError, InputError
from lie_codegen.runtime import ode_numpy
from lie_codegen.runtime.ode_field import Field, only_python
from lie_codegen.runtime.ode_library import Rules, ode_library, pointers

#: Results of a run: reached the end, an event, more knots are wanted, no step is short enough.
REACHED, EVENT, FULL, STUCK = 0, 1, 2, 3
_FIRST_KNOTS, _MOST_DOUBLES = 256, 2**27
#: From so many knots on, steps of the present length that would fill the memory many times over end a run at once.
_ENOUGH_KNOTS, _HOPELESS = 8192, 64


@dataclass(frozen=True, eq=False)
class Motion:
    """A solution between t[0] and t[-1]: the knots of the steps, and any time between.

    A time alone in its step is a fresh, shorter step, as exact as the steps are. Where a step holds several, they lie on the
    pair's polynomial of order 7, which costs no more for a thousand than for four; one of them is taken by a fresh step too, and
    where the two differ by more than `allowed` the polynomial is taken over less of the step.

    Attributes:
        t: (K,) knots, monotone.
        y: (K, n) states.
        status: REACHED or EVENT, or STUCK where no step was short enough or f had no finite value.
        event: number of the event that ended it; -1 if none.
        evaluations: of f.
        allowed: (n,) error of y that a step may have; where none was asked for (atol infinite), rtol of the largest |y|.
    """

    t: Array
    y: Array
    status: int
    event: int
    evaluations: int
    allowed: Array
    field: Field = field(repr=False)

    def at(self, t: ArrayLike) -> Array:
        """(...,) -> (..., n).

        Raises:
            InputError: a time outside of the run.
        """
        wanted = np.asarray(t, dtype=float)
        flat = np.ascontiguousarray(wanted.ravel())
        sign = 1.0 if self.t[-1] >= self.t[0] else -1.0
        if np.any(sign * flat[1:] < sign * flat[:-1]):
            order = np.argsort(sign * flat, kind="stable")
            found = np.empty((flat.size, self.field.size))
            found[order] = self.at(flat[order])
            return found.reshape((*wanted.shape, self.field.size))
        slack = 1e-12 * max(1.0, float(np.max(np.abs(self.t))))
        if flat.size and (
            np.min(sign * flat) < sign * self.t[0] - slack or np.max(sign * flat) > sign * self.t[-1] + slack
        ):
            raise InputError(f"the solution is known from t = {self.t[0]:.9g} to {self.t[-1]:.9g}")
        knot = np.clip(np.searchsorted(sign * self.t, sign * flat, side="right") - 1, 0, len(self.t) - 1).astype(
            np.intp
        )
        found = np.empty((flat.size, self.field.size))
        library = ode_library()
        if library is None or only_python(self.field):
            for i, (moment, k) in enumerate(zip(flat, knot, strict=True)):
                found[i] = ode_numpy.partial(self.field, self.t[k], self.y[k], float(moment) - self.t[k])
        else:
            work = np.empty(int(library.lie_codegen_ode_work(self.field.size, 0)))
            library.lie_codegen_ode_at(
                ctypes.byref(self.field.record), *pointers(self.t, self.y), ctypes.c_ssize_t(len(self.t)), ctypes.c_ssize_t(flat.size),
                *pointers(flat, knot, self.allowed, found, work),
            )  # fmt: skip
            self.field.raise_pending()
        return found.reshape((*wanted.shape, self.field.size))


def integrate(
    rate: Field,
    start: ArrayLike,
    t0: float,
    t1: float,
    *,
    rtol: float = 1e-12,
    atol: ArrayLike = 1e-14,
    events: Field | None = None,
    directions: Sequence[int] = (),
    longest: float = math.inf,
) -> Motion:
    """y' = f(t, y) from t0 to t1 or to the first event, by steps of order 8(5, 3).

    Args:
        rate: f.
        start: (n,).
        t0, t1: in either order.
        rtol, atol: error of a step, relative and absolute (a number, or one a component).
        events: values whose changes of sign end the run.
        directions: one an event: 1 from negative to positive, -1 the other way, 0 both.
        longest: no step is longer.

    Raises:
        ComputationError: more knots than memory should hold.
    """
    y0 = np.array(start, dtype=float).ravel()
    tolerance = np.ascontiguousarray(np.broadcast_to(np.asarray(atol, dtype=float), y0.shape))
    if t0 == t1:
        return Motion(np.array([t0]), y0[None], REACHED, -1, 0, _allowed(y0[None], rtol, tolerance), rate)
    library = ode_library()
    if library is None or only_python(rate, events):
        found = ode_numpy.run(rate, y0, t0, t1, rtol, tolerance, events, directions, longest)
        return Motion(*found, _allowed(found[1], rtol, tolerance), rate)
    wanted = np.array([*directions, 0], dtype=np.intp)
    rules = Rules(rtol, tolerance.ctypes.data, 0.0, longest, wanted.ctypes.data, len(directions))
    work = np.empty(int(library.lie_codegen_ode_work(rate.size, len(directions))))
    none = ctypes.c_void_p(None)
    pieces_t, pieces_y, count, result = [np.array([t0])], [y0[None]], _FIRST_KNOTS, np.zeros(4)
    evaluations, held = 0, 1
    while True:
        times, states = np.empty(count), np.empty((count, rate.size))
        times[0], states[0] = pieces_t[-1][-1], pieces_y[-1][-1]
        status = library.lie_codegen_ode_run(
            ctypes.byref(rate.record), none if events is None else ctypes.byref(events.record), ctypes.byref(rules),
            ctypes.c_double(t1), ctypes.c_ssize_t(count), *pointers(times, states, work, result),
        )  # fmt: skip
        for each in (rate, events):
            if each is not None:
                each.raise_pending()
        kept = int(result[0])
        pieces_t.append(times[1:kept].copy())
        pieces_y.append(states[1:kept].copy())
        evaluations, rules.first, held = evaluations + int(result[3]), result[1], held + kept - 1
        if status != FULL:
            event = int(result[2]) if status == EVENT else -1
            t, y = np.concatenate(pieces_t), np.concatenate(pieces_y)
            return Motion(t, y, status, event, evaluations, _allowed(y, rtol, tolerance), rate)
        ahead = (kept - 1) * abs(t1 - times[kept - 1]) / max(abs(times[kept - 1] - times[0]), 5e-324)
        # Where the steps still shrink they go towards an end of the solution, and will soon be refused there.
        steady = abs(times[kept - 1] - times[kept - 2]) > 0.5 * abs(times[1] - times[0])
        hopeless = held > _ENOUGH_KNOTS and steady and ahead * rate.size > _HOPELESS * _MOST_DOUBLES
        if held * rate.size > _MOST_DOUBLES or hopeless:
            raise ComputationError(
                f"the solution takes {held} steps up to t = {times[kept - 1]:.6g} of {t1:.6g}: it is stiff, or too long"
            )
        count = min(2 * count, max(_FIRST_KNOTS, _MOST_DOUBLES // (8 * rate.size)))


def fixed_steps(rate: Field, start: ArrayLike, t0: float, h: float, spans: int, parts: int = 1) -> Array:
    """(spans + 1, n) states every `parts` steps of length h of the classical method of order 4, with f smooth or not."""
    states = np.empty((spans + 1, rate.size))
    states[0] = np.asarray(start, dtype=float).ravel()
    library = ode_library()
    if library is None or only_python(rate):
        return ode_numpy.fixed(rate, states, t0, h, parts)
    work = np.empty(6 * rate.size)
    library.lie_codegen_ode_fixed(
        ctypes.byref(rate.record), ctypes.c_double(t0), ctypes.c_double(h), ctypes.c_ssize_t(spans),
        ctypes.c_ssize_t(parts), *pointers(states, work),
    )  # fmt: skip
    rate.raise_pending()
    return states


def _allowed(y: Array, rtol: float, atol: Array) -> Array:
    return np.asarray(np.where(np.isinf(atol), 0.0, atol) + rtol * np.abs(y).max(axis=0))
