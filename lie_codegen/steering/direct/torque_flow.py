"""Body velocities under torques, at the points where a chain of exponentials asks for them, and how they change with the torques.

    xi' = Q(xi, xi) + J^-1 B u(t),   Q(xi, xi) = J^-1 ad*_xi J xi

does not see X. Runge and Kutta's steps follow it; on each step Hermite's cubic through both ends gives xi at the two Gauss points. The
variational equation of every step is taken at once, since its stages are known, and carried on from step to step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lie_codegen.arrays import Array

#: Gauss points of a step.
GAUSS = (0.5 - np.sqrt(3) / 6, 0.5 + np.sqrt(3) / 6)
#: Velocities, in units of a turn a duration, beyond which a lane ran away.
_FAR = 1e4
#: Derivatives beyond are those of lanes that ran away.
_STEEP = 1e30


@dataclass(frozen=True, eq=False)
class TorqueFlow:
    """Torques of m controls in slots, constant on pieces or linear between nodes, and the motion of the velocity.

    Attributes:
        euler: (n, n, n) Q.
        push: (n, m) J^-1 B.
        begin: (n,) xi at the start.
        duration: in seconds.
        pieces, steps: of the torques, and steps of a piece.
        linear: whether torques are linear between nodes.
    """

    euler: Array
    push: Array
    begin: Array
    duration: float
    pieces: int
    steps: int
    linear: bool

    @property
    def slots(self) -> int:
        """Of torques."""
        return self.pieces + self.linear

    def _shares(self) -> tuple[Array, Array]:
        """(M,) the first slot of each step, and (M, 3, 2) the weights of it and the next one at its beginning, middle and end."""
        piece = np.repeat(np.arange(self.pieces), self.steps)
        if not self.linear:
            return piece, np.tile([1.0, 0.0], (len(piece), 3, 1))
        s = (np.tile(np.arange(self.steps), self.pieces)[:, None] + [0, 0.5, 1]) / self.steps
        return piece, np.stack([1 - s, s], axis=-1)

    def velocities(self, u: Array, lasting: Array) -> tuple[Array, Array, Array, Array]:
        """Of torques u (L, S, m) over `lasting` (L,) times the duration: xi (L, M, 2, n) at the Gauss points of the steps, how they
        change (L, M, 2, n, S m + 1), the last column by lasting; xi at the end (L, n) and how it changes."""
        lanes, slots, m = u.shape
        n, first = len(self.begin), self._shares()[0]
        share = self._shares()[1]
        after = np.minimum(first + 1, slots - 1)
        driven = share[..., :1] * u[:, first, None] + share[..., 1:] * u[:, after, None]
        push = driven @ self.push.T  # (L, M, 3, n)
        h0 = self.duration / len(first)
        h = (h0 * lasting)[:, None]
        stages = np.empty((len(first), 4, lanes, n))
        ends = np.empty((len(first) + 1, lanes, n))
        ends[0] = self.begin
        far = _FAR / self.duration
        with np.errstate(over="ignore", invalid="ignore"):
            for j in range(len(first)):
                x = ends[j]
                k1 = self._rate(x, push[:, j, 0])
                x2 = x + h / 2 * k1
                k2 = self._rate(x2, push[:, j, 1])
                x3 = x + h / 2 * k2
                k3 = self._rate(x3, push[:, j, 1])
                x4 = x + h * k3
                stages[j] = x, x2, x3, x4
                new = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + self._rate(x4, push[:, j, 2]))
                ends[j + 1] = np.where(np.abs(new) < far, new, far)  # false for NaN too
        return self._moved(np.moveaxis(stages, 2, 0), np.moveaxis(ends, 1, 0), push, h[:, :, None], h0, slots, m)

    def _rate(self, xi: Array, push: Array) -> Array:
        n = xi.shape[-1]
        outer = (xi[..., :, None] * xi[..., None, :]).reshape(*xi.shape[:-1], n * n)
        return np.asarray(outer @ self.euler.reshape(n, n * n).T + push)

    def _moved(
        self, stages: Array, ends: Array, push: Array, h: Array, h0: float, slots: int, m: int
    ) -> tuple[Array, Array, Array, Array]:
        """Velocities at the Gauss points and all derivatives, from the stages (L, M, 4, n) and ends (L, M + 1, n) of the steps."""
        lanes, M, _, n = stages.shape
        first, share = self._shares()
        both = self.euler + np.swapaxes(self.euler, 1, 2)
        # columns of each step's own derivatives: xi at its beginning (n), torques of its two slots (2 m), lasting (1)
        own = n + 2 * m + 1
        pushed = np.zeros((M, 3, n, own))
        pushed[..., n : n + m] = share[..., :1, None] * self.push
        pushed[..., n + m : -1] = share[..., 1:, None] * self.push
        wide = h[..., None]

        def slope(k: int, when: int, dx: Array) -> Array:
            return np.asarray(np.einsum("kij,lmi->lmkj", both, stages[:, :, k]) @ dx + pushed[:, when])

        def rate(k: int, when: int) -> Array:
            return self._rate(stages[:, :, k], push[:, :, when])

        begin = np.zeros((lanes, M, n, own))
        begin[..., :n] = np.eye(n)
        rates = [rate(0, 0), rate(1, 1), rate(2, 1), rate(3, 2)]
        slopes: list[Array] = []
        for k, (when, part) in enumerate(((0, 0.0), (1, 0.5), (1, 0.5), (2, 1.0))):
            dx = begin.copy()
            if k:
                dx += part * wide * slopes[-1]
                dx[..., -1] += part * h0 * rates[k - 1]  # h = h0 lasting
            slopes.append(slope(k, when, dx))
        weights = (1 / 6, 1 / 3, 1 / 3, 1 / 6)
        change = begin + wide * sum(w * s for w, s in zip(weights, slopes, strict=True))
        change[..., -1] += h0 * sum(w * r for w, r in zip(weights, rates, strict=True))
        last = self._rate(ends[:, 1:], push[:, :, 2])
        last_slope = np.einsum("kij,lmi->lmkj", both, ends[:, 1:]) @ change + pushed[:, 2]
        at, moved = [], []
        for c in GAUSS:
            # Hermite's cubic through both ends with their rates
            a, b = 1 - 3 * c**2 + 2 * c**3, 3 * c**2 - 2 * c**3
            d, e = c - 2 * c**2 + c**3, c**3 - c**2
            at.append(a * ends[:, :-1] + b * ends[:, 1:] + h * (d * rates[0] + e * last))
            by = a * begin + b * change + wide * (d * slopes[0] + e * last_slope)
            by[..., -1] += h0 * (d * rates[0] + e * last)
            moved.append(by)
        return self._carried(np.stack(at, 2), np.stack(moved, 2), change, ends[:, -1], first, slots, m)

    def _carried(
        self, at: Array, moved: Array, change: Array, last: Array, first: Array, slots: int, m: int
    ) -> tuple[Array, Array, Array, Array]:
        """Derivatives by all torques, from those of each step by its own."""
        lanes, M, _, n, _ = moved.shape
        # lanes that ran away have huge derivatives: they count as infinitely far off, and no step starts from them
        moved, change = (np.clip(np.nan_to_num(each), -_STEEP, _STEEP) for each in (moved, change))
        S = np.zeros((lanes, n, slots * m + 1))
        everything = np.empty((lanes, M, 2, n, slots * m + 1))
        for j in range(M):
            here = slice(first[j] * m, (first[j] + 2) * m if first[j] + 1 < slots else slots * m)
            width = here.stop - here.start
            everything[:, j] = moved[:, j, :, :, :n] @ S[:, None]
            everything[:, j, ..., here] += moved[:, j, ..., n : n + width]
            everything[:, j, ..., -1] += moved[:, j, ..., -1]
            S = change[:, j, :, :n] @ S
            S[..., here] += change[:, j, ..., n : n + width]
            S[..., -1] += change[:, j, ..., -1]
            S = np.clip(S, -_STEEP, _STEEP)
        return at, everything, last, S
