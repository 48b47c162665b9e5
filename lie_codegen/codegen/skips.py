"""Work on lanes that a condition makes superfluous: what one side of a choice alone needs, where no lane takes that side.

A choice on lanes computes both sides. The roots, sines and divisions of a closed form are left out where all lanes are near the
identity, where the series stands for it; a lane that takes a side has the same numbers as ever, bit by bit.
"""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from lie_codegen.codegen.tape import Tape

#: A side of a choice: the condition's statement, and whether it has to hold.
Side = tuple[int, bool]

#: What the operations that take long cost, in products.
_COSTS = {"DIV": 8, "INV": 8, "SQRT": 8, "SIN": 12, "COS": 12, "TAN": 25}
_COSTS |= dict.fromkeys(("EXP", "EXPM1", "LOG", "ASIN", "ACOS", "ATAN", "ATAN2", "SINH", "COSH", "TANH", "POW"), 20)
#: Work in such operations below which nothing is skipped. A polynomial is cheaper than a test that is foreseen half the time: measured
#: on samples on both sides, skipping series of 36 products lost a tenth, skipping roots and sines nothing.
_LEAST = 24
#: Not moved: values without work of their own; routines, which look at their condition themselves; masks, which are no numbers.
_FIXED = frozenset({"INPUT", "CONST", "CALL", "RESULT", "LT", "LE", "EQ", "NE", "NOT", "AND", "OR"})
_SIDES: Mapping[str, Mapping[int, bool]] = {"SELECT": {1: True, 2: False}, "IF_ELSE_ZERO": {1: True}}


@dataclass(frozen=True)
class Skip:
    """Statements that only one side of a choice needs.

    Attributes:
        condition: the statement of the condition.
        holds: whether they are needed where it holds, or where it does not.
        members: the statements, in order.
        results: those that statements outside read, all of them choices.
    """

    condition: int
    holds: bool
    members: tuple[int, ...]
    results: tuple[int, ...]


def with_skips(tape: Tape) -> tuple[int | Skip, ...]:
    """The statements in an order of evaluation, those that can be skipped together."""
    kept: set[Side] = set()
    while True:
        sides = _sides(tape, kept)
        blocks: dict[Side, list[int]] = defaultdict(list)
        for index, side in enumerate(sides):
            if side is not None:
                blocks[side].append(index)
        light = [side for side, members in blocks.items() if _cost(tape, members) < _LEAST]
        if not light:
            order = _ordered(tape, sides, blocks)
            if order is not None:
                return order
            # Two blocks that wait for each other: the lighter one is computed always.
            light = [min(blocks, key=lambda side: _cost(tape, blocks[side]))]
        kept.update(light)


def _cost(tape: Tape, members: Iterable[int]) -> int:
    return sum(_COSTS.get(tape.statements[index].op, 0) for index in members)


def _sides(tape: Tape, kept: set[Side]) -> list[Side | None]:
    """For every statement the one side that needs it; None where it is needed always or by several.

    A condition must be known outside of what it skips: sides whose condition is itself skipped are not told apart.
    """
    inner: set[int] = set()
    together = _pairs(tape)
    apart: set[int] = set()
    while True:
        found: list[Side | None] = [None] * len(tape.statements)
        needed: list[set[Side | None]] = [set() for _ in tape.statements]
        for port in tape.outputs:
            for index in port:
                needed[index].add(None)
        for index in reversed(range(len(tape.statements))):
            statement = tape.statements[index]
            if len(needed[index]) == 1 and statement.op not in _FIXED and index not in apart:
                [found[index]] = needed[index]
            side_of = _SIDES.get(statement.op, {})
            for place, operand in enumerate(statement.operands):
                side = (statement.operands[0], side_of[place]) if place in side_of else None
                own = side is not None and side[0] not in inner and side not in kept
                needed[operand].add(side if own else found[index])
        hidden = {side[0] for side in found if side is not None and found[side[0]] is not None}
        torn = {index for pair in together for index in pair if len({found[k] for k in pair}) > 1} - apart
        if not hidden and not torn:
            return found
        inner |= hidden
        apart |= torn


def _pairs(tape: Tape) -> list[list[int]]:
    """Sines and cosines of one argument, which are computed together."""
    found: dict[tuple[int, ...], list[int]] = defaultdict(list)
    for index, statement in enumerate(tape.statements):
        if statement.op in ("SIN", "COS"):
            found[statement.operands].append(index)
    return [pair for pair in found.values() if len(pair) > 1]


def _ordered(tape: Tape, sides: list[Side | None], blocks: Mapping[Side, list[int]]) -> tuple[int | Skip, ...] | None:
    """Every statement after its operands, a block as late as its last statement; None where blocks wait for each other."""

    def node(index: int) -> int | Side:
        side = sides[index]
        return index if side is None else side

    waits: dict[int | Side, set[int | Side]] = {node(index): set() for index in range(len(tape.statements))}
    followers: dict[int | Side, set[int | Side]] = defaultdict(set)
    for index, statement in enumerate(tape.statements):
        side = sides[index]
        for operand in (*statement.operands, *(() if side is None else (side[0],))):
            if node(operand) != node(index):
                waits[node(index)].add(node(operand))
                followers[node(operand)].add(node(index))

    # Kahn's algorithm; of what is ready the earliest in the old order goes first, so that only what has to wait for a block moves.
    def place(each: int | Side) -> int:
        return each if isinstance(each, int) else blocks[each][-1]

    ready = [(place(each), each) for each, before in waits.items() if not before]
    heapq.heapify(ready)
    order: list[int | Skip] = []
    while ready:
        _, each = heapq.heappop(ready)
        order.append(each if isinstance(each, int) else _skip(tape, sides, each, blocks[each]))
        for after in _released(followers[each], waits, each):
            heapq.heappush(ready, (place(after), after))
    done = sum(1 if isinstance(each, int) else len(each.members) for each in order)
    return tuple(order) if done == len(tape.statements) else None


def _released(
    followers: Iterable[int | Side], waits: Mapping[int | Side, set[int | Side]], done: int | Side
) -> Iterator[int | Side]:
    for each in followers:
        waits[each].discard(done)
        if not waits[each]:
            yield each


def _skip(tape: Tape, sides: list[Side | None], side: Side, members: list[int]) -> Skip:
    own = set(members)
    read = {
        operand
        for index, statement in enumerate(tape.statements)
        if sides[index] != side
        for operand in statement.operands
        if operand in own
    }
    return Skip(side[0], side[1], tuple(members), tuple(sorted(read)))
