"""The records of a straight-line program."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from lie_codegen.kernel.routine import Routine


class Statement(NamedTuple):
    """One value. `operands` are indices of earlier statements. A tuple, for a kernel has thousands, which are made, hashed and compared.

    `op` is CALL (of `routine`, operands its condition, its inputs and, unless they are zeros, what its results are where the condition does not
    hold), RESULT (entry `slot[0]` of a CALL, which it follows), INPUT (entry `slot[1]` of port `slot[0]`), CONST (`value`), SELECT (operand 1 where operand
    0 is not zero, else operand 2), or CasADi's name without its OP_.
    """

    op: str
    operands: tuple[int, ...] = ()
    slot: tuple[int, int] = (-1, -1)
    value: float = 0.0
    routine: Routine | None = None


@dataclass(frozen=True)
class Tape:
    """A straight-line program.

    Attributes:
        statements: in order of evaluation: inputs first; sin and cos of one argument adjacent.
        outputs: for each port, the statement of each of its entries, in C order.
    """

    statements: tuple[Statement, ...]
    outputs: tuple[tuple[int, ...], ...]
