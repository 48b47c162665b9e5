"""The most stack that the C solver takes: the arrays of each function, along the two longest chains of calls.

A bound for any compiler and level: every value of a kernel is counted as if it had a place of its own, as it has without optimisation.
tests/steering/test_steer_stack.py holds it against what gcc says of each function (-fcallgraph-info=su), and runs threads of that size.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from lie_codegen.codegen.frames import FRAME, LIBRARY

if TYPE_CHECKING:
    from lie_codegen.steering.shooting.views import SteeringView

#: As in steering_core.c: starts of a group, in vectors of any width that divides it, Runge-Kutta steps and candidates kept, rows of the extrapolation.
LANES, _NODES, _KEPT, _ROWS = 8, 129, 8, 8
#: Twelve frames deep.
_FRAMES = 12 * FRAME


def workspace_bytes(view: SteeringView, lanes: int) -> int:
    """Bytes of memory that `<prefix>_solve_in` asks for, with eight starts at a time or one: all large arrays, wherever the memory begins."""
    n, m = view.dim, len(view.controls)
    nodes = 2 * view.seed_steps + 1
    vectors = max(_NODES * n, nodes * n * n) + 2 * nodes * m + 2 * _point(n)
    # a candidate: its energy, its costate, two ints; a list: a count and a size besides
    candidates = _KEPT * (n + 2) + 2
    return 8 * lanes * (vectors + candidates + 2)


def stack_bytes(view: SteeringView, lanes: int, *, in_workspace: bool = False) -> int:
    """Bytes of stack of `<prefix>_solve`, with eight starts at a time or one; or of `<prefix>_solve_in`."""
    n, m, size = view.dim, len(view.controls), view.size
    kernel = max(len(each.statements) for each in view.kernels)
    damped = n * n + 2 * n + 4
    # in vectors of `lanes` doubles
    solve = size + (m + size + 2 * n + 5) + 3
    search = n + 4
    relax = size + 2 * n * n + 6 * n + 12 + max(3 * m + kernel, damped)
    descend = n + 24
    linearise = size + 2 * n * n + 5 * n + 6
    tangent = m + n + kernel
    integrate = (_ROWS + 2) * (n + size) + m + 1 + kernel
    vectors = solve + search + max(relax, descend + linearise + max(tangent, integrate))
    # a kernel's constants are spread over the lanes in temporaries of their own
    small = 8 * lanes * vectors * 3 // 2 + _FRAMES + LIBRARY
    return _round_up(small if in_workspace else small + workspace_bytes(view, lanes))


def _point(n: int) -> int:
    """Vectors of a `point`: what is known at one costate."""
    return 3 + 3 * n + 2 * n * n


def _round_up(value: int) -> int:
    return -(-value // 1024) * 1024
