"""X' = X hat(xi), y' = F(t, X, y) by the explicit pair 8(5,3) in compiled loops, one member or many, to a tolerance.

F and the product X exp(Theta) are compiled kernels; see templates/pair853.c. Local errors are held below the tolerance of a run;
what they add up to is judged by a second run at another tolerance, so that the tolerance asked for holds for the states themselves.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, replace
from math import nan, sqrt

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError
from lie_codegen.flow.pair_lanes import run_lanes
from lie_codegen.flow.pair_library import FULL, MANY, compiled_pair, refuse
from lie_codegen.flow.pair_system import System
from lie_codegen.runtime.threads import share_out

#: Steps in one call of compiled code, after which Python looks whether somebody pressed Ctrl-C; room for as many knots, at first for fewer.
_STEPS, _FIRST_STEPS = 4096, 256
#: Members below which a thread costs more than it does.
_BLOCK = 64
#: Members of the pilot, and how many times more than the worst of them others may err: with steps of their own one of 10,000 erred 16 times as much.
_PILOT, _MARGIN = 16, 16.0
#: The run that is given has local errors so much smaller than the one it is compared with.
_RATIO = 16.0
#: Times at which two runs of a single member of a steady system are compared: the longer steps need not end at all that were asked for.
_COMPARED = 8
_SMALLEST, _MOST_RUNS = 1e-15, 6
#: Steps that are tried at most: some seconds.
_MOST_STEPS = 2**21


@dataclass(frozen=True, eq=False)
class PairRun:
    """States at times, of N members, and the steps of one.

    Attributes:
        X, y: (k, N, packed) and (k, N, size) at the times, Theta = 0.
        steps, rejected: of all members together.
        evaluations: of the rate, of many members eight at a time.
        error_estimate: of the entries of X and y: the difference to a run with longer steps, over what the tolerances of the two
            promise; of many members that of the pilot.
        knot_t, knot_h, knot_X, knot_y: the start, the length and the state of every step of a single member; else empty.
    """

    X: Array
    y: Array
    steps: int
    rejected: int
    evaluations: int
    error_estimate: float
    knot_t: Array
    knot_h: Array
    knot_X: Array
    knot_y: Array

    def within(self, system: System, knots: NDArray[np.intp], parts: Array) -> tuple[Array, Array]:
        """X and y the fractions `parts` of the way through the steps `knots`, by fresh steps of a single member."""
        at = np.ascontiguousarray(knots, dtype=np.intp)
        part = np.ascontiguousarray(parts, dtype=float)
        X, y = np.empty((len(at), system.packed)), np.empty((len(at), system.size))
        given, _kept = system.record()
        work = system.work()
        given.knot_t, given.knot_h = self.knot_t.ctypes.data, self.knot_h.ctypes.data
        given.knot_X, given.knot_y, given.work = self.knot_X.ctypes.data, self.knot_y.ctypes.data, work.ctypes.data
        library = compiled_pair()
        library.pair_within(
            ctypes.addressof(given), len(at), at.ctypes.data, part.ctypes.data, X.ctypes.data, y.ctypes.data
        )
        return X, y

    def at(self, system: System, times: Array) -> tuple[Array, Array]:
        """X and y at times within the run of a single member."""
        knots = np.searchsorted(self.knot_t, times, side="right") - 1
        return self.within(system, knots, (times - self.knot_t[knots]) / self.knot_h[knots])


def integrate(
    system: System, X0: Array, y0: Array, times: Array, *, rtol: float, atol: float, where: str, threads: int = 1
) -> PairRun:
    """States of N members at the times, the first of which is that of (X0, y0): errors below rtol max(1, |state|) or atol.

    One member is run at two tolerances, and again at smaller ones until they agree; of many the tolerance is found by
    a pilot of sixteen, then each holds its own local errors below it.

    Args:
        system: what is integrated.
        X0, y0: (N, packed) and (N, size), Theta = 0.
        times: (k,) increasing.
        rtol, atol: on the states at the times.
        where: for messages.
        threads: over which blocks are shared out.

    Raises:
        ComputationError: the tolerance is not reached, or a state leaves the range of doubles.
    """
    if len(X0) == 1:
        return _to_tolerance(system, X0, y0, times, rtol, atol, where)[0]
    chosen = np.unique(np.linspace(0, len(X0) - 1, min(_PILOT, len(X0))).astype(int))
    pilot, local = _to_tolerance(system.of_members(chosen), X0[chosen], y0[chosen], times, rtol, atol, where)

    return replace(_many(system, X0, y0, times, *local, where, threads), error_estimate=pilot.error_estimate)


def _to_tolerance(
    system: System, X0: Array, y0: Array, times: Array, rtol: float, atol: float, where: str
) -> tuple[PairRun, tuple[float, float]]:
    """A run whose difference to one with larger local errors says that it is good enough, and its local tolerances.

    Of several members, which are a pilot, the tolerances are those with which others like them are good enough, with the error
    that is then allowed for.
    """
    # The error of a run is in proportion to its local tolerance: of two whose tolerances differ by a factor r the
    # better errs by about their difference over r - 1. Twice that is reported, for proportion is not exact.
    share, one = 1.0, len(X0) == 1
    # the last time and those a whole number of places before it, but for the first
    apart = -(-(len(times) - 1) // _COMPARED) if one and system.steady else 1
    compared = slice((len(times) - 1) % apart or apart, None, apart)
    coarse = _once(system, X0, y0, np.concatenate([times[:1], times[compared]]), rtol, atol + rtol, where)
    X, y = coarse.X[1:], coarse.y[1:]
    for _ in range(_MOST_RUNS):
        share /= _RATIO
        local = max(rtol * share, _SMALLEST), max((atol + rtol) * share, _SMALLEST)
        fine = _once(system, X0, y0, times, *local, where)
        with np.errstate(invalid="ignore"):
            difference = max(_size(fine.X[compared] - X), _size(fine.y[compared] - y))
        scale = max(1.0, _size(fine.X), _size(fine.y))
        estimate = 2 * difference / (_RATIO - 1)
        # Rounding: no run of so many steps knows its states better.
        floor = 1e-15 * scale * sqrt(fine.steps / len(X0))
        goal = max(rtol * scale, atol, floor)
        if estimate <= goal:
            if one:
                return replace(fine, error_estimate=max(estimate, floor)), local
            slack = min(max(goal / (_MARGIN * max(estimate, floor)), 1 / _MARGIN), _RATIO)
            of_others = max(slack * local[0], _SMALLEST), max(slack * local[1], _SMALLEST)
            return replace(fine, error_estimate=max(_MARGIN * slack * estimate, floor)), of_others
        if local[1] <= _SMALLEST:
            break
        needed = estimate / max(rtol * scale, atol)
        if needed > _RATIO**2:  # far off: the next pair starts there
            share /= min(needed / _RATIO, 1e4)
            local = max(rtol * share, _SMALLEST), max((atol + rtol) * share, _SMALLEST)
            fine = _once(system, X0, y0, times, *local, where)
        X, y = fine.X[compared], fine.y[compared]
    raise ComputationError(
        f"{where}: local errors of {local[1]:.2g} leave an error of {estimate:.2g} at the times that were asked for; the motion is too "
        "sensitive for the tolerance: loosen rtol or shorten the time"
    )


def _size(of: Array) -> float:
    """The largest entry; NaN where one is."""
    return float(np.abs(of).max())


def _once(system: System, X0: Array, y0: Array, times: Array, rtol: float, atol: float, where: str) -> PairRun:
    """One run of some members at local tolerances."""
    run = _one if len(X0) == 1 else _many
    return run(system, X0, y0, times, rtol, atol, where)


def _many(
    system: System, X0: Array, y0: Array, times: Array, rtol: float, atol: float, where: str, threads: int = 1
) -> PairRun:
    """One run of members that are shared out over threads; one after another where lanes cannot be had."""
    X_out, y_out = np.empty((len(times), *X0.shape)), np.empty((len(times), *y0.shape))
    X_out[0], y_out[0] = X0, y0
    behind = X_out[1:], y_out[1:]

    def part(first: int, last: int) -> tuple[int, int, int]:
        some = slice(first, last)
        if all(system.blocks):
            record = run_lanes(
                system.of_members(some), (X0[some], y0[some]), times, behind, first, rtol, atol, _MOST_STEPS, where
            )
            return record.steps, record.rejected, record.evaluations
        runs = []
        for m in range(first, last):
            runs.append(
                _one(system.of_members(slice(m, m + 1)), X0[m : m + 1], y0[m : m + 1], times, rtol, atol, where)
            )
            X_out[:, m], y_out[:, m] = runs[-1].X[:, 0], runs[-1].y[:, 0]
        return sum(run.steps for run in runs), sum(run.rejected for run in runs), sum(run.evaluations for run in runs)

    steps, rejected, evaluations = np.sum(share_out(part, len(X0), threads, _BLOCK), axis=0).tolist()
    return PairRun(X_out, y_out, steps, rejected, evaluations, nan, *_no_knots(system))


def _one(system: System, X0: Array, y0: Array, times: Array, rtol: float, atol: float, where: str) -> PairRun:
    """One run of a single member, with its knots."""
    packed, size, k = system.packed, system.size, len(times)
    given, _kept = system.record()
    X_out, y_out = np.empty((k, 1, packed)), np.empty((k, 1, size))
    X_out[0], y_out[0] = X0, y0
    # one block of memory: the state, which is read in whole eights, the times behind the first, what a step works with
    state = packed + size
    block = np.empty(state + k - 1 + system.work_size)
    block[:packed], block[packed:state], block[state : state + k - 1] = X0[0], y0[0], times[1:]
    at = block.ctypes.data
    given.t, given.h, given.rtol, given.atol = float(times[0]), 0.0, rtol, atol
    given.reach, given.longest = system.reach, float(times[-1] - times[0])
    given.X, given.y, given.times, given.work = at, at + 8 * packed, at + 8 * state, at + 8 * (state + k - 1)
    given.count = k - 1
    given.X_out, given.y_out = X_out.ctypes.data + 8 * packed, y_out.ctypes.data + 8 * size
    knots: list[tuple[Array, ...]] = []
    library, status, room = compiled_pair(), FULL, min(_FIRST_STEPS, _STEPS)
    while status == FULL:
        rows = np.empty(room * (2 + packed + size))
        first, given.room = rows.ctypes.data, room
        given.knot_t, given.knot_h = first, first + 8 * room
        given.knot_X, given.knot_y = first + 16 * room, first + 8 * room * (2 + packed)
        status = library.pair_run(ctypes.addressof(given), room)
        knots.append(_rows(rows, room, given.knots, packed, size))
        if given.steps + given.rejected > _MOST_STEPS:
            status = MANY
        room = _STEPS
    refuse(status, given.t, atol, _MOST_STEPS, where)
    kept = knots[0] if len(knots) == 1 else tuple(np.concatenate(each) for each in zip(*knots, strict=True))
    return PairRun(X_out, y_out, given.steps, given.rejected, given.evaluations, nan, *kept)


def _rows(rows: Array, room: int, count: int, packed: int, size: int) -> tuple[Array, Array, Array, Array]:
    """Copies of t, h, X and y of so many knots of a block with room for more."""
    t, h, rest = rows[:count], rows[room : room + count], rows[2 * room :]
    X, y = rest[: count * packed], rest[room * packed : room * packed + count * size]
    return t.copy(), h.copy(), X.reshape(count, packed).copy(), y.reshape(count, size).copy()


def _no_knots(system: System) -> tuple[Array, Array, Array, Array]:
    return np.empty(0), np.empty(0), np.empty((0, system.packed)), np.empty((0, system.size))
