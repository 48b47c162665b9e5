"""Bounds of phi/|d phi|^2 for phi = tr(K (1 - E))/2 on SO(3), proved by branch and bound in interval arithmetic.

With the unit quaternion of E along (c, s m), m on the faces of a cube and (c, s) = (1, s) or (c, 1), s and c in [0, 1], and A = tr(K) 1 - K:

    phi = s^2 m^T A m/|q|^2,   d phi = s w/|q|^2,   w = c A m - s m x A m,   |q|^2 = c^2 + s^2 |m|^2
    phi/|d phi|^2 = |q|^2 m^T A m/(w^T I^-1 w)

so that the zero at the reference cancels. With R^T R = I^-1 and S^T S = A (Cholesky: squares stay squares) the claim phi <= b_1 |d phi|^2 is
b_1 |R w|^2 - |q|^2 |S m|^2 >= 0, a polynomial. Boxes above the level are dropped, boxes where the least value of the interval is not negative
are proved, all others are cut in eight. Every operation is rounded outwards.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lie_codegen.arrays import Array

#: Outward rounding of one operation, relative to its result: some hundred times that of doubles.
_PAD = 1e-13
_MOST_BOXES = 3_000_000


class Interval(NamedTuple):
    """Arrays of lower and upper ends."""

    low: Array
    high: Array


def _padded(low: Array, high: Array) -> Interval:
    slack = _PAD * np.maximum(np.abs(low), np.abs(high)) + 1e-300
    return Interval(low - slack, high + slack)


def _sum(parts: list[Interval]) -> Interval:
    return _padded(np.sum([p.low for p in parts], axis=0), np.sum([p.high for p in parts], axis=0))


def _times(factor: float, x: Interval) -> Interval:
    low, high = (x.low, x.high) if factor >= 0 else (x.high, x.low)
    return _padded(factor * low, factor * high)


def _product(x: Interval, y: Interval) -> Interval:
    ends = np.stack([x.low * y.low, x.low * y.high, x.high * y.low, x.high * y.high])
    return _padded(ends.min(axis=0), ends.max(axis=0))


def _square(x: Interval) -> Interval:
    small = np.where((x.low <= 0) & (x.high >= 0), 0.0, np.minimum(x.low**2, x.high**2))
    return _padded(small, np.maximum(x.low**2, x.high**2))


def proved_ratio(gain: Array, inertia: Array, level: float, bound: float, *, upper: bool) -> bool:
    """Whether phi <= bound |d phi|^2 (`upper`), or phi >= bound |d phi|^2, is proved on all of {phi <= level}.

    False says nothing: there may be a counterexample, or the boxes did not suffice.
    """
    claim = _Claim(gain, inertia, bound, 1.0 if upper else -1.0)
    # (face of the cube, patch, u, v, s or c): the first two as numbers in front
    boxes = np.array([[[f, p], [-1, 1], [-1, 1], [0, 1]] for f in range(3) for p in range(2)], dtype=float)
    counted = len(boxes)
    while len(boxes):
        margin, phi = claim(boxes)
        open_ = (margin.low < 0) & (phi.low <= level)
        if np.any(open_ & (margin.high < 0) & (phi.high <= level)):
            return False
        boxes = _cut(boxes[open_])
        counted += len(boxes)
        if counted > _MOST_BOXES:
            return False
    return True


def _cut(boxes: Array) -> Array:
    """All three sides halved."""
    for side in (1, 2, 3):
        middle = boxes[:, side].mean(axis=1)
        lower, upper = boxes.copy(), boxes.copy()
        lower[:, side, 1] = middle
        upper[:, side, 0] = middle
        boxes = np.concatenate([lower, upper])
    return boxes


class _Claim:
    """sign (bound |R w|^2 - |q|^2 |S m|^2), and phi, on boxes."""

    def __init__(self, gain: Array, inertia: Array, bound: float, sign: float) -> None:
        A = np.trace(gain) * np.eye(3) - gain
        self.R, self.S = np.linalg.cholesky(np.linalg.inv(inertia)).T, np.linalg.cholesky(A).T
        self.bound, self.sign = bound, sign
        # m x A m by its monomials, so that each of them is one interval: form[i] is the matrix of its i-th component
        form = np.zeros((3, 3, 3))
        for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
            form[i, j] += A[k]
            form[i, k] -= A[j]
        self.RA, self.form = self.R @ A, np.einsum("ri,ijk->rjk", self.R, form)

    def __call__(self, boxes: Array) -> tuple[Interval, Interval]:
        ones = np.ones(len(boxes))
        one = Interval(ones, ones)
        u, v, last = (Interval(boxes[:, side, 0], boxes[:, side, 1]) for side in (1, 2, 3))
        face, patch = boxes[:, 0, 0].astype(int), boxes[:, 0, 1].astype(int)
        m = [_chosen(face, [[one, u, u], [u, one, v], [v, v, one]][k]) for k in range(3)]
        c, s = _chosen(patch, [one, last]), _chosen(patch, [last, one])
        squares = [_square(x) for x in m]
        mixed = {(j, k): _product(m[j], m[k]) for j, k in ((0, 1), (0, 2), (1, 2))}
        Rw = []
        for r in range(3):
            straight = _sum([_times(self.RA[r, j], m[j]) for j in range(3)])
            terms = [_times(self.form[r, j, j], squares[j]) for j in range(3)]
            terms += [_times(self.form[r, j, k] + self.form[r, k, j], mixed[j, k]) for j, k in mixed]
            Rw.append(_square(_sum([_product(c, straight), _times(-1.0, _product(s, _sum(terms)))])))
        energy = _sum([_square(_sum([_times(self.S[i, j], m[j]) for j in range(i, 3)])) for i in range(3)])
        whole = _sum([_square(c), _product(_square(s), _sum(squares))])
        margin = _sum([_times(self.sign * self.bound, _sum(Rw)), _times(-self.sign, _product(whole, energy))])
        top = _product(_square(s), energy)
        phi = _padded(top.low / whole.high, top.high / whole.low)
        return margin, phi


def _chosen(which: Array, choices: list[Interval]) -> Interval:
    return Interval(np.choose(which, [c.low for c in choices]), np.choose(which, [c.high for c in choices]))
