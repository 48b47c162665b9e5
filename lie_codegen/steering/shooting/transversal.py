"""Extremals that end on a set of goals T exp(span F): Newton's method on the end and on transversality together.

The least energy over the set is at an extremal whose costate at the end annihilates the set's tangent, <mu(1), F_j> = 0. Unknown are
mu(0), n numbers, and the place on the set, k numbers; with xi = vee(X^-1 dX/d mu0) the n + k equations and their derivatives are exact:
    vee(T^-1 X(1)) = 0,          d = xi d mu0 - F' dh,
    F mu(1) = 0,                 d = F (Ad_X(1)* + W xi) d mu0,    W_ji = <mu(1), [A_i, A_j]>.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.steering.shooting.extremal import Extremal

_ITERATIONS = 25
_HALVINGS = 8
#: Most that a step changes a costate, in units of 1 + its size.
_LEAP = 100.0
#: Misses that are rounding; what Newton's steps come to on well-posed problems is below 1e-13.
_THERE = 1e-11


@dataclass(frozen=True, eq=False)
class Met:
    """Where Newton's method came to.

    Attributes:
        extremal: the extremal.
        target: (d, d) the element of the set that it ends at.
        miss: |vee(T^-1 X(1))|.
        transversality: |F mu(1)| relative to |mu(1)|; 0 at rest.
    """

    extremal: Extremal
    target: Array = field(repr=False)
    miss: float
    transversality: float

    @property
    def converged(self) -> bool:
        """Whether both hold to rounding."""
        return self.miss <= _THERE and self.transversality <= _THERE


def met(flown: Callable[[Array], Extremal], mu0: Array, target: Array, free: Array) -> Met:
    """The extremal near that of mu0 that ends on the set target exp(span free), and meets it transversally.

    Args:
        flown: (n,) costate -> its extremal.
        mu0: (n,) costate of an extremal that ends near the set.
        target: (d, d) an element of the set near its end.
        free: (k, n) F.
    """
    n = len(mu0)
    at = _measured(flown(mu0), target, free)
    for _ in range(_ITERATIONS):
        if at.converged:
            break
        extremal = at.extremal
        xi = extremal.sensitivities[-1]
        top = np.hstack([xi, -free.T])
        bottom = np.hstack([free @ end_slope(extremal), np.zeros((len(free), len(free)))])
        miss, across = _equations(extremal, at.target, free)
        # least squares: where a motion of the set costs nothing (spheres of equal points) the matrix is singular along it
        step = np.linalg.lstsq(np.vstack([top, bottom]), -np.concatenate([miss, across]), rcond=1e-10)[0]
        # a matrix that is singular but for rounding asks for costates of 1e9, whose extremals turn as often
        step = step * min(
            1.0, _LEAP * (1 + np.linalg.norm(extremal.mu0)) / max(float(np.linalg.norm(step[:n])), 1e-300)
        )
        for halving in range(_HALVINGS):
            part = step * 0.5**halving
            moved = at.target @ expm(extremal.group.hat(part[n:] @ free))
            trial = _measured(flown(extremal.mu0 + part[:n]), moved, free)
            if trial.miss + trial.transversality < at.miss + at.transversality:
                break
        else:
            break
        at = trial
    return at


def end_slope(extremal: Extremal) -> Array:
    """(n, n) d mu(1) / d mu(0): of the costate, and of the end at which it is read."""
    group, X = extremal.group, extremal.X[-1]
    carried = group.project(X @ group.basis @ np.linalg.inv(X))
    # <mu(1), A> = <mu(0), Ad_X(1) A>: the first part is Ad_X(1)*; the second is what moving X(1) by xi does to Ad_X(1) A, a bracket with xi
    turning = np.einsum("ijk,k->ji", group.algebra.structure_constants, extremal.costates[-1])
    return np.asarray(carried + turning @ extremal.sensitivities[-1])


def _equations(extremal: Extremal, target: Array, free: Array) -> tuple[Array, Array]:
    away = np.linalg.solve(target, extremal.X[-1])
    return extremal.group.project(away - np.eye(len(away))), free @ extremal.costates[-1]


def _measured(extremal: Extremal, target: Array, free: Array) -> Met:
    away = np.linalg.solve(target, extremal.X[-1]) - np.eye(len(target))
    across = free @ extremal.costates[-1]
    size = float(np.linalg.norm(extremal.costates[-1]))
    # a costate of rounding is rest: where the set holds the start no motion is the best, and has no direction to be transversal in
    transversality = float(np.linalg.norm(across)) / size if size > _THERE else 0.0
    return Met(extremal, target, float(np.linalg.norm(away)), transversality)


def focal_times(extremal: Extremal, free: Array) -> tuple[float, ...]:
    """Times in (0, 1) at which a neighbouring extremal that also ends on the set, transversally, crosses this one: past such a time
    the way is no local minimum over the set.

    Fields that vanish at t and begin with d mu = p end with xi = (xi(1) - Ad_(X(1)^-1 X(t)) xi(t)) p and d mu(1) = slope p: those rows
    of xi that the set leaves out and F d mu(1) must vanish together, an n by n determinant.
    """
    group = extremal.group
    xi = extremal.sensitivities
    steps = len(xi)
    grid = np.linspace(0, 1, steps + 1)[1:-1]
    nodes = np.linspace(0, 1, len(extremal.X))
    back = np.linalg.inv(extremal.X[-1])
    outside = np.linalg.svd(free)[2][len(free) :]
    bottom = free @ end_slope(extremal)
    matrices = []
    for number, t in enumerate(grid):
        node = int(np.argmin(np.abs(nodes - t)))
        if abs(nodes[node] - t) > 1e-12:
            continue
        relative = back @ extremal.X[node]
        carried = group.project(relative @ group.basis @ np.linalg.inv(relative)).T
        matrices.append((t, np.vstack([outside @ (xi[-1] - carried @ xi[number]), bottom])))
    times = np.array([t for t, _ in matrices])
    # rows without a length (at rest the lower ones) stay zero: their matrix is singular, of no known sign
    stack = np.array([_of_unit_rows(matrix) for _, matrix in matrices])
    sizes = np.linalg.svd(stack, compute_uv=False)
    known = np.flatnonzero(sizes[:, -1] > 1e-7 * sizes[:, 0])
    sign = np.linalg.slogdet(stack[known])[0]
    changes = np.flatnonzero(sign[1:] != sign[:-1])
    return tuple(float((times[known[k]] + times[known[k + 1]]) / 2) for k in changes)


def _of_unit_rows(matrix: Array) -> Array:
    lengths = np.linalg.norm(matrix, axis=1, keepdims=True)
    return np.asarray(np.divide(matrix, lengths, out=np.zeros_like(matrix), where=lengths > 0))
