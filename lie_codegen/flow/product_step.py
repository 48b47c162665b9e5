"""One step of a system on a product of groups and a vector space, to fourth order, by exponentials.

    X_i' = X_i hat(xi_i(t, X, v)),   v' = a(t, X, v)

Runge-Kutta-Munthe-Kaas with the classical tableau: the stages live in the algebras, X_i exp(Theta_i) comes at the end, on the
groups to rounding for |h xi| <= 1/4. Munthe-Kaas, BIT 38 (1998) 92.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import accumulate
from typing import Any

from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.exponential import exp_matrix
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.brackets import dexp_inverse
from lie_codegen.kernel.linear import Vector, matmul, plus
from lie_codegen.kernel.runge_kutta import CLASSICAL, increment, vectors

#: (stage, t, elements, v) -> body velocities of the elements and the rate of v; stage 0, 1, 2 at t, t + h/2, t + h.
Rates = Callable[[int, Scalar, list[Any], Vector], tuple[list[Vector], Vector]]


class Move:
    """(ops, X, theta) -> X exp(hat(theta)): in closed form where the group has one, else by the Taylor polynomial."""

    def __init__(self, group: MatrixGroup) -> None:
        self.group = group
        self.derivation = derivation_of(group)

    def __call__(self, ops: Arithmetic, X: Any, theta: Vector) -> Any:
        if self.derivation.matrix_pattern is None:
            from lie_codegen.groups.maps.rkmk import times_taylor_exp

            return times_taylor_exp(self.group, ops, X, theta)
        return matmul(X, exp_matrix(ops, self.derivation, theta))


def product_step(
    ops: Arithmetic, moves: Sequence[Move], elements: Sequence[Any], v: Vector, rates: Rates, t: Scalar, h: Scalar
) -> tuple[list[Any], Vector]:
    """The elements and the vector after a step of length h."""
    sizes = [move.group.dim for move in moves]

    def rate(c: float, change: Vector) -> Vector:
        stage = int(2 * c)
        *thetas, shift = _split(change, sizes)
        moved = list(elements)
        if c:
            moved = [move(ops, X, theta) for move, X, theta in zip(moves, elements, thetas, strict=True)]
        velocities, slope = rates(stage, (t, t + h / 2, t + h)[stage], moved, plus(v, shift))
        turns = [dexp_inverse(ops, m.group.algebra, a, b) for m, a, b in zip(moves, thetas, velocities, strict=True)]
        return [entry for part in (*turns, slope) for entry in part]

    *thetas, change = _split(increment(vectors(ops), CLASSICAL, rate, [0] * (sum(sizes) + len(v)), h), sizes)
    return [move(ops, X, theta) for move, X, theta in zip(moves, elements, thetas, strict=True)], plus(v, change)


def _split(values: Vector, sizes: Sequence[int]) -> list[Vector]:
    """Parts of these sizes, and the rest."""
    ends = list(accumulate(sizes, initial=0))
    return [values[a:b] for a, b in zip(ends, [*ends[1:], None], strict=True)]
