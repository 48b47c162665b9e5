"""Bounds made tight by degrees: where no start reaches the goal within them, the nearest are brought there within wider ones.

Within wider bounds many controls reach the goal; each step narrows them and goes on from the controls before. What arrives within the
true bounds is found. What stops just before them is nearly bang-bang, for its peak is about as low as equal pieces allow: from the
means of the pieces in which controls switch one reads the arcs that they have.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.direct.assemble import Manoeuvre
from lie_codegen.steering.direct.programme import Machine, Programme
from lie_codegen.steering.direct.search import Budget, Found, threshold
from lie_codegen.steering.direct.starts import starts, with_free_slots

#: Widths of the bounds, in units of the true ones: halved towards them.
_WIDTHS = (1.3, *(1 + 0.16 * 0.5**k for k in range(12)), 1.0)
#: Rounds of starts that others have had before.
_ROUND = 100
#: A control nearer to a bound, relative to the bounds, is at it.
_AT = 0.03


def tightened(task: Manoeuvre, programme: Programme, machine: Machine, budget: Budget, found: Found) -> Found:
    """What was found from the nearest lanes and from new starts; if nothing, controls (S, m) within the bounds and their variants, those
    that came farthest first, are the nearest."""
    settings = budget.settings
    fresh = with_free_slots(task, starts(task, budget.pieces, budget.starts, budget.seed, _ROUND), budget.seed + _ROUND)
    u = np.concatenate([np.array([lane for lane, _ in found.near]), fresh])
    variants = len(task.end.values)
    variant = np.array([*(each for _, each in found.near), *(np.arange(len(fresh)) % variants)])
    enough = threshold(task, settings)
    middle, half = (programme.low + programme.high) / 2, (programme.high - programme.low) / 2
    free = ~np.isfinite(half)
    order: list[int] = []
    alive = np.arange(len(u))
    for width in _WIDTHS:
        low, high = (
            np.where(free, side, middle + sign * width * half)
            for side, sign in ((programme.low, -1), (programme.high, 1))
        )
        reach = settings if width == _WIDTHS[0] else replace(settings, damping=1e-9)
        there = machine.reach(replace(programme, low=low, high=high), task.goal(variant[alive]), u[alive], reach)
        arrived = there.size <= enough
        gone = alive[~arrived]
        order = [*map(int, gone[np.argsort(there.size[~arrived], kind="stable")]), *order]
        u[alive[arrived]] = there.u[arrived]
        alive = alive[arrived]
        if not len(alive):
            break
    near = tuple((np.clip(u[lane], programme.low, programme.high), int(variant[lane])) for lane in [*alive, *order])
    tried = (
        *found.tried,
        f"bounds narrowed by degrees: {len(alive)} of {len(u)} starts reach the goal within the true ones",
    )
    found = replace(found, tried=tried, starts=found.starts + len(fresh))
    if not len(alive):
        return replace(found, near=near)
    effort = np.sum(programme.weight * u[alive] ** 2, axis=(1, 2)) / 2
    lane = int(alive[np.argmin(effort)])
    return replace(
        found,
        u=u[lane],
        variant=int(variant[lane]),
        arrived=True,
        cost=float(np.min(effort)),
        reached=len(alive),
        agree=1,
    )


def read_arcs(task: Manoeuvre, own: Array) -> tuple[Array, Array]:
    """Durations (K,) and controls (K, m), all at their bounds, whose means on equal pieces are those of `own` (pieces, m).

    A control that is between its bounds on a piece switches there: once, at the time that gives the mean, where it is at different bounds
    before and after; else it leaves its bound for as long as that, in the middle.
    """
    pieces, m = own.shape
    share = (own - task.low) / (task.high - task.low)  # of the piece at the upper bound
    marks: list[list[tuple[float, bool]]] = []
    for i in range(m):
        held = np.where(share[:, i] > 1 - _AT, 1, np.where(share[:, i] < _AT, 0, -1))
        events: list[tuple[float, bool]] = [(0.0, bool(round(float(share[0, i]))))]
        for k in range(pieces):
            before = events[-1][1]
            after = next((bool(each) for each in held[k + 1 :] if each >= 0), before)
            up = float(share[k, i])
            if held[k] >= 0:
                if bool(held[k]) != before:
                    events.append((float(k), bool(held[k])))
            elif before != after:
                events.append((k + (1 - up if after else up), after))
            else:
                gone = (1 - up) if before else up
                events += [(k + (1 - gone) / 2, not before), (k + (1 + gone) / 2, before)]
        marks.append(events)
    times = np.unique([0.0, float(pieces), *(t for events in marks for t, _ in events)])
    durations = np.diff(times) * task.duration / pieces
    middles = [(a + b) / 2 for a, b in pairwise(times)]
    letters = np.array(
        [[next(up for t, up in reversed(events) if t <= s) for events in marks] for s in middles], dtype=bool
    )
    return durations, np.where(letters, task.high, task.low)
