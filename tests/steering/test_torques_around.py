"""Torques among obstacles by the direct method: derivatives by differences, motions by scipy with brackets computed here."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.steering.direct.programme import Settings
from lie_codegen.steering.direct.torque_around import _tasks
from lie_codegen.steering.direct.torque_scene import TorqueScene
from lie_codegen.steering.obstacles.keep_out import KeepOut

DISC = lc.Ball((2.0, 0.1), 0.8)
J = np.array([[1, 0.1, 0], [0.1, 2, 0.2], [0, 0.2, 3.0]])


def ahead() -> np.ndarray:
    goal = np.eye(3)
    goal[0, 2] = 4
    return goal


def flown(plan: Any, inertia: np.ndarray, start: np.ndarray, xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States and the last velocity: J xi' = ad*_xi J xi + u, (ad*_x m)_j = m([x, e_j]), by DOP853."""
    group = plan.group
    d, basis = group.degree, group.basis
    c = np.array([[group.project(a @ b - b @ a) for b in basis] for a in basis])
    y, states = np.concatenate([start.ravel(), xi]), []
    for a, b in pairwise([0.0, *plan.u.breakpoints, plan.duration]):

        def rate(t: float, y: np.ndarray, first: float = a, last: float = b) -> np.ndarray:
            X, w = y[: d * d].reshape(d, d), y[d * d :]
            u = plan.u(min(t, last - 1e-12 * (last - first)))
            return np.concatenate(
                [(X @ group.hat(w)).ravel(), np.linalg.solve(inertia, np.einsum("i,ijk,k->j", w, c, inertia @ w) + u)]
            )

        run = solve_ivp(rate, (a, b), y, "DOP853", np.linspace(a, b, 9), rtol=1e-10, atol=1e-12)
        y = run.y[:, -1]
        states += [column[: d * d].reshape(d, d) for column in run.y.T]
    return np.array(states), y[d * d :]


@pytest.mark.parametrize("objective", ["energy", "time"])
@pytest.mark.parametrize("side", ["element", "left"])
def test_what_a_step_knows_changes_as_its_derivatives_say(objective: str, side: str) -> None:
    se2, rng = lc.group("se2"), np.random.default_rng(4)
    goal = ahead() if side == "element" else lc.Coset(ahead(), free=("omega",), side=side)
    X0 = expm(se2.hat([0.4, -0.3, 0.2]))
    task, motion = _tasks(se2, goal, ("omega", (0, 1, 0.5)), 3.0, 2, None, X0, "test")
    obstacles = (DISC, lc.Box((1.0, 2.0), (0.3, 0.4)))
    ends = np.array([[0.1, 0.2, 0], [0, 0.1, 0.1]])
    scene = TorqueScene(
        task, KeepOut.of(3, obstacles), obstacles, Settings(), objective, 5.0 if objective == "time" else 0.0,
        motion=motion, inertia=J, ends=ends,
    )  # fmt: skip
    course = scene.course(4, 0)
    u = scene.begin(4, 2, 0, 1)[1:] + 0.1 * rng.normal(size=(1, len(course.box.low)))
    known, e = course.known(u), 1e-6
    for k in range(u.shape[1]):
        step = e * np.eye(u.shape[1])[k]
        after, before = (course.known(u + sign * step) for sign in (1, -1))
        np.testing.assert_allclose(known.A[0, :, k], (after.gap - before.gap)[0] / (2 * e), atol=1e-7)
        cut = np.minimum(known.gap[0], 0.0)
        slope = (after.size**2 - before.size**2)[0] / (4 * e)
        assert slope == pytest.approx(known.r[0] @ known.J[0, :, k] + cut @ known.A[0, :, k], abs=1e-6)


@pytest.mark.slow
def test_torques_turn_a_body_past_a_cone_from_rest_to_rest() -> None:
    so3, inertia = lc.group("so3"), np.diag([3.0, 2.0, 1.0])
    R, cone = expm(so3.hat([0, 0, 2.0])), lc.Cone((1, 0, 0), (np.cos(1), np.sin(1), 0), 0.4)
    plan = lc.steer(
        so3, R, ("w1", "w2", "w3"), 6.0, method="direct", dynamics="second_order", inertia=inertia, obstacles=[cone],
        starts=6, classes=2, bounds=2,
    )  # fmt: skip
    assert plan.status is lc.Status.LOCAL
    X, xi = flown(plan, inertia, np.eye(3), np.zeros(3))
    np.testing.assert_allclose(X[-1], R, atol=1e-7)
    np.testing.assert_allclose(xi, 0, atol=1e-7)
    assert np.min(cone.clearance(X)) > -1e-7
    assert max(plan.details["control_peaks"]) <= 2 + 1e-9
    # 12 I^2 theta^2 / T^3 about the third axis alone is the least without the cone
    assert 12 * 4 / 216 < plan.cost < 1.0
    np.testing.assert_allclose(plan.X(plan.duration), R, atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("objective", ["energy", "time"])
def test_two_forces_drive_a_body_around_a_disc(objective: str) -> None:
    start, ends = expm(lc.group("se2").hat([0.1, -0.2, 0.1])), np.array([0.1, 0.1, 0])
    plan = lc.steer(
        "se2", lc.Position((4, 0)), ("omega", "vx"), 6.0, method="direct", dynamics="second_order", inertia=J,
        obstacles=[DISC], bounds=2, objective=objective, start=start, start_velocity=ends,
    )  # fmt: skip
    X, xi = flown(plan, J, start, ends)
    np.testing.assert_allclose(X[-1][:2, 2], [4, 0], atol=1e-6)
    np.testing.assert_allclose(xi, 0, atol=1e-6)
    assert np.min(DISC.clearance(X)) > -1e-6
    assert max(plan.details["control_peaks"]) <= 2 + 1e-9


def test_a_plan_of_torques_is_a_guess_of_torques() -> None:
    """The transcription begun from its own plan stays there: states, velocities and torques are those of the plan."""
    given: dict[str, Any] = {
        "dynamics": "second_order",
        "inertia": np.diag([1.0, 2, 3]),
        "obstacles": [DISC],
        "bounds": 2,
    }
    first = lc.steer("se2", ahead(), ("omega", "vx"), 6.0, method="transcription", **given)
    again = lc.steer("se2", ahead(), ("omega", "vx"), 6.0, method="transcription", guess=first, starts=1, **given)
    assert again.cost <= first.cost * (1 + 1e-6)
    assert first.details["classes"][0]["cost"] == pytest.approx(first.cost, rel=1e-6)


def test_what_torques_among_obstacles_need_is_said() -> None:
    given: dict[str, Any] = {"method": "direct", "dynamics": "second_order", "obstacles": [DISC]}
    with pytest.raises(lc.errors.SteeringInputError, match="inertia"):
        lc.steer("se2", ahead(), ("omega", "vx"), 6.0, **given)
    with pytest.raises(lc.errors.SteeringInputError, match="bounds on every torque"):
        lc.steer("se2", ahead(), ("omega", "vx"), 6.0, inertia=1, objective="time", **given)
    with pytest.raises(lc.errors.SteeringInputError, match="has no option rest"):
        lc.steer("se2", ahead(), ("omega", "vx"), 6.0, inertia=1, rest=True, **given)
    with pytest.raises(lc.errors.InfeasibleError, match="target itself is inside"):
        lc.steer("se2", (0, 2.1, 0), ("omega", "vx"), 6.0, inertia=1, **given)
