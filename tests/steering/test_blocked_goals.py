"""Goals that are sets, wholly inside an obstacle: proved infeasible at once, by either method; one that can turn out of it is not."""

from __future__ import annotations

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.errors import InfeasibleError

BALL = lc.Ball(center=(1, 0), radius=0.3)
HERE = [[1, 0, 1], [0, 1, 0.1], [0, 0, 1]]
SUN = lc.Cone(axis=(0, 0, 1), direction=(1, 0.1, 1), half_angle=0.2)
SPHERE = lc.Ball(center=(1, 0, 0), radius=0.3)
CAR, WHEELS, SHIP = ("omega", "vx"), ("w1", "w2"), ("w1", "w2", "w3", "v1")


@pytest.mark.parametrize("method", ["auto", "direct", "transcription"])
@pytest.mark.parametrize(
    ("group", "goal", "controls", "obstacle", "depth"),
    [
        ("se2", lc.Position((1, 0.1)), CAR, BALL, 0.1**2 - 0.3**2),
        ("se2", lc.Coset(HERE, free=("omega",)), CAR, BALL, 0.1**2 - 0.3**2),
        ("se3", lc.Position((1, 0.1, 0)), SHIP, SPHERE, 0.1**2 - 0.3**2),
        ("so3", lc.Pointing((0, 0, 1), (1, 0, 1)), WHEELS, SUN, np.cos(0.2) - 2 / np.sqrt(2 * 2.01)),
    ],
)
def test_a_set_of_goals_inside_an_obstacle(
    method: str, group: str, goal: object, controls: tuple[str, ...], obstacle: object, depth: float
) -> None:
    with pytest.raises(InfeasibleError, match="the target itself is inside obstacle 1") as caught:
        lc.steer(group, goal, controls, 4.0, method=method, obstacles=[obstacle])
    np.testing.assert_allclose(caught.value.certificate.clearance, depth, atol=1e-9)


def test_a_goal_that_turns_out_of_the_cone_is_reached() -> None:
    """The body's second axis may stand in the cone with one turn about the line of sight, and not with others."""
    other = lc.Cone(axis=(0, 1, 0), direction=(1, 0.1, 1), half_angle=0.2)
    plan = lc.steer("so3", lc.Pointing((0, 0, 1), (1, 0, 1)), WHEELS, 4.0, method="direct", obstacles=[other])
    assert plan.status is lc.Status.LOCAL
    np.testing.assert_allclose(plan.X(4.0)[:, 2], np.array([1, 0, 1]) / np.sqrt(2), atol=1e-9)
