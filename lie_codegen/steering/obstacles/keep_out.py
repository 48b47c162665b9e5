"""How far states are from obstacles, in the obstacles' own units, and how that changes with the state.

    ball, box, cylinder:  gap = distance of p to the surface      p the position, the last column of X; `solids`
    cone:                 gap = (cos h - (X a) . d) / sin h       near the cone's side the angle to it

Each is a function of one column o = X e of the state. Where X moves to exp(eta) X the column moves by eta o, and the gap by
<N, eta> with the matrix N = normal o'.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.constraints import Cone, Obstacle
from lie_codegen.steering.obstacles.solids import Solids


@dataclass(frozen=True, eq=False)
class KeepOut:
    """Obstacles as arrays.

    Attributes:
        degree: d.
        columns: (o, d) e of each obstacle.
        directions, cosines, sines: of cones; (o, d) zero for others.
        placed: (o,) which look at the position.
        solids: those, in their order.
    """

    degree: int
    columns: Array
    directions: Array
    cosines: Array
    sines: Array
    placed: Array
    solids: Solids | None

    @staticmethod
    def of(degree: int, obstacles: Sequence[Obstacle]) -> KeepOut:
        """The obstacles, checked before."""
        count = len(obstacles)
        columns, directions = (np.zeros((count, degree)) for _ in range(2))
        cosines, sines = np.zeros(count), np.ones(count)
        solids: list[Solids] = []
        for number, each in enumerate(obstacles):
            if isinstance(each, Cone):
                values = np.array(each.parameters())
                columns[number, :3], directions[number, :3] = values[:3], values[3:6]
                cosines[number], sines[number] = values[6], np.sqrt(max(0.0, 1 - values[6] ** 2))
            else:
                columns[number, -1] = 1
                solids.append(each.solid())
        placed = np.array([not isinstance(each, Cone) for each in obstacles], dtype=bool)
        return KeepOut(degree, columns, directions, cosines, sines, placed, Solids.joined(solids) if solids else None)

    @property
    def axes(self) -> Array:
        """(k, d) the different columns that are looked at."""
        return np.unique(np.round(self.columns, 12), axis=0)

    @property
    def sizes(self) -> Array:
        """(o,) radii of balls, half of the least thickness of others, sines of the half angles of cones: what gaps compare with."""
        found = self.sines.copy()
        if self.solids is not None:
            found[self.placed] = self.solids.sizes
        return found

    def gaps(self, X: Array) -> Array:
        """(..., d, d) -> (..., o); negative inside."""
        return self._seen(X)[0]

    def nearest(self, X: Array, margins: Array, few: int) -> tuple[Array, Array]:
        """Gaps less margins (..., few) of the nearest obstacles, and their N (..., few, d, d)."""
        gap, o, normal = self._seen(X)
        gap = gap - margins
        few = min(few, gap.shape[-1])
        near = np.argpartition(gap, few - 1, axis=-1)[..., :few]
        o, normal = (np.take_along_axis(each, near[..., None], axis=-2) for each in (o, normal))
        return np.take_along_axis(gap, near, axis=-1), normal[..., :, None] * o[..., None, :]

    def cleared(self, X: Array) -> bool:
        """Whether the way through states (k, d, d) stays clear between them too: no gap changes by more than what is looked at moves,
        so that it is none where the gaps at both ends of a straight step add up to more than the step is long."""
        gap, o, _ = self._seen(X)
        moved = np.linalg.norm(np.diff(o, axis=0), axis=2) / np.where(self.placed, 1.0, self.sines)
        return bool(np.all(gap[:-1] + gap[1:] >= moved))

    def _seen(self, X: Array) -> tuple[Array, Array, Array]:
        o = np.einsum("...ij,oj->...oi", X, self.columns)
        gap = (self.cosines - np.einsum("...oi,oi->...o", o, self.directions)) / self.sines
        normal = np.broadcast_to(-self.directions / self.sines[:, None], o.shape)
        if self.solids is not None:
            normal = normal.copy()
            gap[..., self.placed], normal[..., self.placed, :-1] = self.solids.seen(o[..., self.placed, :-1])
        return gap, o, normal
