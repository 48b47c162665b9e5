"""The most stack that a generated function takes, whatever the compiler and the level of optimisation: the same number on every machine.

Every value is counted as if it had a place of its own, as it has without optimisation, and half as much again for what a compiler keeps beside
them. tests/codegen/test_stack.py holds it against what gcc and clang say (-fstack-usage) and runs threads of that size.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from lie_codegen.codegen.views import KernelView, StatementView

#: Bytes of a frame beside its values: registers saved, arguments passed on the stack, alignment. Bytes of libm below a kernel.
FRAME, LIBRARY = 320, 2048


def stack_bytes(kernel: KernelView) -> int | None:
    """Bytes of stack of a kernel with all that it calls; None if it runs a routine, whose loops have arrays of their own.

    A float takes no more than the double that is counted.
    """
    pieces = [kernel.statements, *(part.statements for part in kernel.parts)]
    if any(statement.results for piece in pieces for statement in piece):
        return None
    ports = len(kernel.inputs) + len(kernel.outputs) + 1
    # a part has returned before the next is called
    part = max((_values(each.statements, ports) for each in kernel.parts), default=0)
    return _round_up(_values(kernel.statements, ports) + 8 * kernel.work_size + part + LIBRARY)


def _values(statements: Sequence[StatementView], ports: int) -> int:
    """Bytes of a frame that holds a value a statement and the arguments."""
    return 8 * (len(statements) + ports) * 3 // 2 + FRAME


def _round_up(value: int) -> int:
    return -(-value // 256) * 256
