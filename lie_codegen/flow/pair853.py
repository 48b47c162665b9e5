"""X' = X hat(xi), y' = F(t, X, y) by the explicit pair 8(5,3) in compiled loops, one member or many, to a tolerance.

F and the product X exp(Theta) are compiled kernels; see templates/pair853.c. Local errors are held below the tolerance of a run;
what they add up to is judged by a second run at another tolerance, so that the tolerance asked for holds for the states themselves.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, replace
from itertools import accumulate
from math import nan, sqrt

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError
from lie_codegen.flow.pair_lanes import run_lanes
from lie_codegen.flow.pair_library import DONE, FULL, MANY, compiled_pair, refuse
from lie_codegen.flow.pair_system import System
from lie_codegen.runtime.outputs import empty
from lie_codegen.runtime.threads import share_out

#: Steps in one call of compiled code, after which Python looks whether somebody pressed Ctrl-C; room for as many knots, at first for fewer.
_STEPS, _FIRST_STEPS = 4096, 256
#: Members below which a thread costs more than it does.
_BLOCK = 64
#: Members of the pilot, at least and at most, of how many it is one, and how many times more than the worst of them others may err: of 10,000 with
#: steps of their own some err up to ten times as much as the worst of 128, whose steps happened to look better than they were.
_PILOT, _LARGEST_PILOT, _PART, _MARGIN = 16, 128, 32, 16.0
#: The run that is given has local errors so much smaller than the one it is compared with.
_RATIO = 16.0
#: By so much its steps are shorter.
_SHORTER = _RATIO ** (-1 / 8)
#: Where steps go as they like the first run of a member has local errors of this part of the tolerance, by Theta and by elements: of hundred
#: loops on SO(3) and SE(3) at 1e-5 to 1e-12 nine needed a third run with 1, none with 1/4, for a tenth more steps; by elements of
#: three hundred on SO(3) four with 1/4, none with 1/8, for a fifteenth more.
_FREE_SHARE, _FREE_SHARE_SHORT = 0.25, 0.125
#: An interpolated state may err so many times more than a step: once, where the errors of steps add up. The same part of the tolerance for both.
_BETWEEN, _BETWEEN_SHORT = 2.0, 4.0
_SMALLEST, _MOST_RUNS = 1e-15, 6
#: Doubles of a line of memory: vectors that lie across two take longer.
_LINE = 8
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

    def estimated(self, error: float) -> PairRun:
        """The same with this estimate of its error."""
        counts = self.steps, self.rejected, self.evaluations
        return PairRun(self.X, self.y, *counts, error, self.knot_t, self.knot_h, self.knot_X, self.knot_y)

    def within(self, system: System, knots: NDArray[np.intp], parts: Array) -> tuple[Array, Array]:
        """X and y the fractions `parts` of the way through the steps `knots`, by fresh steps of a single member."""
        if self.knot_X.shape[1] != system.kept:  # from a file of before states were kept as elements
            return self._lifted(system).within(system, knots, parts)
        at = np.ascontiguousarray(knots, dtype=np.intp)
        part = np.ascontiguousarray(parts, dtype=float)
        X, y = np.empty((len(at), system.packed)), np.empty((len(at), system.size))
        given = system.record()
        work = system.work()
        given.knot_t, given.knot_h = self.knot_t.ctypes.data, self.knot_h.ctypes.data
        given.knot_X, given.knot_y, given.work = self.knot_X.ctypes.data, self.knot_y.ctypes.data, work.ctypes.data
        library = compiled_pair()
        library.pair_within(
            ctypes.addressof(given), len(at), at.ctypes.data, part.ctypes.data, X.ctypes.data, y.ctypes.data
        )
        return X, y

    def _lifted(self, system: System) -> PairRun:
        """The same with the elements of the knots in y instead of Theta = 0 and X beside it."""
        lift, vectors = system.lift, system.size - system.group
        behind = self.knot_y[:, self.knot_y.shape[1] - vectors :]
        elements = np.array([lift(X) for X in self.knot_X]) if lift is not None else self.knot_y[:, :0]
        return replace(self, knot_X=self.knot_X[:, :0], knot_y=np.concatenate([elements, behind], axis=1))

    def at(self, system: System, times: Array) -> tuple[Array, Array]:
        """X and y at times within the run of a single member."""
        knots = np.searchsorted(self.knot_t, times, side="right") - 1
        return self.within(system, knots, (times - self.knot_t[knots]) / self.knot_h[knots])


def integrate(
    system: System, X0: Array, y0: Array, times: Array, *, rtol: float, atol: float, where: str, threads: int = 1
) -> PairRun:
    """States of N members at the times, the first of which is that of (X0, y0): errors below rtol max(1, |state|) or atol.

    One member is run at two tolerances, and again at smaller ones until they agree; of many the tolerance is found by
    a pilot of 16 to 128, then each holds its own local errors below it.

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
    some = min(max(_PILOT, len(X0) // _PART), _LARGEST_PILOT, len(X0))
    chosen = np.linspace(0, len(X0) - 1, some).astype(int)
    pilot, local = _to_tolerance(system.of_members(chosen), X0[chosen], y0[chosen], times, rtol, atol, where)

    return _many(system, X0, y0, times, *local, where, threads).estimated(pilot.error_estimate)


def _to_tolerance(
    system: System, X0: Array, y0: Array, times: Array, rtol: float, atol: float, where: str
) -> tuple[PairRun, tuple[float, float]]:
    """A run whose difference to one with larger local errors says that it is good enough, and its local tolerances.

    Of several members, which are a pilot, the tolerances are those with which others like them are good enough, with the error
    that is then allowed for.
    """
    # The error of a run is in proportion to its local tolerance: of two whose tolerances differ by a factor r the
    # better errs by about their difference over r - 1. Twice that is reported, for proportion is not exact.
    one = len(X0) == 1
    free = one and system.is_interpolated and len(times) > 2  # steps go as they like, and all times cost little
    share = (_FREE_SHARE if system.lift is None else _FREE_SHARE_SHORT) if free else 1.0
    found = None
    if one:
        both = (*_local(rtol, atol, share), *_local(rtol, atol, share / _RATIO), _SHORTER if free else 1.0)
        found = _twice(system, X0, y0, times, both)
    if found is None:
        coarse = _once(system, X0, y0, times, *_local(rtol, atol, share), where)
        X, y, steps = coarse.X[1:], coarse.y[1:], coarse.steps
    shorter = 1.0
    for _ in range(_MOST_RUNS):
        share /= _RATIO
        local = _local(rtol, atol, share)
        if free:  # where the reach limits steps two runs would be the same
            shorter *= _SHORTER
        if found is None:
            fine = _once(system.within(shorter), X0, y0, times, *local, where)
            with np.errstate(invalid="ignore"):
                difference = max(_size(fine.X[1:] - X), _size(fine.y[1:] - y))
            size = max(_size(fine.X), _size(fine.y))
        else:
            fine, difference, size, steps = found
            found = None
        scale = max(1.0, size)
        # errors go as the eighth power of the steps: where these hardly became shorter, the tolerances promise too much
        ratio = min(_RATIO, max((fine.steps / steps) ** 8, 2.0)) if free else _RATIO
        estimate = 2 * difference / (ratio - 1)
        # Rounding: no run of so many steps knows its states better.
        floor = 1e-15 * scale * sqrt(fine.steps / len(X0))
        goal = max(rtol * scale, atol, floor)
        if estimate <= goal:
            if one:
                return fine.estimated(max(estimate, floor)), local
            slack = min(max(goal / (_MARGIN * max(estimate, floor)), 1 / _MARGIN), _RATIO)
            of_others = max(slack * local[0], _SMALLEST), max(slack * local[1], _SMALLEST)
            return fine.estimated(max(_MARGIN * slack * estimate, floor)), of_others
        if local[1] <= _SMALLEST:
            break
        needed = estimate / max(rtol * scale, atol)
        if needed > _RATIO**2:  # far off: the next pair starts there
            share /= min(needed / _RATIO, 1e4)
            fine = _once(system.within(shorter), X0, y0, times, *_local(rtol, atol, share), where)
        X, y, steps = fine.X[1:], fine.y[1:], fine.steps
    raise ComputationError(
        f"{where}: local errors of {local[1]:.2g} leave an error of {estimate:.2g} at the times that were asked for; the motion is too "
        "sensitive for the tolerance: loosen rtol or shorten the time"
    )


def _local(rtol: float, atol: float, share: float) -> tuple[float, float]:
    """Relative and absolute local errors of that share of the tolerance."""
    return max(rtol * share, _SMALLEST), max((atol + rtol) * share, _SMALLEST)


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
    X_out, y_out = (empty((len(times), *each.shape), each.dtype) for each in (X0, y0))
    X_out[0], y_out[0] = X0, y0
    behind = X_out[1:], y_out[1:]

    def part(first: int, last: int) -> tuple[int, int, int]:
        some = slice(first, last)
        if all(system.blocks):
            return run_lanes(
                system.of_members(some), (X0[some], y0[some]), times, behind, first, rtol, atol, _MOST_STEPS, where
            )
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
    # a system that can be interpolated steps to its end, and the states between come afterwards
    between = system.is_interpolated and k > 2
    given = system.record()
    X_out, y_out = np.empty((k, 1, packed)), np.empty((k, 1, size))
    X_out[0], y_out[0] = X0, y0
    # one block of memory: the state, which is read in whole eights, the times behind the first, what steps and interpolation work with
    state = packed + size
    work = state + k - 1
    dense = work + system.work_size
    block = np.empty(dense + system.between_size if between else dense)
    block[:packed], block[packed:state], block[state:work] = X0[0], y0[0], times[1:]
    at = block.ctypes.data
    given.t, given.h, given.rtol, given.atol = float(times[0]), 0.0, rtol, atol
    given.longest = float(times[-1] - times[0])
    given.X, given.y, given.work, given.dense = at, at + 8 * packed, at + 8 * work, at + 8 * dense
    wanted = at + 8 * state, k - 1, X_out.ctypes.data + 8 * packed, y_out.ctypes.data + 8 * size
    ahead = k - 2 if between else 0  # outputs that the run does not know of
    given.times, given.count = wanted[0] + 8 * ahead, wanted[1] - ahead
    given.X_out, given.y_out = wanted[2] + 8 * packed * ahead, wanted[3] + 8 * size * ahead
    knots: list[tuple[Array, ...]] = []
    library, status, room = compiled_pair(), FULL, min(_FIRST_STEPS, _STEPS)
    library.pair_lift(ctypes.addressof(given))
    widths: tuple[int, ...] = (1, 1, system.kept, size)
    widths = (*widths, size, system.turns) if between else widths
    while status == FULL:
        rows = np.empty((room + 1) * sum(widths))  # a row more: the end
        first, given.room = rows.ctypes.data, room
        places = [first + 8 * (room + 1) * before for before in accumulate(widths[:-1], initial=0)]
        given.knot_t, given.knot_h, given.knot_X, given.knot_y = places[:4]
        if between:
            given.knot_slope, given.knot_theta = places[4:]
        status = library.pair_run(ctypes.addressof(given), room)
        knots.append(_rows(rows, room + 1, given.knots + (between and status == DONE), widths))
        if given.steps + given.rejected > _MOST_STEPS:
            status = MANY
        room = _STEPS
    refuse(status, given.t, atol, _MOST_STEPS, where)
    kept = knots[0] if len(knots) == 1 else tuple(np.concatenate(each) for each in zip(*knots, strict=True))
    if between:
        given.times, given.count, given.X_out, given.y_out = wanted
        given.knot_t, given.knot_h, given.knot_X, given.knot_y, given.knot_slope, given.knot_theta = (
            each.ctypes.data for each in kept
        )
        library.pair_between(ctypes.addressof(given), given.steps, _between(system))
        kept = tuple(each[:-1] for each in kept[:4])
    return PairRun(X_out, y_out, given.steps, given.rejected, given.evaluations, nan, *kept)


def _twice(
    system: System, X0: Array, y0: Array, times: Array, tolerances: tuple[float, float, float, float, float]
) -> tuple[PairRun, float, float, int] | None:
    """One member at two tolerances (relative and absolute local errors of one, of the other; the factor of the reach of the other), in one call.

    Returns:
        The second run, its largest difference to the first, its size, the steps of the first; None where one of them needs more
        than the first room for knots and one to each time at which steps end, or fails: `_once` says how.
    """
    between = system.is_interpolated and len(times) > 2
    room = _FIRST_STEPS + (0 if between else len(times))
    if room > _STEPS:
        return None
    packed, size, kept, k = system.packed, system.size, system.kept, len(times)
    state, rows = packed + size, room + 1
    given = system.record()
    # behind each other: the start, tolerances, found, times, the states of the run with longer steps; then of each of the two runs where it is,
    # what steps and interpolation work with, knots by columns
    common = (state, 5, 5, k - 1, (k - 1) * state)
    own = (
        system.work_size, packed, size, system.between_size if between else 0, rows, rows, rows * kept, rows * size,
        *((rows * size, rows * system.turns) if between else ()),
    )  # fmt: skip
    places = [0, *accumulate((*common, *own))]
    apart = -(-sum(own) // _LINE) * _LINE
    block, X, y = np.empty(places[5] + 2 * apart + _LINE), np.empty((k, 1, packed)), np.empty((k, 1, size))
    at = block.ctypes.data
    lead = -(at // 8 + places[5]) % _LINE  # slopes of a stage begin with a line of memory
    block, at = block[lead:], at + 8 * lead
    block[:packed], block[packed:state], block[state : state + 5] = X0[0], y0[0], tolerances
    block[places[3] : places[4]] = times[1:]
    X[0], y[0] = X0, y0
    start, asked, found, given.times, other, given.work, given.X, given.y, given.dense, *knots = [
        at + 8 * place for place in places[:-1]
    ]
    given.knot_t, given.knot_h, given.knot_X, given.knot_y = knots[:4]
    if between:
        given.knot_slope, given.knot_theta = knots[4:]
    given.t, given.longest, given.count = times[0], times[-1] - times[0], k - 1
    given.room = room
    given.X_out, given.y_out = X.ctypes.data + 8 * packed, y.ctypes.data + 8 * size
    status = compiled_pair().pair_twice(
        ctypes.addressof(given), start, asked, room, _between(system), apart, other, found
    )
    if status != DONE:
        return None
    off_X, off_y, size_X, size_y, coarse = block[places[2] : places[3]].tolist()
    knots_kept = _rows(block[places[9] :], rows, given.steps, (1, 1, kept, size))
    run = PairRun(X, y, given.steps, given.rejected, given.evaluations, nan, *knots_kept)
    return run, max(off_X, off_y), max(size_X, size_y), int(coarse)


def _between(system: System) -> float:
    return _BETWEEN if system.lift is None else _BETWEEN_SHORT


def _rows(rows: Array, room: int, count: int, widths: tuple[int, ...]) -> tuple[Array, ...]:
    """Copies of t, h, X, y and what else of so many knots of a block with room for more."""
    found, place = [], 0
    for k, width in enumerate(widths):
        part = rows[place : place + count * width].copy()
        found.append(part.reshape(count, width) if k > 1 else part)
        place += room * width
    return tuple(found)


def _no_knots(system: System) -> tuple[Array, Array, Array, Array]:
    return np.empty(0), np.empty(0), np.empty((0, system.kept)), np.empty((0, system.size))
