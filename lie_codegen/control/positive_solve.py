"""Linear systems with a symmetric positive definite matrix, over any arithmetic, as the inertia of a plant."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lie_codegen.kernel.arithmetic import Scalar
from lie_codegen.kernel.linear import Vector, dot, minus, scaled


def is_absent(x: Any) -> bool:
    """Whether a term is absent by structure, an int 0; a float that happens to vanish is a number, and 0/NaN beside it is none."""
    return isinstance(x, int) and x == 0


def solve_positive(M: Sequence[Sequence[Scalar]], b: Vector) -> Vector:
    """M^-1 b for a symmetric positive definite M, by elimination.

    Every pivot is a quotient of leading principal minors, which are positive there, so that none is looked for, and the C has no branches.
    """
    rows, right = [list(row) for row in M], list(b)
    size = len(right)
    for k in range(size):
        for i in range(k + 1, size):
            if is_absent(rows[i][k]):
                continue
            factor = rows[i][k] / rows[k][k]
            rows[i] = [*rows[i][: k + 1], *minus(rows[i][k + 1 :], scaled(factor, rows[k][k + 1 :]))]
            right[i] = minus([right[i]], scaled(factor, [right[k]]))[0]
    for k in reversed(range(size)):
        rest = minus([right[k]], [dot(rows[k][k + 1 :], right[k + 1 :])])[0] if k + 1 < size else right[k]
        right[k] = 0 if is_absent(rest) else rest / rows[k][k]
    return right
