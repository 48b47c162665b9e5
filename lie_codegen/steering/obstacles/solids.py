"""Distances from points to balls, boxes, cylinders and round bars, negative inside, with their gradients; many solids at once.

In the solid's own axes a point q has coordinates s: |q_i| of a box, (distance from the axis, |q along it|) of a cylinder. With the
half sizes h, e = s - h, and a rounding r (of a ball with h = 0, of a bar with one half length),

    gap = |max(e, 0)| + min(max_i e_i, 0) - r

is the distance to the surface of the rounded solid, and changes by no more than the point moves.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from lie_codegen.arrays import Array


@dataclass(frozen=True, eq=False)
class Solids:
    """Solids as arrays; q is the dimension of space.

    Attributes:
        centers: (o, q).
        axes: (o, q, q), the solid's own axes in the columns.
        halves: (o, q) half sizes; of a cylinder its radius, nothing, and half its length.
        rounding: (o,) r.
        tubes: (o,) which are cylinders.
    """

    centers: Array
    axes: Array
    halves: Array
    rounding: Array
    tubes: Array

    def __len__(self) -> int:
        return len(self.rounding)

    @staticmethod
    def joined(parts: list[Solids]) -> Solids:
        """All of them, one after the other."""
        return Solids(*(np.concatenate([getattr(one, each.name) for one in parts]) for each in fields(Solids)))

    def at(self, rows: Array) -> Solids:
        """Some of them."""
        return Solids(*(getattr(self, each.name)[rows] for each in fields(self)))

    @property
    def sizes(self) -> Array:
        """(o,) half of the least thickness."""
        halves = np.where(self.tubes[:, None] & (np.arange(self.halves.shape[1]) == 1), np.inf, self.halves)
        return np.asarray(np.min(halves, axis=1) + self.rounding)

    @property
    def extents(self) -> Array:
        """(o, q) how far each reaches along its own axes."""
        halves = self.halves.copy()
        halves[self.tubes, 1] = halves[self.tubes, 0]
        return np.asarray(halves + self.rounding[:, None])

    def corners(self) -> tuple[Array, Array]:
        """(o, q) least and largest coordinates in space, or a little beyond."""
        reach = np.einsum("oij,oj->oi", np.abs(self.axes), self.extents)
        return self.centers - reach, self.centers + reach

    def seen(self, p: Array) -> tuple[Array, Array]:
        """Gaps (..., o) of points p (..., o, q), each from its own solid, and their gradients (..., o, q)."""
        q = np.einsum("...oi,oij->...oj", p - self.centers, self.axes)
        s, unit = np.abs(q), np.where(q < 0, -1.0, 1.0)
        if np.any(self.tubes):
            round_ = self.tubes[:, None]
            off = np.linalg.norm(q[..., :2], axis=-1)
            s = np.where(round_, np.stack([off, np.full_like(off, -np.inf), s[..., -1]], axis=-1), s)
        e = s - self.halves
        beyond = np.maximum(e, 0.0)
        far = np.linalg.norm(beyond, axis=-1)
        deepest = np.max(e, axis=-1)
        first = np.arange(e.shape[-1]) == np.argmax(e, axis=-1)[..., None]
        outwards = np.where(far[..., None] > 0, beyond / np.maximum(far, 1e-300)[..., None], first)
        normal = outwards * unit
        if np.any(self.tubes):
            radial = q[..., :2] / np.maximum(off, 1e-300)[..., None] * outwards[..., :1]
            normal[..., :2] = np.where(round_, radial, normal[..., :2])
        gap = far + np.minimum(deepest, 0.0) - self.rounding
        return gap, np.einsum("...oj,oij->...oi", normal, self.axes)
