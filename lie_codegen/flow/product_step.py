"""One step of a system on a product of groups and a vector space, to fourth order, by exponentials.

    X_i' = X_i hat(xi_i(t, X, v)),   v' = a(t, X, v)

Runge-Kutta-Munthe-Kaas with the classical tableau: the stages live in the algebras, X_i exp(Theta_i) comes at the end, on the
groups to rounding for |h xi| <= 1/4. Munthe-Kaas, BIT 38 (1998) 92.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from lie_codegen.groups.derivation import GroupDerivation
from lie_codegen.groups.maps.exponential import exp_matrix
from lie_codegen.groups.maps.rkmk import times_taylor_exp
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.brackets import dexp_inverse
from lie_codegen.kernel.linear import Vector, matmul, plus, scaled

#: (stage, t, elements, v) -> body velocities of the elements and the rate of v; stage 0, 1, 2 at t, t + h/2, t + h.
Rates = Callable[[int, Scalar, list[Any], Vector], tuple[list[Vector], Vector]]


class Move:
    """(ops, X, theta) -> X exp(hat(theta)): in closed form where the group has one, else by the Taylor polynomial."""

    def __init__(self, group: MatrixGroup) -> None:
        self.group = group
        self.derivation = GroupDerivation(group)

    def __call__(self, ops: Arithmetic, X: Any, theta: Vector) -> Any:
        if self.derivation.matrix_pattern is None:
            return times_taylor_exp(self.group, ops, X, theta)
        return matmul(X, exp_matrix(ops, self.derivation, theta))


def product_step(
    ops: Arithmetic, moves: Sequence[Move], elements: Sequence[Any], v: Vector, rates: Rates, t: Scalar, h: Scalar
) -> tuple[list[Any], Vector]:
    """The elements and the vector after a step of length h."""
    velocities, slope = rates(0, t, list(elements), v)
    turns, slopes, weights = [velocities], [slope], [1]
    for stage, part, weight in ((1, h / 2, 2), (1, h / 2, 2), (2, h, 1)):
        thetas = [scaled(part, k) for k in turns[-1]]
        moved = [move(ops, X, theta) for move, X, theta in zip(moves, elements, thetas, strict=True)]
        velocities, slope = rates(stage, (t, t + h / 2, t + h)[stage], moved, plus(v, scaled(part, slopes[-1])))
        # The first stage is at Theta = 0, where the algebra's equation reads Theta' = xi: only the later ones are pulled back.
        turns.append(
            [dexp_inverse(ops, m.group.algebra, a, b) for m, a, b in zip(moves, thetas, velocities, strict=True)]
        )
        slopes.append(slope)
        weights.append(weight)
    shares = [h * weight / 6 for weight in weights]
    ends = []
    for i, move in enumerate(moves):
        theta = plus(*[scaled(share, turn[i]) for share, turn in zip(shares, turns, strict=True)])
        ends.append(move(ops, elements[i], theta))
    change = plus(*[scaled(share, slope) for share, slope in zip(shares, slopes, strict=True)])
    return ends, plus(v, change)
