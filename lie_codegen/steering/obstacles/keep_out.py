"""How far states are from obstacles, in the obstacles' own units, and how that changes with the state.

    ball:  gap = |p - c| - r                         p the position, the last column of X
    cone:  gap = (cos h - (X a) . d) / sin h         near the cone's side the angle to it

Each is a function of one column o = X e of the state. Where X moves to exp(eta) X the column moves by eta o, and the gap by
<N, eta> with the matrix N = normal o'.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.constraints import Ball, Obstacle


@dataclass(frozen=True, eq=False)
class KeepOut:
    """Obstacles as arrays.

    Attributes:
        degree: d.
        columns: (o, d) e of each obstacle.
        centers, radii: (o, d) centres of balls, and their radii; zero and one for cones.
        directions, cosines, sines: of cones; (o, d) zero for balls.
        balls: (o,) which are balls.
    """

    degree: int
    columns: Array
    centers: Array
    radii: Array
    directions: Array
    cosines: Array
    sines: Array
    balls: Array

    @staticmethod
    def of(degree: int, obstacles: Sequence[Obstacle]) -> KeepOut:
        """The obstacles, checked before."""
        count = len(obstacles)
        columns, centers, directions = (np.zeros((count, degree)) for _ in range(3))
        radii, cosines, sines = np.ones(count), np.zeros(count), np.ones(count)
        for number, each in enumerate(obstacles):
            values = np.array(each.parameters())
            if isinstance(each, Ball):
                columns[number, -1] = 1
                centers[number, :-1], radii[number] = values[:-1], values[-1]
            else:
                columns[number, :3], directions[number, :3] = values[:3], values[3:6]
                cosines[number], sines[number] = values[6], np.sqrt(max(0.0, 1 - values[6] ** 2))
        balls = np.array([isinstance(each, Ball) for each in obstacles], dtype=bool)
        return KeepOut(degree, columns, centers, radii, directions, cosines, sines, balls)

    @property
    def axes(self) -> Array:
        """(k, d) the different columns that are looked at."""
        return np.unique(np.round(self.columns, 12), axis=0)

    @property
    def sizes(self) -> Array:
        """(o,) radii of balls, sines of the half angles of cones: what gaps compare with."""
        return np.where(self.balls, self.radii, self.sines)

    def gaps(self, X: Array) -> Array:
        """(..., d, d) -> (..., o); negative inside."""
        return self._seen(X)[0]

    def nearest(self, X: Array, margins: Array, few: int) -> tuple[Array, Array]:
        """Gaps less margins (..., few) of the nearest obstacles, and their N (..., few, d, d)."""
        gap, o, away, far = self._seen(X)
        gap = gap - margins
        few = min(few, gap.shape[-1])
        near = np.argpartition(gap, few - 1, axis=-1)[..., :few]
        o, away = (np.take_along_axis(each, near[..., None], axis=-2) for each in (o, away))
        unit = away / np.maximum(np.take_along_axis(far, near, axis=-1), 1e-12)[..., None]
        normal = np.where(self.balls[near][..., None], unit, (-self.directions / self.sines[:, None])[near])
        return np.take_along_axis(gap, near, axis=-1), normal[..., :, None] * o[..., None, :]

    def _seen(self, X: Array) -> tuple[Array, Array, Array, Array]:
        o = np.einsum("...ij,oj->...oi", X, self.columns)
        away = o - self.centers
        away[..., -1] = np.where(self.balls, 0.0, away[..., -1])
        far = np.linalg.norm(away, axis=-1)
        cone = (self.cosines - np.einsum("...oi,oi->...o", o, self.directions)) / self.sines
        return np.where(self.balls, far - self.radii, cone), o, away, far
