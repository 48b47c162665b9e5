"""Sets of goals where there is more to heed than the end: obstacles, inertia, rest; against plans to single elements of the set."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm, logm

import lie_codegen as lc

SO3 = lc.group("so3")


def flown(plan: lc.Plan) -> np.ndarray:
    """(k, d, d) states of the true system, by an integrator of scipy's."""
    d = plan.group.degree

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        return (x.reshape(d, d) @ plan.group.hat(plan.u(min(t, plan.duration)))).ravel()

    run = solve_ivp(rate, (0, plan.duration), np.eye(d).ravel(), rtol=1e-9, atol=1e-10, max_step=plan.duration / 200)
    return np.asarray(run.y.T.reshape(-1, d, d))


def test_a_boresight_passes_a_cone_and_ends_at_the_best_roll() -> None:
    axis, direction = np.array([1.0, 0, 0]), np.array([0.2, 0.9, -0.4])
    direction /= np.linalg.norm(direction)
    cone = lc.Cone((1, 0, 0), tuple(axis + direction + [0, 0, 0.15]), 0.2)
    plan = lc.steer(SO3, lc.Pointing(axis, direction), ("w1", "w2"), 1.0, obstacles=[cone])
    X = flown(plan)
    np.testing.assert_allclose(X[-1] @ axis, direction, atol=1e-6)
    assert np.min(cone.clearance(X)) > -1e-6
    # the roll is free: any other roll costs more, to first order nothing
    roll = SO3.hat(axis)
    costs = [
        lc.steer(SO3, plan.target @ expm(angle * roll), ("w1", "w2"), 1.0, obstacles=[cone]).cost
        for angle in (-0.02, 0.0, 0.02, 2.0, -2.0)
    ]
    assert costs[1] == pytest.approx(plan.cost, rel=1e-5)
    assert costs[0] - costs[1] == pytest.approx(costs[2] - costs[1], rel=0.1)
    assert min(costs) >= plan.cost * (1 - 1e-5)


def test_a_position_behind_a_ball_is_cheaper_than_the_same_with_any_heading() -> None:
    ball, point = lc.Ball((1.0, 0.45), 0.35), np.array([2.0, 1.0])
    plan = lc.steer("se2", lc.Position(point), ("omega", "vx"), 3.0, obstacles=[ball])
    X = flown(plan)
    np.testing.assert_allclose(X[-1, :2, 2], point, atol=1e-6)
    assert np.min(ball.clearance(X)) > -1e-6
    turn = lc.group("se2").hat([1, 0, 0])
    for angle in (-0.3, 0.3):
        other = lc.steer("se2", plan.target @ expm(angle * turn), ("omega", "vx"), 3.0, obstacles=[ball])
        assert other.cost > plan.cost
    assert plan.details["goal"] == lc.Position(point)


@pytest.mark.slow
def test_torques_turn_a_boresight_and_the_body_that_starts_elsewhere() -> None:
    start, direction = expm(SO3.hat([0.3, -0.8, 0.5])), np.array([0, 0.6, 0.8])
    options = {"dynamics": "second_order", "inertia": [1.0, 2.0, 3.0], "bounds": 2.0}
    plan = lc.steer(SO3, lc.Pointing((0, 0, 1), direction), ("w1", "w2", "w3"), 3.0, start=start, **options)
    np.testing.assert_allclose(plan.X_final[:, 2], direction, atol=1e-9)
    assert plan.status.name == "LOCAL"
    for angle in (-0.3, 0.3):
        roll = expm(SO3.hat([0, 0, angle]))
        assert lc.steer(SO3, plan.target @ roll, ("w1", "w2", "w3"), 3.0, start=start, **options).cost > plan.cost


@pytest.mark.parametrize(
    ("group", "goal", "controls", "cost"),
    [
        # the first is an arc of a great circle; the others were found twice, by programs that share no code
        ("so3", lc.Pointing((0, 0, 1), (0.48, -0.6, 0.64)), ("w1", "w2"), np.arccos(0.64) ** 2),
        ("so3", lc.Pointing((1, 0, 0), (0.48, -0.6, 0.64)), ("w1", "w2"), 2.473659),
        ("se2", lc.Position((0, 1)), ("omega", "vx"), 5.161601),
        ("se2", lc.Position((-1, 0.5)), ("omega", "vx"), 1.880744),
        ("se2", lc.Position((0.5, 2)), ("omega", "vx"), 9.288260),
    ],
)
def test_extremals_meet_sets_transversally(group: str, goal: object, controls: tuple[str, ...], cost: float) -> None:
    plan = lc.steer(group, goal, controls, 1.0, method="optimal")
    assert plan.cost == pytest.approx(cost, abs=1e-6)
    assert plan.status.name == "LOCAL"
    assert plan.details["transversality"] < 1e-9
    X = flown(plan)[-1]
    if isinstance(goal, lc.Pointing):
        np.testing.assert_allclose(X @ goal.axis, goal.direction, atol=1e-7)
    else:
        np.testing.assert_allclose(X[:-1, -1], goal.point, atol=1e-7)


def test_a_way_beyond_the_antipode_has_a_focal_point_at_it() -> None:
    from lie_codegen.steering.shooting.transversal import focal_times

    angle = 4.0  # X e3 runs along a great circle, past -e3
    extremal = lc.shooter("so3", ("w1", "w2")).extremal(np.array([angle, 0, 0]))
    (time,) = focal_times(extremal, np.array([[0.0, 0, 1]]))
    assert time == pytest.approx(1 - np.pi / angle, abs=0.02)
    short = lc.shooter("so3", ("w1", "w2")).extremal(np.array([3.0, 0, 0]))
    assert focal_times(short, np.array([[0.0, 0, 1]])) == ()


def test_goals_become_cosets() -> None:
    from lie_codegen.steering.goals import cosets, end_of

    rng = np.random.default_rng(3)
    se3, su2 = lc.group("se3"), lc.group("su2")
    element = expm(se3.hat(rng.normal(size=6)))
    for group, goal, dimensions in (
        (SO3, lc.Pointing((0, 0, 1), (0, 0, -1)), 1),
        (SO3, lc.Pointing((1, 2, 3), (3, -1, 1)), 1),
        (se3, lc.Pointing((1, 0, 0), (0, 1, 1)), 4),
        (se3, lc.Position((1, 2, 3)), 3),
        (se3, lc.Coset(element, ("w1", "v2"), side="left"), 2),
        (su2, lc.Pointing((0, 0, 1), (1, 0, 0)), 1),
        (su2, lc.UpToPhase(np.eye(2)), 0),
    ):
        elements, free = cosets(group, goal, "test")
        assert free.shape == (dimensions, group.dim)
        end = end_of(group, goal, "test")
        for number, T in enumerate(elements):
            X = T @ expm(group.hat(rng.normal(size=dimensions) @ free)) if dimensions else T
            if len(end.before):  # X T^-1 is a motion of space along the free directions
                turn = np.real(logm(X @ np.linalg.inv(T)))
                coordinates = group.project(turn)
                fit = np.linalg.lstsq(end.before.T, coordinates, rcond=None)[0]
                np.testing.assert_allclose(fit @ end.before, coordinates, atol=1e-9)
            elif not len(end.after):
                np.testing.assert_allclose(end.left @ X @ end.right, end.values[number], atol=1e-12)


def test_no_way_is_proved_for_a_set_too_and_other_methods_name_those_that_take_one() -> None:
    with pytest.raises(lc.errors.InfeasibleError, match="position"):
        lc.steer("se2", lc.Position((9, 0)), ("omega", "vx"), 1.0, bounds=1, obstacles=[lc.Ball((4.0, 0.0), 0.5)])
    with pytest.raises(lc.errors.SteeringInputError, match="transcription"):
        lc.steer("se2", lc.Position((0, 1)), ("omega", "vx"), 1.0, method="area_rule")


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_open_layer_ends_in_a_coset_as_the_direct_method_does(side: str) -> None:
    so3 = lc.group("so3")
    goal = lc.Coset(expm(so3.hat([0.4, -0.3, 0.7])), free=("w1",), side=side)
    ours = lc.steer(so3, goal, ("w1", "w2"), 1.0)
    open_ = lc.steer(so3, goal, ("w1", "w2"), 1.0, method="ocp")
    assert open_.cost == pytest.approx(ours.cost, rel=2e-3)  # constant on its intervals
    T = np.array(goal.element)
    turn = T.T @ open_.X_final if side == "right" else open_.X_final @ T.T
    np.testing.assert_allclose(turn[:, 0], [1, 0, 0], atol=1e-7)


def test_the_open_layer_takes_a_gate_up_to_its_phase() -> None:
    su2 = lc.group("su2")
    gate = np.array([[1, 1], [1, -1]]) / np.sqrt(2)
    plan = lc.steer(su2, lc.UpToPhase(gate), ("sx", "sy"), 1.0, method="ocp")
    assert plan.cost == pytest.approx(15.507140, rel=1e-3)
    assert abs(np.vdot(gate, plan.X_final)) / 2 == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("name", ["so3", "su2", "se2", "se3", "h3"])
@pytest.mark.parametrize("method", ["optimal", "direct"])
def test_a_set_that_holds_the_start_is_met_at_rest(name: str, method: str) -> None:
    """On SU(2) a whole loop was returned: the costate of rest is zero, and |F mu| / |mu| was asked of it."""
    group = lc.group(name)
    label = group.labels[-1]
    element = expm(group.hat(0.7 * np.eye(group.dim)[-1]))
    plan = lc.steer(name, lc.Coset(element, free=(label,)), list(group.labels[:-1]), 2.0, method=method)
    assert plan.cost < 1e-20
    assert np.max(np.abs(plan.X(2.0) - np.eye(group.degree))) < 1e-9
    assert not plan.details.get("focal_times")
