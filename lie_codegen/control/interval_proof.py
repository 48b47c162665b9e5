"""Bounds of phi/|d phi|^2 for phi = tr(K (1 - E))/2 on SO(3), proved by branch and bound in interval arithmetic.

With the unit quaternion of E along (c, s m), m on the faces of a cube and (c, s) = (1, s) or (c, 1), s and c in [0, 1], and A = tr(K) 1 - K:

    phi = s^2 m^T A m/|q|^2,   d phi = s w/|q|^2,   w = c A m - s m x A m,   |q|^2 = c^2 + s^2 |m|^2
    phi/|d phi|^2 = |q|^2 m^T A m/(w^T I^-1 w)

so that the zero at the reference cancels. With R^T R = I^-1 and S^T S = A (Cholesky: squares stay squares) the claim phi <= b_1 |d phi|^2 is
b_1 |R w|^2 - |q|^2 |S m|^2 >= 0, a polynomial. Boxes above the level are dropped, boxes where the least value of the interval is not negative
are proved, all others are cut in eight. Every operation is rounded outwards.
"""

from __future__ import annotations

from collections.abc import Callable
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
    # not the product of x with itself, which takes its factors for two numbers: that of [-1, 1] is [-1, 1], the square [0, 1]
    small = np.where((x.low <= 0) & (x.high >= 0), 0.0, np.minimum(x.low**2, x.high**2))
    return _padded(small, np.maximum(x.low**2, x.high**2))


def proved_ratio(gain: Array, inertia: Array, level: float, bound: float, *, upper: bool) -> bool:
    """Whether phi <= bound |d phi|^2 (`upper`), or phi >= bound |d phi|^2, is proved on all of {phi <= level}.

    False says nothing: there may be a counterexample, or the boxes did not suffice.
    """
    claim = _Claim(gain, inertia, bound, 1.0 if upper else -1.0)
    return _proved(claim, _patches(), level, (1, 2, 3))


def proved_hessian(gain: Array, inertia: Array, nabla: Array, level: float, bound: float) -> bool:
    """Whether |H - d phi . nabla|_I <= bound is proved on all of {phi <= level}; False says nothing."""
    claims = [_HessianClaim(gain, inertia, nabla, bound, sign) for sign in (1.0, -1.0)]
    return all(_proved(claim, _patches(), level, (1, 2, 3)) for claim in claims)


def proved_transport(inertia: Array, nabla: Array, bound: float) -> bool:
    """Whether |nabla_Z X|_I <= bound |Z|_I |X|_I is proved; False says nothing."""
    if np.array_equal(inertia, inertia[0, 0] * np.eye(3)):
        # nabla_Z X = Z x X/2 here, so the supremum is 1/(2 sqrt I), attained for every Z: boxes would be cut for ever beside it.
        return bool(bound * np.sqrt(inertia[0, 0]) >= 0.5 * (1 + _PAD))
    flat = np.array([[[f, 0], [-1, 1], [-1, 1], [0, 0]] for f in range(3)], dtype=float)
    return _proved(_TransportClaim(inertia, nabla, bound), flat, 0.0, (1, 2))


def _patches() -> Array:
    """(6, 4, 2): face of the cube and patch, then u, v, and s or c."""
    return np.array([[[f, p], [-1, 1], [-1, 1], [0, 1]] for f in range(3) for p in range(2)], dtype=float)


def _proved(
    claim: Callable[[Array], tuple[Interval, Interval]], boxes: Array, level: float, sides: tuple[int, ...]
) -> bool:
    """Branch and bound: boxes above the level are dropped, those where the margin is not negative are proved, the others cut."""
    counted = len(boxes)
    while len(boxes):
        margin, phi = claim(boxes)
        open_ = (margin.low < 0) & (phi.low <= level)
        if np.any(open_ & (margin.high < 0) & (phi.high <= level)):
            return False  # a whole box within the level breaks the claim
        boxes = _cut(boxes[open_], sides)
        counted += len(boxes)
        if counted > _MOST_BOXES:
            return False
    return True


def _cut(boxes: Array, sides: tuple[int, ...]) -> Array:
    """These sides halved."""
    for side in sides:
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
        m, c, s = _places(boxes)
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
        # |q|^2 >= 1 on the faces of the cube or where c = 1, so that the quotient's ends are those of its parts, the other way round below
        phi = _padded(top.low / whole.high, top.high / whole.low)
        return margin, phi


class _HessianClaim:
    """bound |q|^2 1 + sign |q|^2 L^-1 M L^-T is positive, M = sym H - d phi . nabla, L L^T = I; M is linear in E, so in the monomials of q."""

    def __init__(self, gain: Array, inertia: Array, nabla: Array, bound: float, sign: float) -> None:
        self.A = np.trace(gain) * np.eye(3) - gain
        self.S = np.linalg.cholesky(self.A).T
        root = np.linalg.inv(np.linalg.cholesky(inertia))
        hat = np.zeros((3, 3, 3))
        for a, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
            hat[a, k, j], hat[a, j, k] = 1, -1
        # d phi_a = -tr(K E A_a)/2 and A_a(A_b phi) = -tr(K E A_a A_b)/2, as coefficients of the entries of E
        slope = -np.einsum("ajk,ki->aij", hat, gain) / 2
        second = -np.einsum("ajk,bkl,li->abij", hat, hat, gain) / 2
        M = (second + second.swapaxes(0, 1)) / 2 - np.einsum("abc,cij->abij", (nabla + nabla.swapaxes(0, 1)) / 2, slope)
        M = np.einsum("ra,abij,sb->rsij", root, M, root)
        # |q|^2 E = (c^2 - s^2 |m|^2) 1 + 2 s^2 m m^T + 2 c s hat(m): c^2, then s^2 m_i m_j, then c s m_i
        one = np.eye(3)
        self.square = bound * one + sign * np.einsum("rsii->rs", M)
        double = 2 * M - np.einsum("rskk->rs", M)[:, :, None, None] * one
        self.form = bound * one[:, :, None, None] * one + sign * (double + double.swapaxes(2, 3)) / 2
        self.cross = 2 * sign * np.einsum("rsij,kij->rsk", M, hat)

    def __call__(self, boxes: Array) -> tuple[Interval, Interval]:
        m, c, s = _places(boxes)
        cc, ss, cs = _square(c), _square(s), _product(c, s)
        squares = [_square(x) for x in m]
        pairs = {
            (j, k): _product(ss, squares[j] if j == k else _product(m[j], m[k])) for j in range(3) for k in range(j, 3)
        }
        turns = [_product(cs, x) for x in m]
        B = {}
        for r in range(3):
            for t in range(r, 3):
                terms = [_times(self.square[r, t], cc)]
                terms += [_times(self.form[r, t, j, k] * (1 if j == k else 2), x) for (j, k), x in pairs.items()]
                terms += [_times(self.cross[r, t, k], x) for k, x in enumerate(turns)]
                B[r, t] = B[t, r] = _sum(terms)
        whole = _sum([cc, *(pairs[k, k] for k in range(3))])
        energy = _sum([_square(_sum([_times(self.S[i, j], m[j]) for j in range(i, 3)])) for i in range(3)])
        top = _product(ss, energy)
        return _positive(B), _padded(top.low / whole.high, top.high / whole.low)


class _TransportClaim:
    """bound^2 |x|^2 1 - B(x)^T B(x) is positive, B(x) z = nabla_z x in orthonormal coordinates: of second degree in x."""

    def __init__(self, inertia: Array, nabla: Array, bound: float) -> None:
        frame = np.linalg.inv(np.linalg.cholesky(inertia)).T
        T = np.einsum("abc,cd,ai,bj,dk->ijk", nabla, inertia, frame, frame, frame)
        gram = np.einsum("ijk,lmk->iljm", T, T)
        one = np.eye(3)
        form = bound**2 * one[:, :, None, None] * one - gram
        self.form = (form + form.swapaxes(2, 3)) / 2

    def __call__(self, boxes: Array) -> tuple[Interval, Interval]:
        x, _, _ = _places(boxes)
        pairs = {(j, k): _square(x[j]) if j == k else _product(x[j], x[k]) for j in range(3) for k in range(j, 3)}
        B = {}
        for r in range(3):
            for t in range(r, 3):
                terms = [_times(self.form[r, t, j, k] * (1 if j == k else 2), y) for (j, k), y in pairs.items()]
                B[r, t] = B[t, r] = _sum(terms)
        nothing = np.zeros(len(boxes))
        return _positive(B), Interval(nothing, nothing)


def _positive(B: dict[tuple[int, int], Interval]) -> Interval:
    """The least of the leading minors of a symmetric (3, 3) matrix: it is positive where that is (Sylvester)."""

    def minor(i: int, j: int, k: int, l: int) -> Interval:  # noqa: E741
        return _sum([_product(B[i, k], B[j, l]), _times(-1.0, _product(B[i, l], B[j, k]))])

    first, second = B[0, 0], _sum([_product(B[0, 0], B[1, 1]), _times(-1.0, _square(B[0, 1]))])
    third = _sum(
        [
            _product(B[0, 0], minor(1, 2, 1, 2)),
            _times(-1.0, _product(B[0, 1], minor(1, 2, 0, 2))),
            _product(B[0, 2], minor(1, 2, 0, 1)),
        ]
    )
    low = np.min([first.low, second.low, third.low], axis=0)
    # a minor of zero is no positive matrix: the margin must be above it
    return Interval(np.where(low == 0, -1e-300, low), np.min([first.high, second.high, third.high], axis=0))


def _places(boxes: Array) -> tuple[list[Interval], Interval, Interval]:
    """m, c and s on the boxes."""
    ones = np.ones(len(boxes))
    one = Interval(ones, ones)
    u, v, last = (Interval(boxes[:, side, 0], boxes[:, side, 1]) for side in (1, 2, 3))
    face, patch = boxes[:, 0, 0].astype(int), boxes[:, 0, 1].astype(int)
    m = [_chosen(face, [[one, u, u], [u, one, v], [v, v, one]][k]) for k in range(3)]
    return m, _chosen(patch, [one, last]), _chosen(patch, [last, one])


def _chosen(which: Array, choices: list[Interval]) -> Interval:
    return Interval(np.choose(which, [c.low for c in choices]), np.choose(which, [c.high for c in choices]))
