"""One run of a single member by the pair 8(5,3), step by step with its knots, in blocks between which Ctrl-C is looked for."""

from __future__ import annotations

import ctypes
from itertools import accumulate
from math import nan

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow.pair_errors import most_between
from lie_codegen.flow.pair_library import DONE, FULL, MANY, compiled_pair, refuse
from lie_codegen.flow.pair_run import PairRun
from lie_codegen.flow.pair_system import System

#: Steps in one call of compiled code, after which Python looks whether somebody pressed Ctrl-C; room for as many knots, at first for fewer.
STEPS, FIRST_STEPS = 4096, 256
#: Steps that are tried at most: some seconds.
MOST_STEPS = 2**21


def single_run(system: System, X0: Array, y0: Array, times: Array, rtol: float, atol: float, where: str) -> PairRun:
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
    library, status, room = compiled_pair(), FULL, min(FIRST_STEPS, STEPS)
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
        if given.steps + given.rejected > MOST_STEPS:
            status = MANY
        room = STEPS
    refuse(status, given.t, atol, MOST_STEPS, where)
    kept = knots[0] if len(knots) == 1 else tuple(np.concatenate(each) for each in zip(*knots, strict=True))
    left = 0.0
    if between:
        given.times, given.count, given.X_out, given.y_out = wanted
        given.knot_t, given.knot_h, given.knot_X, given.knot_y, given.knot_slope, given.knot_theta = (
            each.ctypes.data for each in kept
        )
        left = library.pair_between(ctypes.addressof(given), given.steps, most_between(system))
        kept = tuple(each[:-1] for each in kept[:4])
    return PairRun(X_out, y_out, given.steps, given.rejected, given.evaluations, nan, left, np.column_stack(kept))


def _rows(rows: Array, room: int, count: int, widths: tuple[int, ...]) -> tuple[Array, ...]:
    """Copies of t, h, X, y and what else of so many knots of a block with room for more."""
    found, place = [], 0
    for k, width in enumerate(widths):
        part = rows[place : place + count * width].copy()
        found.append(part.reshape(count, width) if k > 1 else part)
        place += room * width
    return tuple(found)
