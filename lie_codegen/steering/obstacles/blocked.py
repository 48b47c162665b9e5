"""States that a task prescribes inside an obstacle: a proof that no manoeuvre is admissible."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from lie_codegen.arrays import Array
from lie_codegen.errors import InfeasibleError
from lie_codegen.steering.constraints import Obstacle

#: A state this deep in an obstacle, in the unit of its clearance, touches it: rounding proves nothing.
_TOUCHES = 1e-9


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


def refuse_blocked(where: str, places: Iterable[tuple[str, Array]], obstacles: Iterable[tuple[str, Obstacle]]) -> None:
    """Nothing, where all of the places are clear of all of the obstacles, or touch them.

    Args:
        where: for the message.
        places: what messages call them, and their (d, d) states.
        obstacles: what messages call them, and the obstacles.

    Raises:
        InfeasibleError: one is inside an obstacle; its certificate is the deepest `Blocked`.
    """
    known = list(places)
    blocked = [
        Blocked(place, name, clearance)
        for name, obstacle in obstacles
        for place, X in known
        if (clearance := float(obstacle.clearance(X[None])[0])) < -_TOUCHES
    ]
    if blocked:
        raise InfeasibleError(
            f"{where}: infeasible: {'; '.join(map(str, blocked))}; move one of them",
            certificate=min(blocked, key=lambda each: each.clearance),
        )
