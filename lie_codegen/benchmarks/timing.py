"""Timing that survives a shared machine: competitors in turn, round after round, ratios within a round, processor time.

The time is that of all threads of this process, so that another process on the core does not count, and a peer gains nothing
by running on several.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

#: One measurement lasts at least this long.
LEAST_SECONDS = 2e-3


@dataclass(frozen=True)
class Spread:
    """Smallest, middle and largest of the rounds."""

    low: float
    middle: float
    high: float

    @staticmethod
    def of(values: list[float]) -> Spread:
        return Spread(min(values), statistics.median(values), max(values))


@dataclass(frozen=True)
class Timing:
    """One competitor.

    Attributes:
        nanoseconds: a call, a sample or a step.
        ratio: to ours, in the same round.
    """

    nanoseconds: Spread
    ratio: Spread


def interleaved(
    competitors: Mapping[str, Callable[[], object]],
    units: int,
    rounds: int,
    shares: Mapping[str, float] | None = None,
) -> dict[str, Timing]:
    """Time the competitors in turn; the first is ours.

    Args:
        competitors: name -> a call that does `units` units of work.
        units: calls, samples or steps in one.
        rounds: how often.
        shares: name -> the part of the units that it does in fact, 1 by default.
    """
    amount = {name: units * (shares or {}).get(name, 1.0) for name in competitors}
    repeats = {name: _repeats(work) for name, work in competitors.items()}
    seen: dict[str, list[float]] = {name: [] for name in competitors}
    for _ in range(rounds):
        for name, work in competitors.items():
            seen[name].append(_seconds(work, repeats[name]) / repeats[name] / amount[name] * 1e9)
    return timings_of(seen)


def timings_of(seen: Mapping[str, list[float]]) -> dict[str, Timing]:
    """Times round by round, with their ratios to those of the first."""
    ours = seen[next(iter(seen))]
    return {
        name: Timing(Spread.of(values), Spread.of([each / mine for each, mine in zip(values, ours, strict=True)]))
        for name, values in seen.items()
    }


def _seconds(work: Callable[[], object], repeats: int) -> float:
    started = time.process_time()
    for _ in range(repeats):
        work()
    return time.process_time() - started


def _repeats(work: Callable[[], object]) -> int:
    work()
    repeats = 1
    while (seconds := _seconds(work, repeats)) < LEAST_SECONDS:
        repeats = max(2 * repeats, int(repeats * LEAST_SECONDS / max(seconds, 1e-9)))
    return repeats
