"""Obstacles along right-invariant systems, and least time to sets of goals among obstacles; derivatives by differences, flights by scipy."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.steering.direct.problem import manoeuvre
from lie_codegen.steering.direct.programme import Settings
from lie_codegen.steering.direct.scene import Scene
from lie_codegen.steering.obstacles.keep_out import KeepOut

DISC = lc.Ball((2.0, 0.1), 0.8)


def ahead() -> np.ndarray:
    goal = np.eye(3)
    goal[0, 2] = 4
    return goal


def flown(plan: Any, right: bool, drift: Any = None, start: Any = None) -> np.ndarray:
    """States of the plan by DOP853, piece by piece: X' = X hat(xi), or hat(xi) X."""
    group = plan.group
    d, X, states = group.degree, np.eye(group.degree) if start is None else np.asarray(start), []
    for a, b in pairwise([0.0, *plan.u.breakpoints, plan.duration]):

        def rate(s: float, x: np.ndarray, last: float = b, first: float = a) -> np.ndarray:
            # at a breakpoint the later piece counts: inside this one
            A = group.hat(plan.u(min(s, last - 1e-12 * (last - first))) + (0 if drift is None else drift))
            return ((A @ x.reshape(d, d)) if right else (x.reshape(d, d) @ A)).ravel()

        run = solve_ivp(rate, (a, b), X.ravel(), "DOP853", np.linspace(a, b, 9), rtol=1e-10, atol=1e-12)
        X = run.y[:, -1].reshape(d, d)
        states += [column.reshape(d, d) for column in run.y.T]
    return np.array(states)


@pytest.mark.parametrize("equation", ["left", "right"])
@pytest.mark.parametrize("objective", ["energy", "time"])
@pytest.mark.parametrize("side", ["element", "left", "right"])
def test_what_a_step_knows_changes_as_its_derivatives_say(equation: str, objective: str, side: str) -> None:
    se2, rng = lc.group("se2"), np.random.default_rng(4)
    T = ahead() @ expm(se2.hat([0.3, 0.1, 0.2]))
    goal = T if side == "element" else lc.Coset(T, free=("omega", (0, 1, 1)), side=side)
    X0 = expm(se2.hat([0.4, -0.3, 0.2]))
    task = manoeuvre(se2, goal, ("omega", "vx"), 3.0, (0.1, 0.2, 0), 2, None, X0, equation)
    obstacles = (DISC, lc.Box((1.0, 2.0), (0.3, 0.4)))
    scene = Scene(task, KeepOut.of(3, obstacles), obstacles, Settings(), objective, 5.0 if objective == "time" else 0.0)
    course = scene.course(4, 0)
    u = scene.lasting(rng.normal(size=(1, *course.programme.low.shape)))
    if objective == "time":
        u[:, -1] = 0.8
    known, e = course.known(u), 1e-6
    for k in range(u.shape[1]):
        step = e * np.eye(u.shape[1])[k]
        ahead_, behind = (course.known(u + sign * step) for sign in (1, -1))
        np.testing.assert_allclose(known.A[0, :, k], (ahead_.gap - behind.gap)[0] / (2 * e), atol=1e-7)
        # the reduced rows turn with the state: the size of the residual does not
        left = (ahead_.size**2 - behind.size**2)[0] / (4 * e)
        cut = np.minimum(known.gap[0], 0.0)
        assert left == pytest.approx(known.r[0] @ known.J[0, :, k] + cut @ known.A[0, :, k], abs=1e-6)


def test_a_right_invariant_motion_goes_around_a_disc() -> None:
    goal, start, drift = ahead(), expm(lc.group("se2").hat([0.2, 0.1, 0.3])), np.array([0.05, 0, 0.02])
    plan = lc.steer(
        "se2", goal, ("omega", "vx"), 6.0, equation="right", drift=drift, start=start, bounds=1, obstacles=[DISC]
    )
    X = flown(plan, True, drift, start)
    np.testing.assert_allclose(X[-1], goal, atol=1e-7)
    assert np.min(DISC.clearance(X)) > -1e-7
    assert max(plan.details["control_peaks"]) <= 1
    assert plan.details["clearances"][0] == pytest.approx(np.min(DISC.clearance(X)), abs=1e-3)


@pytest.mark.slow
def test_a_cone_in_the_way_costs_the_same_played_either_way_round() -> None:
    """With all three controls |u| is the speed in the bi-invariant metric, whichever side u acts on: the two have one shortest way."""
    so3 = lc.group("so3")
    R = expm(so3.hat([0, 0, 2.0]))
    cone = lc.Cone((1, 0, 0), (np.cos(1), np.sin(1), 0), 0.4)
    costs = []
    for equation in ("left", "right"):
        plan = lc.steer(so3, R, ("w1", "w2", "w3"), 3.0, method="direct", obstacles=[cone], equation=equation)
        X = flown(plan, equation == "right")
        np.testing.assert_allclose(X[-1], R, atol=1e-7)
        assert np.min(cone.clearance(X)) > -1e-7
        costs.append(plan.cost)
    assert costs[0] == pytest.approx(costs[1], rel=5e-3)
    assert min(costs) > 4.0 / 3 + 0.01  # the straight turn of 2 rad in 3 s is blocked


def test_least_time_to_a_place_is_not_more_than_to_a_pose_there() -> None:
    """A car of unit speed whose end heading is free: at least the taut string, at most that and the turn out of it."""
    options: dict[str, Any] = {"objective": "time", "drift": (0, 1, 0), "bounds": 1, "obstacles": [DISC]}
    plan = lc.steer("se2", lc.Coset(ahead(), free=("omega",)), ("omega",), 6.0, method="direct", **options)
    away = np.hypot(2, 0.1)
    string = 2 * np.sqrt(away**2 - 0.64) + 0.8 * (np.pi - 2 * np.arctan(0.05) - 2 * np.arccos(0.8 / away))
    assert string <= plan.duration <= 1.012 * string
    X = flown(plan, False, np.array([0, 1.0, 0]))
    np.testing.assert_allclose(X[-1][:2, 2], [4, 0], atol=1e-6)
    assert np.min(DISC.clearance(X)) > -1e-6
    assert max(plan.details["control_peaks"]) <= 1


@pytest.mark.slow
@pytest.mark.parametrize("equation", ["left", "right"])
@pytest.mark.parametrize("goal", [lc.Coset(ahead(), free=("omega",), side="left"), lc.Position((4, 0))])
def test_least_time_to_sets_of_goals_either_way_round(goal: Any, equation: str) -> None:
    plan = lc.steer(
        "se2",
        goal,
        ("omega", "vx"),
        6.0,
        method="direct",
        objective="time",
        bounds=1,
        obstacles=[DISC],
        equation=equation,
    )
    X = flown(plan, equation == "right")
    if isinstance(goal, lc.Position):
        np.testing.assert_allclose(X[-1][:2, 2], [4, 0], atol=1e-6)
    else:
        # H T: turns about the origin keep the distance from it, and R^-1 p
        np.testing.assert_allclose(X[-1][:2, :2].T @ X[-1][:2, 2], [4, 0], atol=1e-6)
    assert np.min(DISC.clearance(X)) > -1e-6
    assert max(plan.details["control_peaks"]) <= 1
