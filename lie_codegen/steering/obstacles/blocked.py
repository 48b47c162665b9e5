"""States that a task prescribes inside an obstacle: a proof that no manoeuvre is admissible.

An obstacle reads X r for one vector r: a body axis, or the last column, which is the position. So a set of goals T exp(hat(span F)) is as deep inside it as T
where hat(f) r = 0 for all f: a position in a ball whatever the heading, a line of sight in a cone whatever the turn about it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InfeasibleError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.constraints import Cone, Obstacle

#: A state this deep in an obstacle, in the unit of its clearance, touches it: rounding proves nothing.
_TOUCHES = 1e-9
#: Directions of goal sets come out of singular vectors, right to rounding.
_ALIKE = 1e-12


@dataclass(frozen=True)
class Blocked:
    """A proof of infeasibility: the motion has to pass a state that an obstacle forbids.

    Attributes:
        place: "start", "target", or "via point 1" and so on.
        obstacle: as messages call it.
        clearance: of the obstacle there, negative.
    """

    place: str
    obstacle: str
    clearance: float

    def __str__(self) -> str:
        return f"the {self.place} itself is inside {self.obstacle}"


def refuse_blocked(
    where: str,
    group: MatrixGroup,
    places: Iterable[tuple[str, Array, Array]],
    obstacles: Iterable[tuple[str, Obstacle]],
) -> None:
    """Nothing, where all of the places are clear of all of the obstacles, or touch them.

    Args:
        where: for the message.
        group: the group.
        places: what messages call them, their (d, d) states T, and (k, n) directions F: the state is somewhere in T exp(hat(span F)).
        obstacles: what messages call them, and the obstacles.

    Raises:
        InfeasibleError: one is inside an obstacle; its certificate is the deepest `Blocked`.
    """
    known = list(places)
    blocked = [
        Blocked(place, name, clearance)
        for name, obstacle in obstacles
        for place, X, free in known
        if _all_alike(group, free, obstacle) and (clearance := float(obstacle.clearance(X[None])[0])) < -_TOUCHES
    ]
    if blocked:
        raise InfeasibleError(
            f"{where}: infeasible: {'; '.join(map(str, blocked))}; move one of them",
            certificate=min(blocked, key=lambda each: each.clearance),
        )


def _all_alike(group: MatrixGroup, free: Array, obstacle: Obstacle) -> bool:
    """Whether free motions leave what the obstacle reads where it is."""
    read = np.zeros(group.degree)
    if isinstance(obstacle, Cone):
        read[:3] = obstacle.parameters()[:3]
    else:
        read[-1] = 1
    return all(float(np.max(np.abs(group.hat(h) @ read))) <= _ALIKE * float(np.max(np.abs(h))) for h in free)
