"""The most stack that the C solver takes: the arrays of each function, along the two longest chains of calls.

A bound for any compiler and level: every value of a kernel is counted as if it had a place of its own, as it has without optimisation.
tests/steering/test_steer_stack.py holds it against what gcc says of each function (-fcallgraph-info=su), and runs threads of that size.
"""

from __future__ import annotations

from lie_codegen.steering.shooting.source import SteeringView

#: As in steering_core.c: lanes where the compiler has vectors, Runge-Kutta steps kept, candidates kept.
LANES, _NODES, _KEPT = 8, 129, 8
#: Registers saved, arguments passed on the stack, alignment of vectors: of a frame, twelve frames deep; libm.
_FRAMES, _LIBRARY = 12 * 320, 2048


def stack_bytes(view: SteeringView, lanes: int) -> int:
    """Bytes of stack of `<prefix>_solve`, with eight lanes or one."""
    n, m, size = view.dim, len(view.controls), view.size
    nodes = 2 * view.seed_steps + 1
    kernel = max(len(each.statements) for each in view.kernels)
    point = 3 + 3 * n + 2 * n * n
    damped = n * n + 2 * n + 4
    # in vectors of `lanes` doubles
    solve = size + (m + size + 2 * n + 4) + (_KEPT * (n + 3) + 3)
    search = nodes * m + n + point + 4
    relax = nodes * (n * n + m) + size + 2 * n * n + 6 * n + 12 + max(3 * m + kernel, damped)
    descend = point + n + 24
    linearise = size + 2 * n * n + 5 * n + 6
    tangent = _NODES * n + m + n + kernel
    vectors = solve + search + max(relax, descend + linearise + tangent)
    # a kernel's constants are spread over the lanes in temporaries of their own
    return _round_up(8 * lanes * vectors * 3 // 2 + _FRAMES + _LIBRARY)


def _round_up(value: int) -> int:
    return -(-value // 1024) * 1024
