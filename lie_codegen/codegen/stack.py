"""The most stack that a generated function takes, whatever the compiler and the level of optimisation: the same number on every machine.

Every value is counted as if it had a place of its own, as it has without optimisation, and half as much again for what a compiler keeps beside
them. tests/codegen/test_stack.py holds it against what gcc and clang say (-fstack-usage) and runs threads of that size.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from lie_codegen.codegen.frames import FRAME, LIBRARY
from lie_codegen.codegen.routine_stack import routine_stack

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from lie_codegen.codegen.views import KernelView, PackageView, StatementView


def package_stack(package: PackageView) -> dict[str, int]:
    """{symbol: bytes of stack} of the functions of a package, with all that each calls, libm included. One that runs a routine whose C
    cannot be read has none.

    A float takes no more than the double that is counted.
    """
    helpers: dict[str, int] = {}
    routines: dict[str, int] = {}
    for routine in package.routines:  # a helper is printed with the first routine that calls it
        helpers |= {each.symbol: _bytes(each, routines) for each in routine.helpers}
        if (most := routine_stack(routine.text, routine.name, helpers)) is not None:
            routines[routine.name] = most
    called = {each.symbol: _routines_of(each) for each in package.kernels}
    return {
        each.symbol: _round_up(_bytes(each, routines) + LIBRARY)
        for each in package.kernels
        if called[each.symbol] <= routines.keys()
    }


def _routines_of(kernel: KernelView) -> set[str]:
    pieces = [kernel.statements, *(part.statements for part in kernel.parts)]
    return {each.expression for piece in pieces for each in piece if each.results}


def _bytes(kernel: KernelView, routines: Mapping[str, int]) -> int:
    ports = len(kernel.inputs) + len(kernel.outputs) + 1
    # a part has returned before the next is called
    part = max((_values(each.statements, ports, routines) for each in kernel.parts), default=0)
    return _values(kernel.statements, ports, routines) + 8 * kernel.work_size + part


def _values(statements: Sequence[StatementView], ports: int, routines: Mapping[str, int]) -> int:
    """Bytes of a frame that holds a value a statement and the arguments, and of the deepest routine that it calls."""
    arrays = sum(each.results + len(each.arguments) for each in statements)
    below = max((routines.get(each.expression, 0) for each in statements if each.results), default=0)
    return 8 * (len(statements) + arrays + ports) * 3 // 2 + FRAME + below


def _round_up(value: int) -> int:
    return -(-value // 256) * 256
