"""Long tapes in parts: compilers take more than proportionally long over long functions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from lie_codegen.codegen.call_defaults import chosen_results
from lie_codegen.codegen.tape import Statement, Tape

#: Statements of one function. Measured with gcc 12: 20,000 in one take 10 s, in parts of this size 2 s; shorter parts
#: compile no faster and run slower.
PART = 2_000


@dataclass(frozen=True)
class Part:
    """A tape of its own: its one output port is what it leaves in the work array, at `places`."""

    tape: Tape
    places: tuple[int, ...]


@dataclass(frozen=True)
class Split:
    """Parts in order, and the tape that fills the outputs.

    INPUT statements with port `work` read the work array, of `size` entries.
    """

    parts: tuple[Part, ...]
    last: Tape
    work: int
    size: int


def split(tape: Tape, ports: int, limit: int | None = None) -> Split | None:
    """The tape in parts of at most `limit` computed statements; None if it is no longer than that.

    Args:
        ports: number of input ports; the work array is the next one.
        limit: statements of a part; PART by default.
    """
    limit = PART if limit is None else limit
    computed = [index for index, statement in enumerate(tape.statements) if statement.op not in ("INPUT", "CONST")]
    if len(computed) <= limit:
        return None
    # A call that has the outputs as its defaults stands where they are stored: else they would cross twice.
    calls = {call for call, chosen in chosen_results(tape).items() if not any(each.is_read for each in chosen)}
    late = {
        i
        for i in computed
        if i in calls or (tape.statements[i].op == "RESULT" and tape.statements[i].operands[0] in calls)
    }
    computed = [index for index in computed if index not in late]
    cuts: list[list[int]] = [[]]
    for index in computed:
        # The results of a call stay with it: what crosses from part to part is a number.
        if len(cuts[-1]) >= limit and tape.statements[index].op != "RESULT":
            cuts.append([])
        cuts[-1].append(index)
    home = {index: number for number, cut in enumerate(cuts) for index in cut}
    outputs = {index for port in tape.outputs for index in port}
    crossing = {
        operand
        for index in (*computed, *late)
        for operand in tape.statements[index].operands
        if operand in home and home[operand] != home.get(index)
    } | (outputs & home.keys())
    place = {index: number for number, index in enumerate(sorted(crossing))}
    parts = []
    for cut in cuts:
        left = [index for index in cut if index in place]
        piece = _piece(tape, cut, place, ports, (left,))
        parts.append(Part(piece, tuple(place[index] for index in left)))
    return Split(tuple(parts), _piece(tape, sorted(late), place, ports, tape.outputs), ports, len(place))


def _piece(tape: Tape, own: Iterable[int], place: dict[int, int], work: int, outputs: Iterable[Iterable[int]]) -> Tape:
    """The statements `own`, before them what they and the outputs need from elsewhere."""
    own = list(own)
    outputs = [list(port) for port in outputs]
    wanted = {operand for index in own for operand in tape.statements[index].operands}
    wanted.update(index for port in outputs for index in port)
    fresh: dict[int, int] = {}
    statements: list[Statement] = []
    for index in sorted(wanted - set(own)):
        fresh[index] = len(statements)
        old = tape.statements[index]
        statements.append(Statement("INPUT", slot=(work, place[index])) if index in place else old)
    for index in own:
        fresh[index] = len(statements)
        old = tape.statements[index]
        statements.append(old._replace(operands=tuple(fresh[operand] for operand in old.operands)))
    return Tape(tuple(statements), tuple(tuple(fresh[index] for index in port) for port in outputs))
