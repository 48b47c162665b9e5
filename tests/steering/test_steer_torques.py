"""Second-order steering: torques as controls, checked by scipy's integrator and by closed forms; periodic controls."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.errors import InputError, ShapeError, SteeringError, SteeringInputError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.mechanics.driven import simulate_driven
from lie_codegen.pictures.steering_picture import draw_plan
from lie_codegen.steering.plan import Plan

G = (0.4, -0.3, 1.2)
WHEELS = {"dynamics": "second_order", "inertia": (1.0, 2.0, 3.0)}
CART = {"dynamics": "second_order", "inertia": np.array([[1.5, 0, 0.2], [0, 2.0, 0], [0.2, 0, 2.0]])}


def motion(
    group: MatrixGroup,
    J: NDArray[np.float64],
    force: object,
    knots: NDArray[np.float64],
    xi0: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """X and xi at the end by DOP853, from knot to knot; <ad*_xi p, y> = <p, [xi, y]> written out on matrices."""
    d, n = group.degree, group.dim

    def rate(t: float, state: NDArray[np.float64]) -> NDArray[np.float64]:
        X, xi = state[: d * d].reshape(d, d), state[d * d :]
        hat = group.hat(xi)
        brackets = np.array([group.vee(hat @ A - A @ hat) for A in group.basis])
        wrench = brackets @ (J @ xi) + force(t)  # type: ignore[operator]
        return np.concatenate([(X @ hat).ravel(), np.linalg.solve(J, wrench)])

    state = np.concatenate([np.eye(d).ravel(), xi0])
    for a, b in pairwise(knots):
        state = solve_ivp(rate, (a, b), state, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    assert len(state) == d * d + n
    return state[: d * d].reshape(d, d), state[d * d :]


def arrives(plan: Plan, J: NDArray[np.float64], start: object = 0.0, end: object = 0.0) -> None:
    n = plan.group.dim
    knots = np.concatenate([[0.0], plan.u.breakpoints, [plan.duration]])
    X, xi = motion(plan.group, J, plan.u, knots, np.broadcast_to(np.asarray(start, float), (n,)))
    np.testing.assert_allclose(X, plan.target, atol=2e-8)
    np.testing.assert_allclose(xi, np.broadcast_to(np.asarray(end, float), (n,)), atol=2e-8)


@pytest.mark.parametrize("name", ["so3", "se2"])
def test_driven_motion_against_scipy(name: str) -> None:
    group = lc.group(name)
    J = np.array([[1.0, 0.1, 0], [0.1, 2.0, 0], [0, 0, 3.0]])
    xi0 = np.array([0.1, 0.2, -0.3])

    def force(t: float | NDArray[np.float64]) -> NDArray[np.float64]:
        return np.stack([np.sin(t), np.cos(2 * t), 0 * t], axis=-1)

    run = simulate_driven(group, force, J, t=[0.0, 1.0, 2.0], xi0=xi0)
    X, xi = motion(group, J, force, np.array([0.0, 2.0]), xi0)
    np.testing.assert_allclose(run.X[-1], X, atol=1e-9)
    np.testing.assert_allclose(run.xi[-1], xi, atol=1e-9)


def test_two_torques_turn_a_body_about_all_axes_from_rest_to_rest() -> None:
    plan = lc.steer(lc.group("so3"), G, ("w1", "w2"), 5.0, intervals=32, starts=1, **WHEELS)
    assert plan.method == "transcription"
    assert plan.error < 1e-8
    assert not np.any(plan.u(np.linspace(0, 5, 11))[:, 2])
    arrives(plan, np.diag(WHEELS["inertia"]))
    peak = max(plan.details["control_peaks"])
    bounded = lc.steer(lc.group("so3"), G, ("w1", "w2"), 5.0, intervals=32, starts=1, bounds=0.8 * peak, **WHEELS)
    assert np.max(np.abs(bounded.u(np.append(bounded.u.breakpoints, [0, 5.0])))) <= 0.8 * peak + 1e-8
    assert bounded.cost > plan.cost
    arrives(bounded, np.diag(WHEELS["inertia"]))


def test_a_planar_body_with_a_thruster_and_a_torque() -> None:
    """The inertia couples turning and sideways motion; the start and the end are in motion."""
    start, end = np.array([0.1, 0.3, 0.0]), np.array([0.0, 0.2, 0.0])
    plan = lc.steer(
        lc.group("se2"),
        (0.5, 1.0, 0.3),
        (0, 1),
        3.0,
        intervals=32,
        starts=1,
        start_velocity=start,
        end_velocity=end,
        **CART,
    )
    arrives(plan, CART["inertia"], start, end)


def test_least_energy_and_least_time_about_one_axis() -> None:
    """A double integrator: int u^2 = 12 J^2 phi^2 / T^3, u linear; with |u| <= b, T = 2 sqrt(J phi / b)."""
    group, phi, J = lc.group("so3"), 0.8, 2.0
    target = expm(group.hat([0, phi, 0]))
    options = {"dynamics": "second_order", "inertia": (1.0, J, 3.0), "starts": 1}
    plan = lc.steer(group, target, ("w1", "w2"), 3.0, intervals=16, **options)
    assert plan.cost == pytest.approx(12 * J**2 * phi**2 / 3.0**3, rel=1e-6)
    np.testing.assert_allclose(plan.u(1.5), 0, atol=1e-6)
    quick = [
        lc.steer(group, target, ("w1", "w2"), 3.0, bounds=0.5, objective="time", intervals=n, **options).duration
        for n in (16, 32)
    ]
    exact = 2 * np.sqrt(J * phi / 0.5)
    assert exact < quick[1] < quick[0] < 1.1 * exact


def test_speeds_stay_within_their_limits() -> None:
    group = lc.group("so3")
    target = expm(group.hat([0, 0.8, 0]))
    plan = lc.steer(group, target, ("w1", "w2"), 3.0, intervals=32, starts=1, velocity_bounds={"w2": 0.35}, **WHEELS)
    assert plan.details["velocity_peaks"][1] == pytest.approx(0.35, rel=2e-3)
    arrives(plan, np.diag(WHEELS["inertia"]))


def test_fatrop_agrees() -> None:
    costs = [
        lc.steer(lc.group("so3"), G, ("w1", "w2"), 5.0, intervals=32, starts=1, solver=solver, **WHEELS).cost
        for solver in ("ipopt", "fatrop")
    ]
    assert costs[0] == pytest.approx(costs[1], rel=1e-6)


def test_controls_of_a_gait_end_as_they_begin() -> None:
    """Repeated, the plan moves by the target each time without a jump; the free optimum has one."""
    group, T = lc.group("se2"), 2.0
    free = lc.steer(group, (0.3, 0.5, 0.4), (0, 1), T, method="transcription", intervals=32, starts=2)
    gait = lc.steer(group, (0.3, 0.5, 0.4), (0, 1), T, periodic=True, intervals=32, starts=2)
    assert np.linalg.norm(free.u(0.0) - free.u(T)) > 0.1
    np.testing.assert_allclose(gait.u(0.0), gait.u(T), atol=1e-9)
    assert gait.cost > free.cost
    twice = lc.simulate(group, lambda t: gait.u(np.mod(t, T)), t=[0.0, T, 2 * T], tolerance=1e-8).X
    np.testing.assert_allclose(twice[2], gait.target @ gait.target, atol=1e-6)
    torques = lc.steer(lc.group("so3"), G, ("w1", "w2"), 5.0, periodic=True, intervals=32, starts=1, **WHEELS)
    np.testing.assert_allclose(torques.u(0.0), torques.u(5.0), atol=1e-9)


def test_a_plan_of_torques_is_drawn_along_its_own_motion() -> None:
    plan = lc.steer(lc.group("se2"), (0.2, 0.5, 0.0), (0, 1), 3.0, intervals=16, starts=1, **CART)
    figure = draw_plan(plan)
    drawn = [line.get_xydata()[-1] for axes in figure.axes for line in axes.get_lines() if len(line.get_xydata()) > 100]
    assert any(np.allclose(point, plan.target[:2, 2], atol=1e-6) for point in drawn)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"dynamics": "third_order"}, "dynamics is"),
        ({"inertia": 1.0}, "belongs to"),
        ({"dynamics": "second_order"}, "need an inertia"),
        ({"dynamics": "second_order", "inertia": (1, 2, -3)}, "positive definite"),
        ({"drift": (0, 0, 0.1), **WHEELS}, "start_velocity"),
        ({"velocity_bounds": {"w1": 0.1}, "start_velocity": (0.2, 0, 0), **WHEELS}, "exclude"),
        ({"periodic": True, "solver": "fatrop"}, "fatrop"),
        ({"periodic": True, "start_velocity": (0.2, 0, 0), **WHEELS}, "velocity it starts with"),
    ],
)
def test_refusals(options: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        lc.steer(lc.group("so3"), G, ("w1", "w2"), 1.0, method="transcription", **options)


def test_refusals_of_shapes_and_of_weak_motors() -> None:
    with pytest.raises(ShapeError, match="start_velocity"):
        lc.steer(lc.group("so3"), G, ("w1", "w2"), 1.0, start_velocity=(0, 0), **WHEELS)
    with pytest.raises(SteeringError, match="times the bound of w1"):
        lc.steer(lc.group("so3"), G, ("w1", "w2"), 1.0, bounds=0.1, intervals=16, starts=1, **WHEELS)
    with pytest.raises(SteeringInputError, match="fatrop"):
        lc.steer(lc.group("so3"), G, ("w1", "w2"), 1.0, periodic=True, solver="fatrop")
