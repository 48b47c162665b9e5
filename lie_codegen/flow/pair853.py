"""X' = X hat(xi), y' = F(t, X, y) by the explicit pair 8(5,3) in compiled loops, one member or many, to a tolerance.

F and the product X exp(Theta) are compiled kernels; see templates/pair853.c. Local errors are held below the tolerance of a run;
what they add up to is judged by a second run at another tolerance, so that the tolerance asked for holds for the states themselves.
"""

from __future__ import annotations

import ctypes
from itertools import accumulate, pairwise
from math import inf, nan, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError
from lie_codegen.flow.pair_lanes import run_lanes
from lie_codegen.flow.pair_library import DONE, FULL, MANY, Twice, compiled_pair, refuse
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
#: Times up to which a system keeps the memory of a run, a third of a megabyte: beyond, what it costs to have it anew is little beside the run.
_MOST_TIMES_KEPT = 1024
#: Steps that are tried at most: some seconds.
_MOST_STEPS = 2**21


class PairRun(NamedTuple):
    """States at times, of N members, and the steps of one.

    Attributes:
        X, y: (k, N, packed) and (k, N, size) at the times, Theta = 0.
        steps, rejected: of all members together.
        evaluations: of the rate, of many members eight at a time.
        error_estimate: of the entries of X and y: the difference to a run with longer steps, over what the tolerances of the two
            promise; of many members that of the pilot.
        left: what interpolation between steps may add to the error.
        knots: (steps, 2 + m + size) the start, the length and the state of every step of a single member: `knot_t`, `knot_h`, `knot_X`,
            `knot_y`; else (0, ...).
    """

    X: Array
    y: Array
    steps: int
    rejected: int
    evaluations: int
    error_estimate: float
    left: float
    knots: Array

    @property
    def knot_t(self) -> Array:
        """When the steps begin."""
        return np.ascontiguousarray(self.knots[:, 0])

    @property
    def knot_h(self) -> Array:
        """How long they are."""
        return np.ascontiguousarray(self.knots[:, 1])

    @property
    def knot_X(self) -> Array:
        """X where they begin; nothing where y holds it."""
        return np.ascontiguousarray(self.knots[:, 2 : self.knots.shape[1] - self.y.shape[-1]])

    @property
    def knot_y(self) -> Array:
        """y where they begin."""
        return np.ascontiguousarray(self.knots[:, self.knots.shape[1] - self.y.shape[-1] :])

    def estimated(self, error: float) -> PairRun:
        """The same with this estimate of its error."""
        if error == self.error_estimate:
            return self
        return PairRun(self.X, self.y, self.steps, self.rejected, self.evaluations, error, self.left, self.knots)

    def within(self, system: System, knots: NDArray[np.intp], parts: Array) -> tuple[Array, Array]:
        """X and y the fractions `parts` of the way through the steps `knots`, by fresh steps of a single member."""
        if self.knots.shape[1] != 2 + system.kept + system.size:  # from a file of before states were kept as elements
            return self._lifted(system).within(system, knots, parts)
        at = np.ascontiguousarray(knots, dtype=np.intp)
        part = np.ascontiguousarray(parts, dtype=float)
        X, y = np.empty((len(at), system.packed)), np.empty((len(at), system.size))
        given, columns = system.record(), (self.knot_t, self.knot_h, self.knot_X, self.knot_y)
        work = system.work()
        given.knot_t, given.knot_h, given.knot_X, given.knot_y = (each.ctypes.data for each in columns)
        given.work = work.ctypes.data
        library = compiled_pair()
        library.pair_within(
            ctypes.addressof(given), len(at), at.ctypes.data, part.ctypes.data, X.ctypes.data, y.ctypes.data
        )
        return X, y

    def _lifted(self, system: System) -> PairRun:
        """The same with the elements of the knots in y instead of Theta = 0 and X beside it."""
        lift, vectors, y = system.lift, system.size - system.group, self.knot_y
        elements = np.array([lift(X) for X in self.knot_X]) if lift is not None else y[:, :0]
        knots = np.concatenate([self.knots[:, :2], elements, y[:, y.shape[1] - vectors :]], axis=1)
        return self._replace(y=np.empty((0, 1, system.size)), knots=knots)

    def at(self, system: System, times: Array) -> tuple[Array, Array]:
        """X and y at times within the run of a single member."""
        begun = self.knot_t
        knots = np.searchsorted(begun, times, side="right") - 1
        return self.within(system, knots, (times - begun[knots]) / self.knot_h[knots])


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
    pilot, share = _to_tolerance(system.of_members(chosen), X0[chosen], y0[chosen], times, rtol, atol, where)
    whole = _many(system, X0, y0, times, *_local(rtol, atol, share), where, threads)
    return whole.estimated(pilot.error_estimate)


def _to_tolerance(
    system: System, X0: Array, y0: Array, times: Array, rtol: float, atol: float, where: str
) -> tuple[PairRun, float]:
    """A run whose difference to one with larger local errors says that it is good enough, and what part of the tolerance its local errors are.

    Of several members, which are a pilot, that with which others like them are good enough, with the error that is then allowed for.
    """
    one = len(X0) == 1
    free = one and system.is_interpolated and len(times) > 2  # steps go as they like, and all times cost little
    share = (_FREE_SHARE if system.lift is None else _FREE_SHARE_SHORT) if free else 1.0
    found = None
    if one:
        found = _twice(system, X0, y0, times, rtol, atol, share, free)
    coarse = _once(system, X0, y0, times, *_local(rtol, atol, share), where) if found is None else None
    shorter = 1.0
    for _ in range(_MOST_RUNS):
        share /= _RATIO
        if free:  # where the reach limits steps two runs would be the same
            shorter *= _SHORTER
        if found is not None:
            fine, size, estimate = found
            found = None
        elif coarse is not None:
            fine = _once(system.within(shorter), X0, y0, times, *_local(rtol, atol, share), where)
            size = max(_size(fine.X), _size(fine.y))
            estimate = _estimate(
                _difference(system, fine, coarse, times, free), fine.left, fine.steps, coarse.steps, free
            )
        scale = size if size > 1 else 1.0
        # Rounding: no run of so many steps knows its states better.
        floor = 1e-15 * scale * sqrt(fine.steps / len(X0))
        goal = max(rtol * scale, atol, floor)
        if estimate <= goal:
            if one:
                return fine.estimated(estimate if estimate > floor else floor), share
            slack = min(max(goal / (_MARGIN * max(estimate, floor)), 1 / _MARGIN), _RATIO)
            return fine.estimated(max(_MARGIN * slack * estimate, floor)), slack * share
        local = _local(rtol, atol, share)
        if local[1] <= _SMALLEST:
            break
        needed = estimate / max(rtol * scale, atol)
        if needed > _RATIO**2:  # far off: the next pair starts there
            share /= min(needed / _RATIO, 1e4)
            fine = _once(system.within(shorter), X0, y0, times, *_local(rtol, atol, share), where)
        coarse = fine
        if one and system.reach == inf:  # over lanes the first of two runs costs nothing, though it was there already
            found = _twice(system, X0, y0, times, rtol, atol, share, free)
    raise ComputationError(
        f"{where}: local errors of {local[1]:.2g} leave an error of {estimate:.2g} at the times that were asked for; the motion is too "
        "sensitive for the tolerance: loosen rtol or shorten the time"
    )


def _estimate(difference: float, left: float, steps: int, coarse: float, free: bool) -> float:
    """The error of the better of two runs.

    It is in proportion to the local tolerance: of two whose tolerances differ by a factor r the better errs by about their difference over
    r - 1. Twice that is reported, for proportion is not exact. Where steps go as they like errors go as the eighth power of these: where
    they hardly became shorter, the tolerances promise too much.
    """
    ratio = min(_RATIO, max((steps / coarse) ** 8, 2.0)) if free else _RATIO
    return 2 * difference / (ratio - 1) + left


def _difference(system: System, fine: PairRun, coarse: PairRun, times: Array, free: bool) -> float:
    """How far two runs are apart: at the times that are wanted; or, where states between steps are known and these are fewer, where the
    steps of the first end, at which it is as good as it gets."""
    X, y, X_other, y_other = fine.X[1:], fine.y[1:], coarse.X[1:], coarse.y[1:]
    if free and coarse.steps < len(times) - 1:
        X, y = fine.at(system, np.append(coarse.knot_t[1:], times[-1]))
        X_other, y_other = coarse.within(system, np.arange(coarse.steps), np.ones(coarse.steps))
    with np.errstate(invalid="ignore"):
        return max(_size(X - X_other), _size(y - y_other))


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
    return PairRun(X_out, y_out, steps, rejected, evaluations, nan, 0.0, np.empty((0, 2 + system.kept + system.size)))


def _one(system: System, X0: Array, y0: Array, times: Array, rtol: float, atol: float, where: str) -> PairRun:
    """One run of a single member, with its knots."""
    packed, size, k = system.packed, system.size, len(times)
    # a system that can be interpolated steps to its end, and the states between come afterwards
    between = system.is_interpolated and k > 2
    given = system.record()
    given.both = system.both
    X_out, y_out = np.empty((k, 1, packed)), np.empty((k, 1, size))
    X_out[0], y_out[0] = X0, y0
    # one block of memory: the state, which is read in whole eights, the times behind the first, what steps and interpolation work with
    state = packed + size
    work = state + k - 1
    dense = work + system.work_size
    block = np.zeros(dense + system.between_size if between else dense)  # the padding behind a state is read
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
    left = 0.0
    if between:
        given.times, given.count, given.X_out, given.y_out = wanted
        given.knot_t, given.knot_h, given.knot_X, given.knot_y, given.knot_slope, given.knot_theta = (
            each.ctypes.data for each in kept
        )
        left = library.pair_between(ctypes.addressof(given), given.steps, _between(system))
        kept = tuple(each[:-1] for each in kept[:4])
    return PairRun(X_out, y_out, given.steps, given.rejected, given.evaluations, nan, left, np.column_stack(kept))


def _twice(
    system: System, X0: Array, y0: Array, times: Array, rtol: float, atol: float, share: float, free: bool
) -> tuple[PairRun, float, float] | None:
    """One member at two tolerances, that share of what is asked for and less, in one call; `free` as in `_to_tolerance`.

    Returns:
        The second run, its size, an estimate of its error; None where one of them needs more
        than half the steps of a call and one to each time at which steps end, or fails: `_once` says how.
    """
    ends = 0 if free else len(times)
    sizes = _FIRST_STEPS + ends, _STEPS // 2 + ends
    if sizes[0] > _STEPS:
        return None
    try:
        room: _Room = system.idle.pop()  # pop and append are atomic: nobody else uses it
        if room.times != len(times) or room.steps not in sizes:
            raise IndexError
    except IndexError:
        room = _Room(system, len(times), sizes[0], free)
    status, found = room.run(X0, y0, times, (rtol, atol, share))
    if status == FULL and sizes[0] == room.steps < sizes[1]:
        room = _Room(system, len(times), sizes[1], free)
        _, found = room.run(X0, y0, times, (rtol, atol, share))
    if room.times <= _MOST_TIMES_KEPT:
        system.idle.append(room)
    return found


class _Room:
    """What both runs of a single member read and write, kept by its system for the next call: compiled code changes nothing else.

    Args:
        system: what is integrated.
        times: how many.
        steps: for which there is room.
        free: whether states between steps are interpolated.
    """

    def __init__(self, system: System, times: int, steps: int, free: bool) -> None:
        packed, size, kept, k, rows = system.packed, system.size, system.kept, times, steps + 1
        state, width = packed + size, 2 + kept + size
        # behind each other: the start, what is found, times, states of the run that is given and of the other, knots row by row; then of each of
        # the two runs where it is, what steps and interpolation work with, knots by columns
        common = (packed, size, 7, k, k * packed, k * size, (k - 1) * (state + packed), rows * width)
        own = (
            system.work_size, packed, size, system.between_size if free else 0, rows, rows, rows * kept, rows * size,
            *((rows * size, rows * system.turns) if free else ()),
        )  # fmt: skip
        places = [0, *accumulate((*common, *own))]
        first = len(common)
        apart = -(-sum(own) // _LINE) * _LINE
        block = np.zeros(places[first] + 2 * apart + _LINE)
        lead = -(block.ctypes.data // 8 + places[first]) % _LINE  # slopes of a stage begin with a line of memory
        block = block[lead:]
        parts = [block[a:b] for a, b in pairwise(places[: first + 1])]
        self.times, self.steps, self._goal, self._free = k, steps, (0.0, 0.0, 0.0), free
        self._X0, self._y0, self._found, self._times, X, y, _, knots = parts
        self._X, self._y, self._knots = X.reshape(k, 1, packed), y.reshape(k, 1, size), knots.reshape(rows, width)
        self._pair, self._both, at = system.record(), Twice(), [block.ctypes.data + 8 * place for place in places]
        pair, both = self._pair, self._both
        both.start, _, both.found, pair.times, pair.X_out, pair.y_out, both.other, both.knots = at[:first]
        pair.work, pair.X, pair.y, pair.dense, pair.knot_t, pair.knot_h, pair.knot_X, pair.knot_y = at[
            first : first + 8
        ]
        if free:
            pair.knot_slope, pair.knot_theta = at[first + 8 : first + 10]
        pair.count, pair.room, pair.both = k, steps, system.both
        both.pair, both.apart, both.most = ctypes.addressof(pair), apart, _between(system)
        both.shorter = _SHORTER if free else 1.0
        self._call, self._address = compiled_pair().pair_twice, ctypes.addressof(both)

    def run(
        self, X0: Array, y0: Array, times: Array, goal: tuple[float, float, float]
    ) -> tuple[int, tuple[PairRun, float, float] | None]:
        """Both runs from one state: how they ended, and what `_twice` returns."""
        self._X0[:], self._y0[:], self._times[:] = X0, y0, times
        if goal != self._goal:
            rtol, atol, share = self._goal = goal
            self._both.tolerance[:] = *_local(rtol, atol, share), *_local(rtol, atol, share / _RATIO)
        status = int(self._call(self._address))
        if status != DONE:
            return status, None
        difference, size, coarse, counted, rejected, evaluations, left = self._found.tolist()
        steps = int(counted)
        estimate = _estimate(difference, left, steps, coarse, self._free)
        X, y, knots = self._X.copy(), self._y.copy(), self._knots[:steps].copy()
        run = PairRun(X, y, steps, int(rejected), int(evaluations), estimate, left, knots)
        return DONE, (run, size, estimate)


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
