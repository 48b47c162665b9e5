"""start= for obstacles, gates printed with a few digits, goal sets asked of other methods, feedback that survives what is left."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lie_codegen as lc


def test_obstacles_stay_in_space_when_the_start_moves() -> None:
    se2 = lc.group("se2")
    start, goal = expm(se2.hat([0.7, 0, 0])), np.eye(3)
    start[:2, 2], goal[:2, 2] = [1, -1], [3.5, 0.8]
    plan = lc.steer(se2, goal, ("omega", "vx"), 4.0, obstacles=[lc.Ball((2.0, 0.0), 0.5)], start=start)
    np.testing.assert_allclose(plan.X_final, goal, atol=1e-6)
    np.testing.assert_allclose(plan.target, goal, atol=1e-12)

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        return (x.reshape(3, 3) @ se2.hat(plan.u(min(max(t, 0.0), 4.0)))).ravel()

    run = solve_ivp(rate, (0, 4), start.ravel(), rtol=1e-9, atol=1e-9, max_step=0.02)
    np.testing.assert_allclose(run.y[:, -1].reshape(3, 3), goal, atol=2e-6)
    assert np.min(np.hypot(run.y[2] - 2, run.y[5])) > 0.5 - 1e-5


def test_a_start_without_obstacles_is_a_geodesic_where_all_is_actuated() -> None:
    so3 = lc.group("so3")
    start, goal = expm(so3.hat([0.3, 0.2, -0.5])), expm(so3.hat([0, 0, 2.5]))
    plan = lc.steer(so3, goal, ("w1", "w2", "w3"), 1.0, start=start)
    turn = np.arccos((np.trace(start.T @ goal) - 1) / 2)
    assert plan.cost == pytest.approx(turn**2, rel=1e-6)


def test_gates_of_seven_digits_are_taken_for_the_unitary_ones() -> None:
    su2 = lc.group("su2")
    gate = np.round(np.array([[1, 1], [1, -1]]) / np.sqrt(2), 7)
    plan = lc.steer(su2, lc.UpToPhase(gate), ("sx", "sy"), 6.0, drift=[0, 0, 1], bounds=1)
    assert plan.error < 1e-9
    with pytest.raises(lc.errors.NotOnGroupError, match="singular values"):
        lc.steer(su2, lc.UpToPhase(np.round(gate, 1)), ("sx", "sy"), 6.0, drift=[0, 0, 1], bounds=1)


def test_sets_of_goals_are_refused_by_methods_for_elements() -> None:
    with pytest.raises(lc.errors.SteeringInputError, match="set of goals"):
        lc.steer(lc.group("se2"), lc.Position((0, 1)), ("omega", "vx"), 1.0, method="loops")
    with pytest.raises(lc.errors.SteeringInputError, match="Position"):
        lc.steer(lc.group("so3"), lc.Position((0, 1)), ("w1", "w2"), 1.0)
    with pytest.raises(lc.errors.ShapeError, match="Pointing"):
        lc.steer(lc.group("so3"), lc.Pointing((0, 0, 0), (0, 0, 1)), ("w1", "w2"), 1.0)
    assert lc.Pointing((0, 0, 1), [0, 1, 0]) == lc.Pointing(np.array([0, 0, 1]), (0, 1, 0))


@pytest.mark.parametrize("planner", ["four_phase", "swing_twist"])
def test_feedback_goes_on_where_the_planner_refuses_what_is_left(planner: str) -> None:
    plan = lc.steer(
        lc.group("so3"), (0.1, 0.05, 0.08), ("w1", "w2"), 24.0, method="feedback", planner=planner, steps=6, gain=1.02
    )
    errors = plan.details["errors"]
    assert errors[-1] < 1e-8
    assert all(b < a for a, b in pairwise(errors))
    with pytest.raises(lc.errors.SteeringInputError, match="no option"):
        lc.steer(
            lc.group("so3"),
            (0.1, 0.05, 0.08),
            ("w1", "w2"),
            24.0,
            method="feedback",
            step_options={"p": 1},
            planner=planner,
        )


def test_the_python_of_the_guide_runs() -> None:
    guide = Path(lc.__file__).parent / "steering" / "README.md"
    names: dict[str, object] = {}
    for block in re.findall(r"```python\n(.*?)```", guide.read_text(encoding="utf-8"), re.DOTALL):
        exec(compile(block, str(guide), "exec"), names)  # noqa: S102  our own text
    assert "pulse" in names


@pytest.mark.parametrize("method", ["direct", "transcription"])
def test_a_path_is_a_guess_with_its_times_or_without(method: str) -> None:
    """The way about the axis of a turn; at uneven times, quick in the middle."""
    so3 = lc.group("so3")
    turn = np.array([0.4, -0.3, 0.7])
    target = expm(so3.hat(turn))
    t = np.linspace(0, 1, 21) ** 2
    even = np.array([expm(s * so3.hat(turn)) for s in np.linspace(0, 1, 21)])
    uneven = np.array([expm(s * so3.hat(turn)) for s in t])
    best = lc.steer(so3, target, ("w1", "w2"), 2.0)
    for guess in (even, (uneven, 2 * t)):
        plan = lc.steer(so3, target, ("w1", "w2"), 2.0, method=method, guess=guess, starts=1, bounds=3)
        assert plan.error < 1e-6
        assert plan.cost >= best.cost * (1 - 1e-6)
    with pytest.raises(lc.errors.ShapeError, match="increasing times"):
        lc.steer(so3, target, ("w1", "w2"), 2.0, method=method, guess=(uneven, -t), bounds=3)


def test_a_path_with_times_is_the_same_motion_at_equal_times() -> None:
    from lie_codegen.steering.path_samples import path_of, path_velocities

    so3, turn, t = lc.group("so3"), np.array([0.4, -0.3, 0.7]), np.linspace(0, 1, 9) ** 2
    given = np.array([expm(s * so3.hat(turn)) for s in t])
    path = path_of(so3, (given, 2 * t), "guess")
    assert path is not None
    np.testing.assert_allclose(path_velocities(so3, path, 0.25), np.tile(turn / 2, (8, 1)), atol=1e-12)


def test_a_guess_of_the_optimal_method_is_an_extremal_more() -> None:
    so3 = lc.group("so3")
    target = expm(so3.hat([0.5, -0.8, 1.1]))
    best = lc.steer(so3, target, ("w1", "w2"), 2.0, method="optimal")
    for guess in (best, best.u(np.linspace(0, 2, 41))[:, :2], lambda t: best.u(t)[:2], best.X(np.linspace(0, 2, 41))):
        again = lc.steer(so3, target, ("w1", "w2"), 2.0, method="optimal", guess=guess)
        told = [line for line in again.details["tried"] if line.startswith("the guess given")]
        assert len(told) == 1
        # it leads to the same extremal, whose residual is told
        assert float(told[0].split("cost ")[1].split(",")[0]) == pytest.approx(best.cost, rel=1e-5)
        assert float(told[0].split("miss ")[1]) < 1e-10
        assert again.cost == pytest.approx(best.cost, rel=1e-9)
    with pytest.raises(lc.errors.ShapeError, match="guess"):
        lc.steer(so3, target, ("w1", "w2"), 2.0, method="optimal", guess=np.zeros((5, 3)))
    aimed = lc.steer(so3, lc.Pointing((1, 0, 0), (0, 1, 0)), ("w1", "w2"), 2.0, method="optimal", guess=best)
    assert any(line.startswith("the guess given") for line in aimed.details["tried"])
