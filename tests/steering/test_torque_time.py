"""Least time under bounded torques, against the published half turn of a cube and a flight by scipy of the arcs found."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.steering.direct.programme import Goal
from lie_codegen.steering.direct.torque_arcs import TorqueArcs, euler_constants

AXES = ("w1", "w2", "w3")


def flown(arcs: Any, J: np.ndarray, xi0: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """R and xi after the arcs (torques and a duration each): J xi' = J xi x xi + torque, R' = R hat(xi)."""

    def rate(_: float, y: np.ndarray, f: np.ndarray) -> np.ndarray:
        R, w = y[:9].reshape(3, 3), y[9:]
        hat = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        return np.concatenate([(R @ hat).ravel(), np.linalg.solve(J, np.cross(J @ w, w) + f)])

    state = np.concatenate([np.eye(3).ravel(), xi0])
    for *torque, length in arcs:
        run = solve_ivp(rate, (0, length), state, method="DOP853", rtol=1e-12, atol=1e-12, args=(np.array(torque),))
        state = run.y[:, -1]
    return state[:9].reshape(3, 3), state[9:]


def test_half_a_turn_of_a_cube_takes_the_time_of_bilimoria_and_wie() -> None:
    so3 = lc.group("so3")
    half = expm(so3.hat([0, 0, np.pi]))
    options: dict[str, Any] = {
        "dynamics": "second_order",
        "objective": "time",
        "inertia": 1.0,
        "bounds": 1,
        "rounds": 1,
    }
    plan = lc.steer(so3, half, AXES, 3.5, method="direct", **options)
    R, xi = flown(plan.details["arcs"], np.eye(3), np.zeros(3))
    np.testing.assert_allclose(R, half, atol=1e-8)
    np.testing.assert_allclose(xi, 0, atol=1e-8)
    np.testing.assert_allclose(plan.X(plan.duration), half, atol=1e-8)
    np.testing.assert_allclose(plan.X(plan.duration / 2).T @ plan.X(plan.duration / 2), np.eye(3), atol=1e-9)
    assert plan.duration == pytest.approx(
        3.2430833, abs=1e-6
    )  # 3.2430 in their paper, five switches; 2 sqrt(pi) about the axis
    assert len(plan.details["arcs"]) == 6
    assert np.max(np.abs(plan.u(np.linspace(0, plan.duration, 101)))) <= 1


@pytest.mark.slow
def test_a_turn_of_an_uneven_body_is_no_slower_than_by_the_transcription() -> None:
    so3, J = lc.group("so3"), np.diag([1.0, 2.0, 1.5])
    target = expm(so3.hat([0.4, -0.3, 0.7]))
    options: dict[str, Any] = {"dynamics": "second_order", "objective": "time", "inertia": (1, 2, 1.5), "bounds": 1}
    plan = lc.steer(so3, target, AXES, 2.0, method="direct", **options)
    assert plan.duration < lc.steer(so3, target, AXES, 2.0, method="transcription", **options).duration
    R, xi = flown(plan.details["arcs"], J, np.zeros(3))
    np.testing.assert_allclose(R, target, atol=1e-8)
    np.testing.assert_allclose(xi, 0, atol=1e-8)


def test_derivatives_by_durations_are_those_of_differences() -> None:
    so3, rng = lc.group("so3"), np.random.default_rng(0)
    J = np.diag([1.0, 2.0, 1.5])
    goal = Goal(np.eye(3), np.eye(3), np.eye(3)[None])
    words = rng.choice([-1.0, 1.0], (2, 4, 3)) @ np.linalg.inv(J)
    arcs = TorqueArcs(so3, goal, euler_constants(so3, J), words, np.zeros((2, 3)), 40)
    s = rng.uniform(0.2, 0.5, (2, 4))
    ends = [flown([(*(J @ f), x) for f, x in zip(words[0], s[0], strict=True)], J, np.zeros(3))]
    for e in (1e-4, -1e-4):
        t = s[0] + e * np.eye(4)[1]
        ends.append(flown([(*(J @ f), x) for f, x in zip(words[0], t, strict=True)], J, np.zeros(3)))
    turn = so3.project(ends[0][0].T @ (ends[1][0] - ends[2][0]) / 2e-4)
    change = (ends[1][1] - ends[2][1]) / 2e-4
    _, xi, slopes = arcs._flown(words, s)
    np.testing.assert_allclose(xi[0], ends[0][1], atol=1e-9)
    np.testing.assert_allclose(slopes[0, :, 1], [*turn, *change], atol=1e-6)


def test_torques_of_least_time_say_what_they_need() -> None:
    so3 = lc.group("so3")
    given: dict[str, Any] = {"method": "direct", "dynamics": "second_order", "inertia": 1.0}
    with pytest.raises(lc.errors.SteeringInputError, match="objective"):
        lc.steer(so3, (0.1, 0, 0), AXES, 1.0, bounds=1, **given)
    with pytest.raises(lc.errors.SteeringInputError, match="bounds"):
        lc.steer(so3, (0.1, 0, 0), AXES, 1.0, objective="time", **given)
    with pytest.raises(lc.errors.SteeringInputError, match="element"):
        lc.steer(so3, lc.Pointing((1, 0, 0), (0, 1, 0)), AXES, 1.0, bounds=1, objective="time", **given)
    with pytest.raises(lc.errors.SteeringError, match="proves nothing") as nothing:
        lc.steer(
            so3,
            (3.0, 0, 0),
            AXES,
            0.1,
            bounds=1,
            objective="time",
            longest=1.5,
            rounds=1,
            starts=1,
            iterations=5,
            **given,
        )
    assert nothing.value.best.status.name == "NOT_FOUND"
    assert nothing.value.violation["end"] > 0.1
