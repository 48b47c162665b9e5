"""Both runs of a single member by the pair 8(5,3) in one call of compiled code, over memory that its system keeps."""

from __future__ import annotations

import ctypes
from itertools import accumulate, pairwise

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow import pair_single
from lie_codegen.flow.pair_errors import RATIO, SHORTER, estimate_of, local_errors, most_between
from lie_codegen.flow.pair_library import DONE, FULL, Twice, compiled_pair
from lie_codegen.flow.pair_run import PairRun
from lie_codegen.flow.pair_system import System

#: Doubles of a line of memory: vectors that lie across two take longer.
_LINE = 8
#: Times up to which a system keeps the memory of a run, a third of a megabyte: beyond, what it costs to have it anew is little beside the run.
_MOST_TIMES_KEPT = 1024


def two_runs(
    system: System, X0: Array, y0: Array, times: Array, rtol: float, atol: float, share: float, free: bool
) -> tuple[PairRun, float, float] | None:
    """One member at two tolerances, that share of what is asked for and less, in one call; `free` as in `pair853.integrate`.

    Returns:
        The second run, its size, an estimate of its error; None where one of them needs more
        than half the steps of a call and one to each time at which steps end, or fails: `single_run` says how.
    """
    ends = 0 if free else len(times)
    sizes = pair_single.FIRST_STEPS + ends, pair_single.STEPS // 2 + ends
    if sizes[0] > pair_single.STEPS:
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
        both.pair, both.apart, both.most = ctypes.addressof(pair), apart, most_between(system)
        both.shorter = SHORTER if free else 1.0
        self._call, self._address = compiled_pair().pair_twice, ctypes.addressof(both)

    def run(
        self, X0: Array, y0: Array, times: Array, goal: tuple[float, float, float]
    ) -> tuple[int, tuple[PairRun, float, float] | None]:
        """Both runs from one state: how they ended, and what `two_runs` returns."""
        self._X0[:], self._y0[:], self._times[:] = X0, y0, times
        if goal != self._goal:
            rtol, atol, share = self._goal = goal
            self._both.tolerance[:] = *local_errors(rtol, atol, share), *local_errors(rtol, atol, share / RATIO)
        status = int(self._call(self._address))
        if status != DONE:
            return status, None
        difference, size, coarse, counted, rejected, evaluations, left = self._found.tolist()
        steps = int(counted)
        estimate = estimate_of(difference, left, steps, coarse, self._free)
        X, y, knots = self._X.copy(), self._y.copy(), self._knots[:steps].copy()
        run = PairRun(X, y, steps, int(rejected), int(evaluations), estimate, left, knots)
        return DONE, (run, size, estimate)
