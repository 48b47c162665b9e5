"""start= for methods that begin at the identity: what lies in space is seen from the start, and the plan is put back.

X = X0 Y with Y(0) = I follows the same controls and drift as X (left-invariance). Elements T become X0^-1 T, obstacles are carried along:
a disc's centre and a cone's direction as seen from X0.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import SteeringInputError
from lie_codegen.flow.elements import group_element
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.blocks import Box, Cylinder
from lie_codegen.steering.constraints import Cone, Obstacle, check_obstacles
from lie_codegen.steering.plan import Plan


def seen_from(
    group: MatrixGroup, start: ArrayLike, target: Any, options: Mapping[str, Any]
) -> tuple[Array, Array, dict[str, Any]]:
    """X0, the target and the options of the task that begins at the identity.

    Raises:
        ShapeError, NotFiniteError, NotOnGroupError, SteeringInputError: about the start, the target, an obstacle.
    """
    where = f"steer({group.name})"
    here = group_element(group, start, f"{where}: start")
    element = group_element(group, target, f"{where}: target")
    moved = {name: value for name, value in options.items() if name != "start"}
    if moved.get("obstacles"):
        moved["obstacles"] = [_seen(each, here) for each in check_obstacles(group, moved["obstacles"])]
    if moved.get("via"):
        moved["via"] = [
            (fraction, np.linalg.solve(here, group_element(group, each, f"{where}: via")))
            for fraction, each in _pairs(moved["via"])
        ]
    return here, np.linalg.solve(here, element), moved


def placed(plan: Plan, start: Array) -> Plan:
    """The plan with its target and its end where they are in space."""
    facts = replace(plan.facts, X_final=start @ plan.X_final, details={**plan.details, "start": start})
    return replace(plan, target=start @ plan.target, outcome=facts)


def _pairs(via: Sequence[Any]) -> list[tuple[float, Any]]:
    try:
        return [(float(fraction), element) for fraction, element in via]
    except (TypeError, ValueError):
        raise SteeringInputError(f"via: give pairs (fraction of the duration, element), got {via!r:.80}") from None


def _seen(obstacle: Obstacle, here: Array) -> Obstacle:
    if isinstance(obstacle, Cone):
        direction = here[:3, :3].T @ np.asarray(obstacle.direction, dtype=float)
        return replace(obstacle, direction=(float(direction[0]), float(direction[1]), float(direction[2])))
    if isinstance(obstacle, Cylinder):
        return replace(obstacle, start=_moved(here, obstacle.start), end=_moved(here, obstacle.end))
    moved = replace(obstacle, center=_moved(here, obstacle.center))
    if not isinstance(moved, Box):
        return moved
    return replace(moved, axes=here[:-1, :-1].T @ moved.solid().axes[0])


def _moved(here: Array, point: Sequence[float]) -> tuple[float, ...]:
    """A point as it is seen from there."""
    return tuple(map(float, np.linalg.solve(here, np.append(np.asarray(point, dtype=float), 1.0))[:-1]))
