"""`lc.simulate` of every kind of plan: those of `lc.ocp` and of wheels too, against differential equations of matrices written here, by scipy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lie_codegen as lc

SO3, SE2 = lc.group("so3"), lc.group("se2")
INERTIA, DRAG = np.array([2.0, 1.5, 1.0]), 0.3


def integrated(rates: Callable[[int, float, Any, Any], Any], X: Any, z: Any, edges: Any, times: Any) -> tuple[Any, Any]:
    """X' = X Omega, z' = f from t = 0, where rates(k, t, X, z) = (Omega, f) on interval k of the edges: piece by piece, by DOP853."""
    d = len(X)
    moments = np.unique(np.concatenate([edges, times]))
    kept = []
    for i, moment in enumerate(moments):
        if np.any(times == moment):
            kept.append((X, z))
        if i + 1 < len(moments):
            k = min(int(np.searchsorted(edges, moment, side="right")) - 1, len(edges) - 2)

            def slope(t: float, y: Any, k: int = k) -> Any:
                X, z = y[: d * d].reshape(d, d), y[d * d :]
                Omega, f = rates(k, t, X, z)
                return np.concatenate([(X @ Omega).ravel(), f])

            y = np.concatenate([X.ravel(), z])
            y = solve_ivp(slope, (moment, moments[i + 1]), y, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
            X, z = y[: d * d].reshape(d, d), y[d * d :]
    return np.array([X for X, _ in kept]), np.array([z for _, z in kept])


def test_velocities_of_a_problem_fly_as_any_input() -> None:
    problem = lc.ocp(
        "so3", duration=2.0, intervals=8, controls=["w1", "w2"], drift=[0, 0, 0.3], stage_cost=["u"], target="Xd", parameters={"Xd": (3, 3)}
    )  # fmt: skip
    plan = problem.solve(np.eye(3), Xd=lc.build("so3").exp(np.array([0.4, 0.2, 0.5])))
    times = np.array([0.0, 0.31, 1.0, 1.77, 2.0])
    run = lc.simulate(plan, t=times)
    u = np.asarray(plan.u)
    X, _ = integrated(lambda k, t, X, z: (SO3.hat([*u[k], 0.3]), z), np.eye(3), np.zeros(0), plan.t, times)
    np.testing.assert_allclose(run.X, X, atol=1e-10)
    np.testing.assert_allclose(run.at(1.2), lc.simulate("so3", plan, t=[0.0, 1.2]).X[-1], atol=1e-10)
    np.testing.assert_allclose(lc.simulate(plan, t=[1.0, 1.77], X0=X[2]).X[-1], X[3], atol=1e-10)
    with pytest.raises(lc.errors.InputError, match=r"known on \[0, 2\]"):
        lc.simulate(plan, t=[0, 3])


def test_forces_of_a_problem_fly_with_their_body() -> None:
    """I w' = I w x w - drag w + (0, 0, X31) + B u."""
    problem = lc.ocp(
        "so3", dynamics="second_order", duration=1.5, intervals=6, controls=["w1", "w2"], inertia=INERTIA, drag=DRAG, force=["0", "0", "X31"],
        stage_cost=["u"], terminal_cost=["xi1 - 1", "xi2"], integrator="midpoint",
    )  # fmt: skip
    plan = problem.solve(np.eye(3), xi=[0.1, -0.2, 0.3])
    times = np.array([0.4, 0.9, 1.5])

    def rates(k: int, t: float, X: Any, w: Any) -> tuple[Any, Any]:
        torque = np.cross(INERTIA * w, w) - DRAG * w + [0, 0, X[2, 0]] + [*np.asarray(plan.u)[k], 0]
        return SO3.hat(w), torque / INERTIA

    run = lc.simulate(plan, t=times, rtol=1e-9)
    X, w = integrated(rates, np.eye(3), np.array([0.1, -0.2, 0.3]), plan.t, times)
    np.testing.assert_allclose(run.X, X, atol=1e-8)
    np.testing.assert_allclose(run.xi, w, atol=1e-8)
    assert np.max(np.abs(plan.X[-1] - X[-1])) > 1e-6, "the problem's own steps are longer than these"
    np.testing.assert_allclose(run.at(0.9), X[1], atol=1e-8)


def test_velocities_and_states_of_ones_own_fly_in_a_free_time() -> None:
    """A car whose speed v is a state and whose steering goes with it: xi = (v u2, v, 0), v' = u1 - v^2/4."""
    problem = lc.ocp(
        "se2", duration=(1.0, 3.0), intervals=6, inputs={"u": 2}, states={"v": 1}, velocity=["v*u2", "v", "0"], rates={"v": ["u1 - v^2/4"]},
        stage_cost=["u"], terminal_cost=["4*(X13 - 1)", "4*X23", "2*(X21 - 1/2)"], name="own_car",
    )  # fmt: skip
    plan = problem.solve(np.eye(3), v=[0.2])
    times = plan.duration * np.array([0.0, 0.37, 1.0])

    def rates(k: int, t: float, X: Any, v: Any) -> tuple[Any, Any]:
        u = np.asarray(plan.u)[k]
        return SE2.hat([v[0] * u[1], v[0], 0]), u[:1] - v**2 / 4

    X, _ = integrated(rates, np.eye(3), np.array([0.2]), plan.t, times)
    np.testing.assert_allclose(lc.simulate(plan, t=times).X, X, atol=1e-9)
    turned = lc.build("se2").exp(np.array([1.0, 2.0, 3.0]))
    many = lc.simulate("se2", plan, t=times, X0=np.array([np.eye(3), turned])).X
    np.testing.assert_allclose(many, np.stack([X, turned @ X], axis=1), atol=1e-9)
    with pytest.raises(lc.errors.InputError, match="events goes with body velocities"):
        lc.simulate(plan, events=[lc.Event("X[0][2] - 1/2")])


@pytest.mark.parametrize("stored", [False, True])
def test_plans_of_wheels_fly(stored: bool) -> None:
    """Speeds make a body rate; torques of motors move body and wheels, whose momentum in space stays."""
    H = np.array([0.02, -0.01, 0.03]) if stored else np.zeros(3)
    wheels = lc.momentum_wheels(axes=np.eye(3), inertia=[2.0, 1.7, 1.2], wheel_inertia=0.05, stored=H)
    options: dict[str, Any] = {"intervals": 8, "starts": 2} if stored else {"method": "optimal"}
    plan = wheels.steer([0.3, 0.2, 0.1], 4.0, **options)
    times, J = np.array([0.5, 1.9, 4.0]), wheels.inertia

    def rates(k: int, t: float, X: Any, O: Any) -> tuple[Any, Any]:  # noqa: E741
        w = np.linalg.solve(J, X.T @ H - 0.05 * (O if stored else plan.speeds(t)))
        if not stored:
            return SO3.hat(w), O
        # j (O' + w') = torque, and J w' + j O' = (X^T H) x w
        torque = plan.torques((plan.plan.t[k] + plan.plan.t[k + 1]) / 2)
        w_dot = np.linalg.solve(J - 0.05 * np.eye(3), np.cross(X.T @ H, w) - torque)
        return SO3.hat(w), torque / 0.05 - w_dot

    edges = plan.plan.t if stored else np.array([0.0, 4.0])
    X, _ = integrated(rates, np.eye(3), plan.speeds(0.0), edges, times)
    run = lc.simulate(plan, t=times, rtol=1e-10)
    np.testing.assert_allclose(run.X, X, atol=1e-9)
    np.testing.assert_allclose(run.at(1.9), X[1], atol=1e-9)
    np.testing.assert_allclose(lc.simulate("so3", plan, t=times[1:], X0=X[1], rtol=1e-10).X, X[1:], atol=1e-9)
