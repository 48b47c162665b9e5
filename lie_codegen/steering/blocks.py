"""Obstacles with edges: boxes and cylinders that the position keeps out of."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import SteeringInputError
from lie_codegen.kernel.saved import Saved
from lie_codegen.steering.obstacles.solids import Solids
from lie_codegen.values import settle


class Block(Saved, ABC):
    """An obstacle whose surface is that of one solid."""

    @abstractmethod
    def solid(self) -> Solids:
        """As arrays of one."""

    def clearance(self, X: Array) -> Array:
        """Distance of the position to the surface, (k,): negative inside.

        Args:
            X: (k, d, d) elements with positions.

        Raises:
            ArgumentError: positions of another dimension.
        """
        return np.asarray(self.solid().seen(np.real(X[:, None, :-1, -1]))[0][:, 0])


@dataclass(frozen=True, eq=False, repr=False)
class Box(Block):
    """An obstacle: the position, the last column of X, stays out of a box (a rectangle on SE(2)).

    Attributes:
        center: (2,) or (3,).
        half_sizes: half of its edges, all positive, in the unit of the positions.
        axes: (2, 2) or (3, 3) rotation, the directions of the edges in its columns; those of space if not given.

    Raises:
        SteeringInputError: a center, sizes or axes that are none.
    """

    center: tuple[float, ...]
    half_sizes: tuple[float, ...]
    axes: ArrayLike | None = None

    def __post_init__(self) -> None:
        center, halves = _numbers(self.center, "Box: center"), _numbers(self.half_sizes, "Box: half_sizes")
        if len(center) not in (2, 3) or halves.shape != center.shape or not np.all(halves > 0):
            raise SteeringInputError(
                f"Box: two or three coordinates of its center and as many positive half sizes, got {self.center!r} and "
                f"{self.half_sizes!r}"
            )
        axes = None
        if self.axes is not None:
            turned = _numbers(self.axes, "Box: axes", 2)
            if turned.shape != (len(center),) * 2 or not np.allclose(turned.T @ turned, np.eye(len(center)), atol=1e-9):
                raise SteeringInputError(
                    f"Box: axes is a rotation, ({len(center)}, {len(center)}) with orthonormal columns, got {self.axes!r}"
                )
            axes = tuple(tuple(map(float, row)) for row in turned)
        settle(self, center=tuple(map(float, center)), half_sizes=tuple(map(float, halves)), axes=axes)

    def solid(self) -> Solids:
        """As arrays of one."""
        axes = np.eye(len(self.center)) if self.axes is None else np.array(self.axes)
        return _one(self.center, axes, self.half_sizes, 0.0, False)


@dataclass(frozen=True, eq=False, repr=False)
class Cylinder(Block):
    """An obstacle: the position, the last column of X, stays out of a cylinder (a bar on SE(2)).

    Attributes:
        start, end: (2,) or (3,), the middles of its flat ends, or of the half balls that close a rounded one.
        radius: in the unit of the positions; half the width in the plane.
        rounded: whether half balls close it, beyond start and end.

    Raises:
        SteeringInputError: points that are none or the same, a radius that is not positive.
    """

    start: tuple[float, ...]
    end: tuple[float, ...]
    radius: float
    rounded: bool = False

    def __post_init__(self) -> None:
        start, end = _numbers(self.start, "Cylinder: start"), _numbers(self.end, "Cylinder: end")
        radius = _numbers(self.radius, "Cylinder: radius", 0)
        if len(start) not in (2, 3) or start.shape != end.shape or not np.linalg.norm(end - start) > 0:
            raise SteeringInputError(
                f"Cylinder: two different points of two or three coordinates, got {self.start!r} and {self.end!r}"
            )
        if not radius > 0:
            raise SteeringInputError(f"Cylinder: radius must be positive, got {self.radius!r}")
        settle(
            self,
            start=tuple(map(float, start)),
            end=tuple(map(float, end)),
            radius=float(radius),
            rounded=bool(self.rounded),
        )

    def solid(self) -> Solids:
        """As arrays of one, its axis the last."""
        start, end = np.array(self.start), np.array(self.end)
        length = float(np.linalg.norm(end - start))
        along = (end - start) / length
        across = np.linalg.svd(along[None])[2][1:]
        axes = np.column_stack([*across, along])
        q = len(along)
        halves = np.zeros(q)
        halves[-1] = length / 2
        if not self.rounded:
            halves[0] = self.radius
        return _one((start + end) / 2, axes, halves, self.radius * self.rounded, q == 3 and not self.rounded)


def _one(center: Any, axes: Array, halves: Any, rounding: float, tube: bool) -> Solids:
    return Solids(np.array([center]), axes[None], np.array([halves]), np.array([rounding]), np.array([tube]))


def _numbers(value: Any, what: str, dimensions: int = 1) -> Array:
    try:
        found = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise SteeringInputError(f"{what} must be numbers, got {value!r:.60}") from None
    if found.ndim != dimensions or not np.all(np.isfinite(found)):
        raise SteeringInputError(
            f"{what} must be finite numbers, of {dimensions} dimensions as an array, got {value!r:.60}"
        )
    return found
