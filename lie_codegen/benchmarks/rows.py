"""Rows of the benchmark: who takes part, that all compute the same, and how long they take."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lie_codegen.benchmarks.timing import Timing, interleaved
from lie_codegen.errors import ComputationError

#: Does the work once; returns what was computed, to be compared.
Work = Callable[[], Any]


class AbsentError(Exception):
    """A peer that cannot take part, and why."""


@dataclass(frozen=True)
class Entrant:
    """A competitor.

    Attributes:
        name: as it is printed.
        make: prepares the work (imports, compiles, warms up); raises AbsentError if it cannot.
        share: of the row's units that one run does; slow ones do less.
        tolerance: to ours, relative to the largest entry or 1.
        part: of our numbers, what it computes; as many of the first as it gives, by default.
        compared: False for a limit of the machine, which computes nothing.
    """

    name: str
    make: Callable[[], Work]
    share: float = 1.0
    tolerance: float = 1e-9
    part: slice | None = None
    compared: bool = True


@dataclass(frozen=True)
class Row:
    """One comparison.

    Attributes:
        area: call, batch, trajectory, Monte Carlo, cold start.
        what: group, kernel, size.
        unit: of the times.
        timings: name -> timing; the first is ours, ratios are theirs over ours within a round.
        skipped: name -> why it did not take part.
        note: a limit beside it, or empty.
    """

    area: str
    what: str
    unit: str
    timings: dict[str, Timing]
    skipped: dict[str, str] = field(default_factory=dict)
    note: str = ""


def compete(
    area: str, what: str, unit: str, units: int, rounds: int, entrants: Sequence[Entrant], first: int | None = None
) -> Row:
    """Prepare the entrants, compare their results with those of the first, time those that agree in turn.

    Args:
        area, what, unit: see `Row`.
        units: calls, samples or steps that one run does.
        rounds: of the timing.
        entrants: ours first.
        first: compare this many leading rows of the results; all of them by default.

    Raises:
        AbsentError: the first one, ours, cannot take part.
    """
    ours, *others = entrants
    works: dict[str, Work] = {ours.name: ours.make()}
    shares, skipped = {ours.name: ours.share}, {}
    wanted = flat(works[ours.name](), first)
    for entrant in others:
        try:
            work = entrant.make()
            if entrant.compared:
                compare(wanted[entrant.part] if entrant.part else wanted, flat(work(), first), entrant.tolerance)
        except AbsentError as reason:
            skipped[entrant.name] = str(reason)
        except Exception as error:  # whatever a foreign library raises, the others go on
            text = str(error).strip().splitlines() or [""]
            skipped[entrant.name] = f"{type(error).__name__}: {text[0][:160]}"
        else:
            works[entrant.name], shares[entrant.name] = work, entrant.share
    return Row(area, what, unit, interleaved(works, units, rounds, shares), skipped)


def compare(wanted: np.ndarray[Any, Any], got: np.ndarray[Any, Any], tolerance: float) -> None:
    """The entries of `got` against as many of the first of `wanted`.

    Raises:
        ComputationError: saying how far apart they are.
    """
    if not 0 < len(got) <= len(wanted):
        raise ComputationError(f"computes {len(got)} numbers, ours are {len(wanted)}")
    wanted = wanted[: len(got)]
    off = float(np.max(np.abs(got - wanted))) / max(1.0, float(np.max(np.abs(wanted))))
    if not off <= tolerance:
        raise ComputationError(f"computes something else: {off:.2g} away from ours")


def flat(result: Any, first: int | None = None) -> np.ndarray[Any, Any]:
    """A copy of all numbers (of the first rows) of a result, a tuple in order, complex ones as pairs."""
    if isinstance(result, tuple | list):
        return np.concatenate([flat(each, first) for each in result])
    array = np.asarray(result if first is None else result[:first])
    return np.array(array, dtype=complex if array.dtype.kind == "c" else float, order="C").ravel().view(float)
