"""Networks of two-source shuffles that turn records of doubles into lanes and back.

A record of s doubles a sample lies in memory one after another; a lane vector holds one entry of L samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

#: A record longer than the lanes that has a network of its own.
_NINE = 9


@dataclass(frozen=True)
class Mix:
    """name = the elements `picks` of the 2 L elements of first and second."""

    name: str
    first: str
    second: str
    picks: tuple[int, ...]


@dataclass(frozen=True)
class Network:
    """Steps in order, and the names of the results."""

    size: int
    steps: tuple[Mix, ...]
    results: tuple[str, ...]


@dataclass(frozen=True)
class LaneNetworks:
    """All that one number of lanes needs: records smaller than it and stores of nine, the square transposition, that of half as many
    columns, and the places of (low, low), (low, high), (high, low), (high, high) halves of two vectors.
    """

    lanes: int
    loads: tuple[Network, ...]
    stores: tuple[Network, ...]
    square: Network
    half_square: Network
    picks: tuple[tuple[int, ...], ...]


def networks(lanes: int) -> LaneNetworks:
    """The networks for that many lanes, a power of two."""
    sizes, half = range(1, lanes), lanes // 2
    return LaneNetworks(
        lanes=lanes,
        loads=tuple(_Maker(lanes).network(size, load=True) for size in sizes),
        # nine, a 3 x 3 matrix: its rows cross lines, and the last column would go entry by entry
        stores=tuple(_Maker(lanes).network(size, load=False) for size in sizes)
        + ((_Maker(lanes).rows(_NINE),) if lanes < _NINE else ()),
        square=_Maker(lanes).square(lanes),
        half_square=_Maker(lanes).square(half),
        picks=tuple((*range(a, a + half), *range(b, b + half)) for a in (0, half) for b in (lanes, lanes + half)),
    )


class _Maker:
    """Collects the steps of one network."""

    def __init__(self, lanes: int) -> None:
        self._lanes = lanes
        self._steps: list[Mix] = []

    def network(self, size: int, *, load: bool) -> Network:
        names = [f"a{k}" for k in range(size)]
        results = self._apart(names) if load else self._together(names)
        return Network(size, tuple(self._steps), tuple(results))

    def square(self, rows: int, columns: Sequence[str] | None = None) -> Network:
        """Swaps bit after bit of the row index with that of the column index; of fewer rows than lanes, squares beside one another."""
        # A transposition exchanges row and column index, and so does exchanging their bits one after the other: for bit b the entry
        # (row without b, column with b) goes to (row with b, column without b). Each takes one shuffle a vector: log2(L) in all.
        names = [f"a{k}" for k in range(rows)] if columns is None else list(columns)
        bit = 1
        while bit < rows:
            for row in range(rows):
                if not row & bit:
                    pair = (names[row], names[row | bit])
                    low = [p if not p & bit else self._lanes + (p ^ bit) for p in range(self._lanes)]
                    high = [p | bit if not p & bit else self._lanes + p for p in range(self._lanes)]
                    names[row], names[row | bit] = self._mix(*pair, low), self._mix(*pair, high)
            bit *= 2
        return Network(rows, tuple(self._steps), tuple(names))

    def rows(self, size: int) -> Network:
        """Stores of records longer than the lanes: squares, and what follows one another in memory picked from their rows."""
        entries, lanes = [f"a{k}" for k in range(size)], self._lanes
        full = size - size % lanes
        squares = [self.square(lanes, entries[k : k + lanes]) for k in range(0, full, lanes)]
        names = [name for square in squares for name in square.results] + entries[full:]

        def place(row: int, entry: int) -> tuple[int, int]:
            # a row of a square holds entries of one sample; the columns left over still hold one entry of all samples
            return (entry - entry % lanes + row, entry % lanes) if entry < full else (entry, row)

        runs = [
            [place(*divmod(k, size)) for k in range(start, start + lanes)] for start in range(0, size * lanes, lanes)
        ]
        results = [self._collect(names, run) for run in runs]
        return Network(size, tuple(self._steps), tuple(results))

    def _mix(self, first: str, second: str, picks: Sequence[int]) -> str:
        name = f"b{len(self._steps)}"
        self._steps.append(Mix(name, first, second, tuple(picks)))
        return name

    def _apart(self, flat: list[str]) -> list[str]:
        """Vectors of consecutive records -> one vector an entry; even and odd entries first where that halves."""
        size, lanes = len(flat), self._lanes
        if size == 1:
            return flat
        if size % 2 == 0:
            # The elements at even places of two neighbours are the records' even entries: records of half the size, twice.
            pairs = list(zip(flat[::2], flat[1::2], strict=True))
            halves = [self._apart([self._mix(a, b, range(k, 2 * lanes, 2)) for a, b in pairs]) for k in (0, 1)]
            return [name for pair in zip(*halves, strict=True) for name in pair]
        # Odd records do not halve; entry e of the record of lane k stands at e + size k of the whole run.
        return [
            self._collect(flat, [divmod(entry + size * lane, lanes) for lane in range(lanes)]) for entry in range(size)
        ]

    def _together(self, entries: list[str]) -> list[str]:
        """The inverse of `_apart`."""
        size, lanes = len(entries), self._lanes
        if size == 1:
            return entries
        if size % 2 == 0:
            evens, odds = self._together(entries[::2]), self._together(entries[1::2])
            zipped = [lane // 2 + lanes * (lane % 2) for lane in range(2 * lanes)]
            return [
                self._mix(even, odd, zipped[half * lanes : (half + 1) * lanes])
                for even, odd in zip(evens, odds, strict=True)
                for half in (0, 1)
            ]
        return [
            self._collect(entries, [divmod(vector * lanes + lane, size)[::-1] for lane in range(lanes)])
            for vector in range(size)
        ]

    def _collect(self, sources: Sequence[str], wanted: Sequence[tuple[int, int]]) -> str:
        """The vector whose lane k is element wanted[k][1] of source wanted[k][0]."""
        lanes = self._lanes
        used = sorted({source for source, _ in wanted})
        first, *others = used
        name, done = sources[first], {first}
        # One source after another is mixed in; lanes whose source is yet to come hold anything meanwhile.
        picks = [place if source == first else 0 for source, place in wanted]
        for other in others:
            merged = [
                lanes + place if source == other else (picks[lane] if source in done else 0)
                for lane, (source, place) in enumerate(wanted)
            ]
            name = self._mix(name, sources[other], merged)
            done.add(other)
            picks = list(range(lanes))
        return name
