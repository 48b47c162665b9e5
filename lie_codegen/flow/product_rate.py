"""A system on a product of groups and a vector space as the rate of one vector, for integrators that choose their steps.

X_i' = X_i hat(xi_i(t, X, v)),   v' = a(t, X, v);   within a step X_i = X_i0 exp(Theta_i), y = (Theta_1, ..., Theta_m, v)

or, on groups of rotations and free entries, with the elements themselves in y (`short_rate`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, Protocol

import numpy as np

from lie_codegen.flow.near_identity import NearIdentity
from lie_codegen.flow.short_state import ShortStates
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.brackets import BERNOULLI, bracket, dexp_inverse
from lie_codegen.kernel.linear import Vector

#: Up to this |hat(Theta)| the Taylor polynomial of a group without a closed exponential is exact to rounding.
_TAYLOR_REACH = 0.25
#: |hat(Theta)| up to which the series of a closed exponential alone are exact to rounding: ten terms at 2.25 leave out 6e-17 of one.
_SERIES_REACH = 1.5

#: (t, elements, v) -> body velocities of the elements and the rate of v.
Rates = Callable[[Scalar, list[Any], Vector], tuple[list[Vector], Vector]]


class Move(Protocol):
    """(ops, X, theta) -> X exp(hat(theta))."""

    group: MatrixGroup

    def __call__(self, ops: Arithmetic, X: Any, theta: Vector, /) -> Any: ...


def turning(ops: Arithmetic, group: MatrixGroup, theta: Vector, xi: Vector) -> Vector:
    """`dexp_inverse` to rounding. Of rotations ad^3 = -s^2 |Theta|^2 ad, so two brackets are enough."""
    speed = rotation_rate(group)
    if speed is None:
        return dexp_inverse(ops, group.algebra, theta, xi, len(BERNOULLI))
    once = bracket(ops, group.algebra, theta, xi)
    twice = bracket(ops, group.algebra, theta, once)
    x = -speed * speed * sum((a * a for a in theta[1:]), theta[0] * theta[0])
    factor: Scalar = ops.constant(BERNOULLI[-1])
    for coefficient in reversed(BERNOULLI[:-1]):
        factor = ops.constant(coefficient) + x * factor
    return [e + a / 2 + factor * b for e, a, b in zip(xi, once, twice, strict=True)]


def rotation_rate(group: MatrixGroup) -> float | None:
    """s where [A_1, A_2] = s A_3 and so on round, as on SO(3) and SU(2); None elsewhere."""
    c = group.algebra.structure_constants
    if group.dim != 3:
        return None
    turn = np.zeros((3, 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        turn[i, j, k], turn[j, i, k] = c[0, 1, 2], -c[0, 1, 2]
    return float(c[0, 1, 2]) if c[0, 1, 2] != 0 and np.array_equal(c, turn) else None


@lru_cache(maxsize=256)
def reach_of(group: MatrixGroup, *, closed: bool) -> float:
    """|Theta| up to which the series above and the exponential hold.

    Args:
        group: the group.
        closed: whether its exponential is one in closed form.
    """
    c = group.algebra.structure_constants
    # |ad|_F <= the largest singular value times |Theta|; eigenvalues of ad come in pairs, so two share it.
    steepest = float(np.linalg.norm(c.reshape(group.dim, -1), 2)) / np.sqrt(2)
    by_series = 1 / steepest if steepest > 0 else np.inf
    return float(min(by_series, np.inf if closed else _TAYLOR_REACH / _largest(group), 1e6))


def _largest(group: MatrixGroup) -> float:
    """|hat(Theta)| is at most so much times |Theta|."""
    return float(np.linalg.norm(np.asarray(group.basis).reshape(group.dim, -1), 2))


@lru_cache(maxsize=256)
def _in_series(group: MatrixGroup) -> bool:
    """Whether a step stays where the series of exp are all of it."""
    return reach_of(group, closed=derivation_of(group).closed_exponential) * _largest(group) <= _SERIES_REACH


def short_rate(ops: Arithmetic, states: ShortStates, y: Vector, rates: Rates, t: Scalar) -> Vector:
    """y' of y = (the elements as unit quaternions and entries beside them, v); see `short_state`."""
    elements = states.elements(y)
    velocities, slope = rates(t, list(elements), list(y[states.size :]))
    return [*states.rates(ops, y, elements, velocities), *slope]


def product_rate(
    ops: Arithmetic, moves: Sequence[Move], elements: Sequence[Any], y: Vector, rates: Rates, t: Scalar
) -> Vector:
    """y' of y = (Theta_1, ..., v), from the elements where the step began."""
    thetas, place = [], 0
    for move in moves:
        thetas.append(list(y[place : place + move.group.dim]))
        place += move.group.dim
    now = [
        move(NearIdentity(ops) if _in_series(move.group) else ops, X, theta)
        for move, X, theta in zip(moves, elements, thetas, strict=True)
    ]
    velocities, slope = rates(t, now, list(y[place:]))
    turned = [turning(ops, m.group, a, b) for m, a, b in zip(moves, thetas, velocities, strict=True)]
    return [x for each in turned for x in each] + list(slope)
