"""The steps of a Magnus flow: spans between output times and jumps, each in equal parts that its own density asks for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.flow.magnus.drive import Drive

Counts = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Steps:
    """Spans [knots_s, knots_s+1], parts_s equal steps each.

    Attributes:
        knots: (s + 1,) increasing.
        parts: (s,).
        piece: (s,) the piece of u in which a span lies.
        slot: (s,) where the state at the end of the span is kept, or -1.
        slots: number of states that are kept.
    """

    knots: Array
    parts: Counts
    piece: Counts
    slot: Counts
    slots: int

    @cached_property
    def first(self) -> Counts:
        """(s + 1,) the number of the first step of each span; the last entry is the number of steps."""
        return np.concatenate([[0], np.cumsum(self.parts)]).astype(np.intp)

    @property
    def count(self) -> int:
        """Number of steps."""
        return int(self.first[-1])

    @property
    def longest(self) -> float:
        """The longest step."""
        return float(np.max(np.diff(self.knots) / self.parts))

    @property
    def shortest(self) -> float:
        """The shortest step."""
        return float(np.min(np.diff(self.knots) / self.parts))

    def times(self, factor: int) -> Steps:
        """The same with so many times as many steps."""
        return Steps(self.knots, self.parts * factor, self.piece, self.slot, self.slots)

    @cached_property
    def moments(self) -> tuple[Array, Array]:
        """The starts and the lengths of all steps."""
        span = np.repeat(np.arange(len(self.parts)), self.parts)
        h = (np.diff(self.knots) / self.parts)[span]
        return self.knots[span] + (np.arange(self.count) - self.first[span]) * h, h


def plan_steps(drive: Drive, norms: Array, times: Array, most: int) -> Steps | None:
    """The coarsest steps that end at all the times (the first is the start) and at the ends of the pieces of u; None beyond `most`.

    Every span has steps of its own density, so that a short pulse does not make the rest slow.
    """
    inside = drive.times[(drive.times > times[0]) & (drive.times < times[-1])]
    knots = np.union1d(times, inside)
    piece = drive.piece_of((knots[:-1] + knots[1:]) / 2)
    wanted = np.ceil(np.diff(knots) * drive.density(norms, piece) * (1 - 1e-12))
    if not np.all(np.isfinite(wanted)) or np.sum(wanted) > most:
        return None
    parts = np.maximum(wanted, 1).astype(np.intp)
    slot = np.full(len(parts), -1, dtype=np.intp)
    slot[np.searchsorted(knots, times[1:]) - 1] = np.arange(len(times) - 1)
    return Steps(np.ascontiguousarray(knots), parts, piece, slot, len(times) - 1)
