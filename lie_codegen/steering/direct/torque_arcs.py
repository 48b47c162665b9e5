"""Arcs of constant torque, many words at once: where they end and how the end moves with the durations of the arcs.

    X' = X hat(xi),   J xi' = ad*_xi J xi + f_k   on arc k, for a duration s_k

The arcs are no exponentials: each is followed by Runge and Kutta's steps together with its variational equation in the left
trivialisation, X -> X exp(zeta), xi -> xi + delta:  zeta' = delta - [xi, zeta],  delta' = D(xi) delta. An arc that takes ds longer
moves its end by (xi, xi') ds, and what comes after carries that to the end of the word.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from lie_codegen.algebra.brackets import ad, ad_star, bracket
from lie_codegen.arrays import Array
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.direct.chain import flat, residual
from lie_codegen.steering.direct.numpy_search import Lanes, Rows
from lie_codegen.steering.direct.programme import Goal

#: States beyond are lanes that ran away.
_FAR = 1e6


@dataclass(frozen=True, eq=False)
class TorqueArcs:
    """Words of arcs from rest, or from a velocity, to an element and a velocity.

    Attributes:
        group: the group.
        goal: one value for all lanes.
        euler: (n, n, n), xi'_k = euler_kij xi_i xi_j + torques.
        words: (lanes, K, n) J^-1 f of each arc.
        ends: (2, n) velocities at the start and at the end.
        steps: Runge and Kutta's steps an arc.
    """

    group: MatrixGroup = field(repr=False)
    goal: Goal = field(repr=False)
    euler: Array = field(repr=False)
    words: Array = field(repr=False)
    ends: Array = field(repr=False)
    steps: int

    def look(self, lanes: Rows, durations: Array) -> Lanes:
        """Residual of (X, xi) at the end, reduced to 2n rows, and its derivative by the durations (k, K)."""
        X, xi, slopes = self._flown(self.words[lanes], durations)
        largest = [np.max(np.abs(each).reshape(len(durations), -1), axis=1) for each in (X, xi, slopes)]
        whole = np.max(largest, axis=0) < _FAR  # false for NaN too
        X = np.where(whole[:, None, None], X, np.eye(self.group.degree))
        xi, slopes = np.where(whole[:, None], xi, 0.0), np.where(whole[:, None, None], slopes, 0.0)
        full, reduce = residual(self.group.basis, self.goal, X)
        over = xi - self.ends[1]
        # the slopes of the residual of X by the motions X exp(zeta) are those of the reduction: D'D = L L', rows L^-1 D'
        tangent = (self.goal.left @ X)[:, None] @ self.group.basis @ self.goal.right
        moved = np.einsum("lnq,lkq->lnk", reduce, flat(tangent))
        n = self.group.dim
        J = np.concatenate([moved @ slopes[:, :n], slopes[:, n:]], axis=1)
        r = np.concatenate([np.einsum("lnq,lq->ln", reduce, full), over], axis=1)
        size = np.sqrt(np.sum(full**2, axis=1) + np.sum(over**2, axis=1))
        return Lanes(durations, np.where(whole, size, np.inf), r, J)

    def _flown(self, words: Array, durations: Array) -> tuple[Array, Array, Array]:
        """X (L, d, d), xi (L, n) at the end, and (L, 2n, K): (zeta, delta) at the end by the duration of each arc."""
        group, n = self.group, self.group.dim
        lanes, arcs = durations.shape
        X = np.broadcast_to(np.eye(group.degree, dtype=group.basis.dtype), (lanes, group.degree, group.degree))
        xi = np.broadcast_to(self.ends[0], (lanes, n))
        carried = np.empty((lanes, arcs, 2 * n, 2 * n))
        leaving = np.empty((lanes, 2 * n, arcs))
        with np.errstate(over="ignore", invalid="ignore"):
            for k in range(arcs):
                X, xi, carried[:, k] = self._arc(X, xi, words[:, k], durations[:, k])
                leaving[:, :n, k], leaving[:, n:, k] = xi, self._rate(xi, words[:, k])
            after = np.broadcast_to(np.eye(2 * n), (lanes, 2 * n, 2 * n))
            for k in range(arcs - 1, -1, -1):
                leaving[:, :, k] = np.einsum("lij,lj->li", after, leaving[:, :, k])
                after = after @ carried[:, k]
        return X, xi, leaving

    def _arc(self, X: Array, xi: Array, f: Array, s: Array) -> tuple[Array, Array, Array]:
        n = self.group.dim
        h = (s / self.steps)[:, None]
        wide = h[..., None]
        P = np.broadcast_to(np.eye(2 * n), (len(s), 2 * n, 2 * n))
        for _ in range(self.steps):
            k1 = self._rate(xi, f)
            x2 = xi + h / 2 * k1
            k2 = self._rate(x2, f)
            x3 = xi + h / 2 * k2
            k3 = self._rate(x3, f)
            x4 = xi + h * k3
            k4 = self._rate(x4, f)
            new = xi + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            P = _step(P, self._linear(np.stack([xi, x2, x3, x4])), wide)
            # Magnus' series of fourth order, the middle by Hermite's cubic: X stays on the group, where the goal is
            middle = (xi + new) / 2 + h / 8 * (k1 - self._rate(new, f))
            turn = h / 6 * (xi + 4 * middle + new) + h**2 / 12 * bracket(self.group.algebra, xi, new)
            X, xi = X @ expm(self.group.hat(turn)), new
        return X, xi, P

    def _rate(self, xi: Array, f: Array) -> Array:
        n = self.group.dim
        outer = (xi[..., :, None] * xi[..., None, :]).reshape(*xi.shape[:-1], n * n)
        return np.asarray(outer @ self.euler.reshape(n, n * n).T + f)

    def _linear(self, xi: Array) -> Array:
        """The matrix of the variational equation, (..., 2n, 2n)."""
        n = self.group.dim
        A = np.zeros((*xi.shape[:-1], 2 * n, 2 * n))
        A[..., :n, :n] = -ad(self.group.algebra, xi)
        A[..., :n, n:] = np.eye(n)
        both = self.euler + np.swapaxes(self.euler, 1, 2)
        A[..., n:, n:] = np.einsum("kij,...i->...kj", both, xi)
        return A


def euler_constants(group: MatrixGroup, inertia: Array) -> Array:
    """(n, n, n) with J^-1 ad*_xi J xi = sum_ij euler_kij xi_i xi_j."""
    n, eye = group.dim, np.eye(group.dim)
    pairs = ad_star(group.algebra, np.repeat(eye, n, axis=0), np.tile(inertia.T, (n, 1)))
    return np.asarray(np.linalg.solve(inertia, pairs.T).reshape(n, n, n))


def _step(P: Array, A: Array, h: Array) -> Array:
    """P' = A P by Runge and Kutta's step, A at its four stages."""
    k1 = A[0] @ P
    k2 = A[1] @ (P + h / 2 * k1)
    k3 = A[2] @ (P + h / 2 * k2)
    k4 = A[3] @ (P + h * k3)
    return np.asarray(P + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
