"""The transcription: limits, obstacles, drift, via points, minimum time; always checked by integrating again."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import lie_codegen as lc
from lie_codegen.errors import InfeasibleError, SteeringError, SteeringInputError
from lie_codegen.steering.constraints import Ball, Cone
from lie_codegen.steering.plan import Plan

G = (0.4, -0.3, 1.2)


def path(plan: Plan, t: NDArray[np.float64], drift: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
    """X at the times t by scipy's DOP853, stopping at every breakpoint of the controls."""
    d = plan.group.degree
    shift = np.zeros(plan.group.dim) if drift is None else drift

    def rate(s: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        return (x.reshape(d, d) @ plan.group.hat(plan.u(s) + shift)).ravel()

    knots = np.unique(np.concatenate([[0.0], plan.u.breakpoints, [plan.duration]]))
    state, states = np.eye(d).ravel(), np.zeros((len(t), d, d))
    for a, b in pairwise(knots):
        inside = (t >= a) & (t <= b)
        asked = np.unique(np.append(t[inside], b))
        run = solve_ivp(rate, (a, b), state, method="DOP853", rtol=1e-11, atol=1e-12, t_eval=asked)
        states[inside] = run.y.T[np.isin(asked, t[inside])].reshape(-1, d, d)
        state = run.y[:, -1]
    return states


def test_without_limits_it_approaches_the_exact_optimum_from_above() -> None:
    group = lc.group("so3")
    exact = lc.steer(group, G, ("w1", "w2"), 1.0, method="optimal").cost
    costs = [lc.steer(group, G, ("w1", "w2"), 1.0, method="transcription", intervals=n).cost for n in (16, 32)]
    assert exact < costs[1] < costs[0]
    assert (costs[0] - exact) / (costs[1] - exact) == pytest.approx(16, rel=0.3)


def test_bounded_controls_and_rates_from_rest_to_rest() -> None:
    plan = lc.steer(lc.group("so3"), G, ("w1", "w2"), 10.0, bounds=0.3, rate_bounds={"w1": 0.25}, rest=True)
    assert plan.method == "transcription"
    assert plan.error < 1e-8
    u = plan.u(np.concatenate([[0.0], plan.u.breakpoints, [10.0]]))
    assert np.max(np.abs(u)) <= 0.3 + 1e-9
    assert np.max(np.abs(np.diff(u[:, 0]))) <= 0.25 * 10 / 64 + 1e-9
    np.testing.assert_allclose(u[[0, -1]], 0, atol=1e-12)


def test_two_wheels_bounded_rates_and_a_star_tracker() -> None:
    group = lc.group("so3")
    free = lc.steer(group, G, ("w1", "w2"), 10.0)
    axis = np.array([0.0, 0.0, 1.0])
    middle = path(free, np.array([5.0]))[0] @ axis
    cone = Cone(tuple(axis), tuple(middle), 0.15)
    plan = lc.steer(group, G, ("w1", "w2"), 10.0, bounds=0.6, rate_bounds=0.6, obstacles=[cone])
    fine = path(plan, np.linspace(0, 10.0, 801))
    angles = np.arccos(np.clip(fine @ axis @ middle, -1, 1))
    assert np.min(angles) >= 0.15 - 1e-7
    assert np.min(angles) < 0.2
    assert plan.error < 1e-8
    assert plan.cost > free.cost


@pytest.mark.parametrize("solver", ["ipopt", "fatrop"])
def test_a_disc_in_the_way_of_a_unicycle(solver: str) -> None:
    target = np.array([[1, 0, 2.0], [0, 1, 0], [0, 0, 1]])
    plan = lc.steer(lc.group("se2"), target, (0, 1), 1.0, obstacles=[Ball((1.0, 0.1), 0.4)], solver=solver)
    fine = path(plan, np.linspace(0, plan.duration, 801))
    assert np.min(np.linalg.norm(fine[:, :2, 2] - (1.0, 0.1), axis=1)) >= 0.4 - 1e-6
    assert plan.error < 1e-8
    assert plan.cost == pytest.approx(7.9518009, rel=1e-4)


def test_minimum_time_against_the_closed_form() -> None:
    """Straight ahead: no path is shorter than the distance."""
    target = np.array([[1, 0, 2.0], [0, 1, 0], [0, 0, 1]])
    plan = lc.steer(lc.group("se2"), target, (0, 1), 3.0, bounds=0.5, objective="time", intervals=32, starts=2)
    assert plan.duration == pytest.approx(4.0, rel=1e-4)
    assert plan.error < 1e-7


def test_drift_is_part_of_the_true_system() -> None:
    group = lc.group("so3")
    drift = np.array([0.0, 0.0, 0.1])
    plan = lc.steer(group, G, ("w1", "w2"), 5.0, drift=drift)
    np.testing.assert_allclose(path(plan, np.array([5.0]), drift)[0], plan.target, atol=1e-8)


def test_via_points_are_met() -> None:
    group = lc.group("se2")
    via = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1.0]])
    plan = lc.steer(group, [0.5, 1.0, 0.0], (0, 1), 1.0, via=[(0.5, via)])
    np.testing.assert_allclose(path(plan, np.array([0.5]))[0], via, atol=2e-6)
    assert plan.error < 1e-8


def test_limits_that_cannot_be_met_are_named() -> None:
    with pytest.raises(SteeringError, match="times the bound of w1"):
        lc.steer(lc.group("so3"), G, ("w1", "w2"), 1.0, bounds={"w1": 0.05}, intervals=8, starts=1)
    inside = Cone((0, 0, 1), (0, 0, 1), 0.1)
    with pytest.raises(InfeasibleError, match="start itself is inside obstacle 1"):
        lc.steer(
            lc.group("so3"), [1e-3, 0, 0.3], ("w1", "w2"), 1.0, bounds=1e-2, obstacles=[inside], intervals=16, starts=1
        )


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"bounds": {"w3": 1.0}}, "no control"),
        ({"bounds": (0.3, 0.1)}, "not below"),
        ({"objective": "time"}, "bounds on every control"),
        ({"objective": "speed"}, "objective"),
        ({"bounds": (0.1, 0.3), "rest": True}, "allow zero"),
        ({"obstacles": [Ball((1.0, 0.0), 0.1)]}, "group of motions"),
        ({"obstacles": [Cone((0, 0, 0), (0, 0, 1), 0.1)]}, "axis"),
        ({"via": [(0.0, G)]}, "inner nodes"),
        ({"intervals": 2}, "at least 4"),
        ({"solver": "snopt"}, "solver"),
        ({"bound": 1.0}, "no option bound"),
    ],
)
def test_refusals(options: dict[str, object], words: str) -> None:
    with pytest.raises(SteeringInputError, match=words):
        lc.steer(lc.group("so3"), G, ("w1", "w2"), 1.0, method="transcription", **options)


def test_a_cone_needs_a_rotation_of_space() -> None:
    with pytest.raises(SteeringInputError, match="rotations of space"):
        lc.steer(lc.group("se2"), [0.1, 0.2, 0.3], (0, 1), 1.0, obstacles=[Cone((0, 0, 1), (1, 0, 0), 0.1)])
