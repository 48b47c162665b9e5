"""What a manoeuvre must respect beside its end: bounds on controls and rates, keep-out cones, obstacles, via points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import NotFiniteError, ShapeError, SteeringInputError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.saved import Saved
from lie_codegen.steering.blocks import Box, Cylinder
from lie_codegen.steering.obstacles.solids import Solids


@dataclass(frozen=True, eq=False, repr=False)
class Cone(Saved):
    """Attitude exclusion: a body axis stays at least half_angle away from a direction of space, (X axis) . direction <= cos.

    Attributes:
        axis: (3,) in the body, a star tracker's line of sight.
        direction: (3,) in space, towards the sun.
        half_angle: rad.

    Raises:
        SteeringInputError: when a task reads it: a vector that is zero or not three numbers, an angle that is not between 0 and pi.
    """

    axis: tuple[float, float, float]
    direction: tuple[float, float, float]
    half_angle: float

    def parameters(self) -> tuple[float, ...]:
        """axis, direction (unit vectors), cos(half_angle).

        Raises:
            SteeringInputError: a vector that is zero or not three numbers, an angle that is not between 0 and pi.
        """
        axis, direction = np.asarray(self.axis, dtype=float), np.asarray(self.direction, dtype=float)
        for name, vector in (("axis", axis), ("direction", direction)):
            if vector.shape != (3,) or not np.all(np.isfinite(vector)) or not np.linalg.norm(vector) > 0:
                raise SteeringInputError(f"Cone: {name} must be three numbers, not all zero, got {vector.tolist()}")
        if not 0 < self.half_angle < np.pi:
            raise SteeringInputError(f"Cone: half_angle must be between 0 and pi, got {self.half_angle!r}")
        unit = [*axis / np.linalg.norm(axis), *direction / np.linalg.norm(direction)]
        return (*map(float, unit), float(np.cos(self.half_angle)))

    def clearance(self, X: Array) -> Array:
        """cos(half_angle) - cos(angle), (k,): negative inside the cone.

        Args:
            X: (k, d, d) elements, the rotation in the upper left corner.

        Raises:
            SteeringInputError: as the class.
        """
        p = np.array(self.parameters())
        return np.asarray(p[6] - (X[:, :3, :3] @ p[:3]) @ p[3:6])


@dataclass(frozen=True, eq=False, repr=False)
class Ball(Saved):
    """An obstacle: the position, the last column of X, stays out of a ball (a disc on SE(2)).

    Attributes:
        center: (2,) or (3,).
        radius: in the unit of the positions.

    Raises:
        SteeringInputError: when a task reads it: a center that is not finite, a radius that is not positive.
    """

    center: tuple[float, ...]
    radius: float

    def parameters(self) -> tuple[float, ...]:
        """center, radius.

        Raises:
            SteeringInputError: a center that is not finite, a radius that is not positive.
        """
        if not np.all(np.isfinite(self.center)) or not self.radius > 0 or not np.isfinite(self.radius):
            raise SteeringInputError(f"Ball: a finite center and a positive radius, got {self.center}, {self.radius!r}")
        return (*map(float, self.center), float(self.radius))

    def clearance(self, X: Array) -> Array:
        """|p - center|^2 - radius^2, (k,): negative inside.

        Args:
            X: (k, d, d) elements with positions.

        Raises:
            ArgumentError: positions of another dimension.
        """
        p = X[:, :-1, -1] - np.asarray(self.center)
        return np.asarray(np.sum(p * p, axis=1) - self.radius**2)

    def solid(self) -> Solids:
        """As arrays of one."""
        q = len(self.center)
        return Solids(
            np.array([self.center], dtype=float),
            np.eye(q)[None],
            np.zeros((1, q)),
            np.array([float(self.radius)]),
            np.zeros(1, dtype=bool),
        )


Obstacle = Cone | Ball | Box | Cylinder
_OBSTACLES = (Cone, Ball, Box, Cylinder)


def check_obstacles(group: MatrixGroup, obstacles: Sequence[Obstacle]) -> tuple[Obstacle, ...]:
    """The obstacles, fit for the group.

    Raises:
        SteeringInputError: a cone where X does not begin with a rotation of space, another obstacle where there is no position.
    """
    if isinstance(obstacles, _OBSTACLES) or not isinstance(obstacles, Sequence):
        raise SteeringInputError(
            f"obstacles is a list of Cones, Balls, Boxes and Cylinders: write obstacles=[{obstacles!r:.80}]"
        )
    flat = all(matrix[-1, j] == 0 for matrix in group.exact_basis for j in range(group.degree))
    for obstacle in obstacles:
        if isinstance(obstacle, Cone):
            if group.is_complex or not _rotates(group):
                raise SteeringInputError(f"a Cone needs a group of rotations of space (so3, se3), not {group.name}")
            obstacle.parameters()
            continue
        if not isinstance(obstacle, _OBSTACLES):
            raise SteeringInputError(f"an obstacle is a Cone, a Ball, a Box or a Cylinder, got {obstacle!r}")
        if isinstance(obstacle, Ball):
            obstacle.parameters()
        q = len(obstacle.start if isinstance(obstacle, Cylinder) else obstacle.center)
        if not flat or group.is_complex or q != group.degree - 1:
            raise SteeringInputError(
                f"a {type(obstacle).__name__} with {q} coordinates needs a group of motions of as many dimensions (se2, se3), "
                f"not {group.name}"
            )
    return tuple(obstacles)


def _rotates(group: MatrixGroup) -> bool:
    if group.degree < 3:
        return False
    tops = np.real(group.basis[:, :3, :3])
    return bool(np.allclose(tops, -np.swapaxes(tops, 1, 2)) and np.any(tops))


def limits(group: MatrixGroup, controls: Sequence[int], given: Any, what: str) -> tuple[Array, Array]:
    """(m,) lower and upper limits from a number (both signs), a (low, high) pair, m pairs, or {label: number or pair}; infinite if absent.

    Raises:
        SteeringInputError: an unknown label, a lower limit above the upper one, limits that exclude 0 where 0 is needed.
    """
    return box_limits([group.labels[i] for i in controls], given, what)


def box_limits(labels: Sequence[str], given: Any, what: str) -> tuple[Array, Array]:
    """As `limits`, of controls by their labels."""
    m = len(labels)
    low, high = np.full(m, -np.inf), np.full(m, np.inf)
    if given is None:
        return low, high
    entries = given if isinstance(given, Mapping) else _by_label(labels, given)
    for label, value in entries.items():
        if label not in labels:
            raise SteeringInputError(f"{what}: {label!r} is no control; the controls are {', '.join(labels)}")
        pair = _pair(value, what, label)
        low[list(labels).index(label)], high[list(labels).index(label)] = pair
    return low, high


def _by_label(labels: Sequence[str], given: Any) -> dict[str, Any]:
    """One for all, or the rows of (m, 2)."""
    if (
        isinstance(given, list | tuple | np.ndarray)
        and len(given) == len(labels)
        and all(np.shape(row) == (2,) for row in given)
    ):
        return dict(zip(labels, given, strict=True))
    return dict.fromkeys(labels, given)


def _pair(value: Any, what: str, label: str) -> tuple[float, float]:
    try:
        numbers = np.atleast_1d(np.asarray(value, dtype=float))
    except (TypeError, ValueError):
        numbers = np.zeros(0)
    if numbers.shape not in ((1,), (2,)):
        raise ShapeError(f"{what} of {label}: give a number or a (low, high) pair, got {value!r}")
    if np.any(np.isnan(numbers)):
        raise NotFiniteError(f"{what} of {label}: NaN")
    if len(numbers) == 1 and numbers[0] <= 0:
        raise SteeringInputError(
            f"{what} of {label}: {value!r} is the size of both limits: give a positive number, or a (low, high) pair"
        )
    low, high = (-numbers[0], numbers[0]) if len(numbers) == 1 else numbers
    if low >= high:
        raise SteeringInputError(f"{what} of {label}: the lower limit {low:g} is not below the upper one {high:g}")
    return float(low), float(high)
