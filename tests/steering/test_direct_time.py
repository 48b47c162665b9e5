"""objective="time" and spread=: against closed forms (Dubins, the flip of a qubit) and a flight of their own by exponentials."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import lie_codegen as lc

SX = np.array([[0, 1], [1, 0]])


def pose(x: float, y: float, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, x], [s, c, y], [0, 0, 1]])


def dubins(x: float, y: float, angle: float) -> float:
    """Length of the shortest path of curvature at most one, by trying the arcs of LSL, RSR, LSR, RSL, LRL, RLR (Dubins, 1957)."""
    best = np.inf
    for first, last in ((1, 1), (-1, -1), (1, -1), (-1, 1)):
        start = np.array([0.0, first])
        end = np.array([x, y]) + last * np.array([-np.sin(angle), np.cos(angle)])
        gap = end - start
        length, direction = np.hypot(*gap), np.arctan2(gap[1], gap[0])
        if first == last:
            heading, straight = direction, length
        elif length >= 2:
            straight = np.sqrt(length**2 - 4)
            heading = direction + first * np.arctan2(2, straight)
        else:
            continue
        best = min(best, (first * heading) % (2 * np.pi) + straight + (last * (angle - heading)) % (2 * np.pi))
        if first == last and length <= 4:
            for side in (1, -1):
                middle = (start + end) / 2 + side * np.sqrt(4 - (length / 2) ** 2) * np.array([-gap[1], gap[0]]) / max(
                    length, 1e-300
                )
                turns = []
                for center in (start, end):
                    away = middle - center
                    turns.append(np.arctan2(away[1], away[0]) + first * np.pi / 2)
                total = sum(
                    (sign * (b - a)) % (2 * np.pi)
                    for sign, a, b in ((first, 0.0, turns[0]), (-first, turns[0], turns[1]), (first, turns[1], angle))
                )
                best = min(best, total)
    return float(best)


def test_dubins_cars_take_the_closed_forms_time() -> None:
    se2, rng = lc.group("se2"), np.random.default_rng(4)
    poses = [(1.0, 0.0, 0.0), *((*rng.uniform(-3, 3, 2), rng.uniform(-np.pi, np.pi)) for _ in range(5))]
    for x, y, angle in poses:
        plan = lc.steer(se2, pose(x, y, angle), ("omega",), 5.0, drift=(0, 1, 0), bounds=1, objective="time")
        assert plan.method == "direct"
        assert plan.duration == pytest.approx(dubins(x, y, angle), abs=1e-6)
        X = np.eye(3)
        for omega, length in plan.details["arcs"]:
            X = X @ expm(se2.hat([omega * length, length, 0]))
        np.testing.assert_allclose(X, pose(x, y, angle), atol=1e-9)


@pytest.mark.parametrize(("sideways", "least"), [(0.5, 1.9163844), (1.0, 2.6362321)])
def test_a_car_that_turns_on_the_spot_parks_sideways(sideways: float, least: float) -> None:
    plan = lc.steer(lc.group("se2"), pose(0, sideways, 0), ("omega", "vx"), 3.0, bounds=1, objective="time")
    assert plan.duration == pytest.approx(least, abs=1e-6)
    assert np.all(np.abs(plan.inputs(np.linspace(0, plan.duration, 999))) <= 1)


@pytest.mark.parametrize(("bound", "least"), [(1.5, np.pi / np.sqrt(3.25)), (0.5, 4.892901), (0.2, 12.0799)])
def test_the_flip_of_a_qubit_switches_as_often_as_its_field_is_weak(bound: float, least: float) -> None:
    flip = lc.Pointing((0, 0, 1), (0, 0, -1))
    plan = lc.steer(lc.group("so3"), flip, ("w1",), 5.0, drift=(0, 0, 2), bounds=2 * bound, objective="time")
    assert plan.duration == pytest.approx(least, rel=1e-5)
    np.testing.assert_allclose(plan.X_final[:, 2], [0, 0, -1], atol=1e-9)


def test_least_time_needs_bounds_and_says_when_it_found_nothing() -> None:
    se2 = lc.group("se2")
    with pytest.raises(lc.errors.SteeringInputError, match="bounds"):
        lc.steer(se2, pose(1, 0, 0), ("omega",), 5.0, method="direct", drift=(0, 1, 0), objective="time")
    with pytest.raises(lc.errors.SteeringError, match="proves nothing") as error:
        lc.steer(
            se2,
            pose(40, 0, 0),
            ("omega",),
            1.0,
            drift=(0, 1, 0),
            bounds=1,
            objective="time",
            longest=10,
            rounds=1,
            starts=4,
        )
    assert error.value.best.status.name == "NOT_FOUND"
    assert max(error.value.violation.values()) > 1


def test_a_robust_flip_serves_every_system_of_the_spread() -> None:
    su2 = lc.group("su2")
    spread: list[dict[str, Any]] = [{"drift": (0, 0, s), "gain": g} for s in (-0.2, 0, 0.2) for g in (0.95, 1.05)]
    plan = lc.steer(su2, -1j * SX, ("sx", "sy"), 8.0, bounds=1, spread=spread)
    pulses = plan.details["pieces"]
    worst = 0.0
    for one in spread:
        X = np.eye(2, dtype=complex)
        for u in pulses.first:
            a = one["gain"] * np.array([*u, 0]) + np.array(one["drift"])
            X = X @ expm(su2.hat(8.0 / len(pulses.first) * a))
        worst = max(worst, 1 - abs(np.trace(X.conj().T @ (-1j * SX))) ** 2 / 4)
    assert plan.details["worst_infidelity"] == pytest.approx(worst, rel=1e-6)
    assert worst < 7e-3
    with pytest.raises(lc.errors.ShapeError, match="gain"):
        lc.steer(su2, -1j * SX, ("sx", "sy"), 8.0, bounds=1, spread=[{"gain": (1, 2, 3)}])


CAR = [(1, 1), (0, 1), (-1, 1), (1, -1), (0, -1), (-1, -1)]


@pytest.mark.parametrize(("goal", "least"), [((0, 0, np.pi), np.pi), ((-1, 0, 0), 1.0), ((0, 0, 0.5), 0.5)])
def test_reeds_and_shepps_car_turns_in_three_arcs(goal: tuple[float, float, float], least: float) -> None:
    plan = lc.steer(lc.group("se2"), pose(*goal), ("omega", "vx"), 3.0, objective="time", vertices=CAR, bounds=1)
    assert plan.duration == pytest.approx(least, abs=1e-6)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_word_without_the_arc_it_needs_gets_it(seed: int) -> None:
    """R- L+ S+ R+ of 1.0362528, pi / 2, 1.9495608, 0.0136294 (Reeds and Shepp's formulas): random words end 7e-5 above, with a short R+
    before the straight arc instead of behind it."""
    goal = (-2.9008341868288254, 1.879621435201635, 2.5934197786078093)
    plan = lc.steer("se2", pose(*goal), ("omega", "vx"), 5.0, objective="time", vertices=CAR, bounds=1, seed=seed)
    assert plan.duration == pytest.approx(4.5702392814, rel=1e-9)
    assert [arc[:2] for arc in plan.details["arcs"]] == [(1, -1), (1, 1), (0, 1), (-1, 1)]
    assert plan.details["arcs"][1][2] == pytest.approx(np.pi / 2, abs=1e-4)


def test_reeds_and_shepps_car_drives_mirrored_ways_in_the_same_time() -> None:
    # reflections of time and of the plane: exact symmetries of the shortest ways
    x, y, angle = 0.7, -0.4, 1.9
    times = [
        lc.steer(lc.group("se2"), pose(*goal), ("omega", "vx"), 3.0, objective="time", vertices=CAR, bounds=1).duration
        for goal in ((x, y, angle), (-x, y, -angle), (x, -y, -angle))
    ]
    assert times == pytest.approx([times[0]] * 3, rel=1e-4)


def test_a_spread_serves_a_gate_on_two_of_three_levels() -> None:
    """Each system ends at a gate of its own on the third level, and in phases of its own."""
    su3, gate = lc.group("su3"), np.array([[0, 1], [1, 0]])
    spread = [{"gain": g} for g in (0.97, 1.0, 1.03)]
    plan = lc.steer(
        su3, lc.UpToPhase(gate, levels=(0, 1)), ("l1", "l2", "l6", "l7"), 6.0, bounds=2, spread=spread, starts=6
    )
    knots = np.linspace(0, 6, len(plan.u.breakpoints) + 2)
    for number, one in enumerate(spread):
        X = np.eye(3, dtype=complex)
        for a, b in pairwise(knots):
            X = X @ expm((b - a) * su3.hat(one["gain"] * plan.u((a + b) / 2)))
        off = 1 - abs(np.trace(gate.T @ X[:2, :2])) ** 2 / 4
        assert off < 1e-4
        assert off == pytest.approx(plan.details["infidelities"][number], abs=1e-9)
    assert plan.details["worst_infidelity"] < 1e-4
