"""What engineers add: quadrotor, integral action and limits, underwater terms, thruster allocation."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kernel_calls import interpreted
from package_program import run_example
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.control.attitude_law import attitude_law
from lie_codegen.control.closed_loop import closed_loop
from lie_codegen.control.force_limits import with_limits
from lie_codegen.control.integral_law import integral_law
from lie_codegen.control.reference_motion import formula_reference
from lie_codegen.control.tracking_law import tracking_law
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.groups.catalogue_load import group as load
from lie_codegen.vehicles.allocation import allocate, thruster_matrix
from lie_codegen.vehicles.allocation_kernels import allocation_kernel
from lie_codegen.vehicles.quadrotor import flat_reference, quadrotor_force, quadrotor_law
from lie_codegen.vehicles.underwater import compensated, underwater_forces, underwater_kernel, underwater_vehicle

QUAD = {"mass": 4.34, "inertia": [0.0820, 0.0845, 0.1377]}
QUAD_GAINS = {"k_x": 16 * 4.34, "k_v": 5.6 * 4.34, "k_R": 8.81, "k_W": 2.54}


def hat(w: np.ndarray) -> np.ndarray:
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def vee(S: np.ndarray) -> np.ndarray:
    return np.array([S[2, 1], S[0, 2], S[1, 0]])


def flown(t: float, X: np.ndarray, xi: np.ndarray, law, flat) -> tuple[float, np.ndarray]:
    thrust, moment, *_ = law(X, xi, *flat(t))
    return float(thrust[0]), moment


def test_quadrotor_commanded_rates_are_the_derivatives_of_the_commanded_attitude() -> None:
    """Omega_c from the law against differences of R_c along the closed loop, R_c rebuilt here in numpy."""
    law, flat = (
        interpreted(quadrotor_law(**QUAD, gains=QUAD_GAINS)),
        interpreted(flat_reference(["sin(t)", "t/2", "cos(2*t)"], "t/3")),
    )
    J, m, g = np.diag(QUAD["inertia"]), QUAD["mass"], 9.80665
    rng = np.random.default_rng(0)
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = expm(hat(0.4 * rng.normal(size=3))), rng.normal(size=3)
    xi = rng.normal(size=6)

    def commanded(t, x):
        R, p, v = x[:9].reshape(3, 3), x[9:12], x[12:15]
        ref = flat(t)
        A = (
            -QUAD_GAINS["k_x"] * (p - ref[0])
            - QUAD_GAINS["k_v"] * (v - ref[1])
            - m * g * np.array([0, 0, 1])
            + m * ref[2]
        )
        b3 = -A / np.linalg.norm(A)
        b2 = np.cross(b3, ref[5]) / np.linalg.norm(np.cross(b3, ref[5]))
        return np.column_stack([np.cross(b2, b3), b2, b3]), -A @ R[:, 2]

    def rate(t, x):
        R, v, W = x[:9].reshape(3, 3), x[12:15], x[15:]
        Y = np.eye(4)
        Y[:3, :3], Y[:3, 3] = R, x[9:12]
        f, M = flown(t, Y, np.concatenate([W, R.T @ v]), law, flat)
        accel = np.array([0, 0, g]) - f / m * R[:, 2]
        return np.concatenate([(R @ hat(W)).ravel(), v, accel, np.linalg.solve(J, M - np.cross(W, J @ W))])

    start = np.concatenate([X[:3, :3].ravel(), X[:3, 3], X[:3, :3] @ xi[3:], xi[:3]])
    run = solve_ivp(rate, (0.5, 0.7), start, rtol=1e-11, atol=1e-12, dense_output=True)
    t, h = 0.6, 1e-4

    def frame(s):
        return commanded(s, run.sol(s))[0]

    R_c, f = commanded(t, run.sol(t))
    first = (frame(t + h) - frame(t - h)) / (2 * h)
    W_c = vee(R_c.T @ first)
    W_c_dot = vee(
        (frame(t + h).T @ (frame(t + 2 * h) - frame(t)) - frame(t - h).T @ (frame(t) - frame(t - 2 * h))) / (4 * h * h)
    )
    x = run.sol(t)
    R, W = x[:9].reshape(3, 3), x[15:]
    Y = np.eye(4)
    Y[:3, :3], Y[:3, 3] = R, x[9:12]
    thrust, moment, Psi, body_rate = law(Y, np.concatenate([W, R.T @ x[12:15]]), *flat(t))
    assert thrust[0] == pytest.approx(f, rel=1e-12)
    np.testing.assert_allclose(body_rate, R.T @ R_c @ W_c, atol=2e-6)
    e_R, e_W = vee(R_c.T @ R - R.T @ R_c) / 2, W - R.T @ R_c @ W_c
    forward = J @ (hat(W) @ R.T @ R_c @ W_c - R.T @ R_c @ W_c_dot)
    by_hand = -QUAD_GAINS["k_R"] * e_R - QUAD_GAINS["k_W"] * e_W + np.cross(W, J @ W) - forward
    np.testing.assert_allclose(moment, by_hand, atol=1e-4)
    assert Psi[0] == pytest.approx(np.trace(np.eye(3) - R_c.T @ R) / 2)


def test_quadrotor_recovers_from_upside_down_and_follows() -> None:
    se3 = load("se3")
    law = quadrotor_law(**QUAD, gains=QUAD_GAINS)
    flat = flat_reference(["t/5", "sin(t)/4", "-cos(t)/4"], "t/10")
    X0 = np.diag([1.0, -0.9995, -0.9995, 1])
    X0[1, 2], X0[2, 1] = -0.0314107, 0.0314107
    X0[:3, :3] = np.linalg.qr(X0[:3, :3])[0] @ np.diag(np.sign(np.diag(np.linalg.qr(X0[:3, :3])[1])))
    run = closed_loop(
        se3, inertia=[*QUAD["inertia"], *[QUAD["mass"]] * 3], external=quadrotor_force(law, flat, mass=QUAD["mass"]),
        X0=X0, t=np.linspace(0, 8, 81), tolerance=1e-6,
    )  # fmt: skip
    end = np.array([8 / 5, np.sin(8) / 4, -np.cos(8) / 4])
    assert np.linalg.norm(run.X[-1, :3, 3] - end) < 1e-3
    assert run.X[0, 2, 2] < -0.99
    assert run.X[-1, 2, 2] > 0.99


def test_integral_action_removes_the_error_of_a_constant_disturbance() -> None:
    so3 = load("so3")
    gains = {"K_p": 6, "K_d": 6}
    disturbance, J = np.array([0.8, -0.5, 0.3]), np.diag([3.0, 2, 2])
    plain = interpreted(tracking_law(so3, inertia=J, error="so3_right", gains=gains))
    full = interpreted(integral_law(so3, inertia=J, error="so3_right", gains={**gains, "K_i": 4, "c": 1}))
    rest = (np.eye(3), np.zeros(3), np.zeros(3))

    def rate(law, with_integral):
        def f(_, x):
            R, w, s = x[:9].reshape(3, 3), x[9:12], x[12:]
            out = law(R, w, *rest, *([s] if with_integral else []))
            torque = out[0] + disturbance
            s_dot = out[1] if with_integral else 0 * s
            return np.concatenate([(R @ so3.hat(w)).ravel(), np.linalg.solve(J, torque - np.cross(w, J @ w)), s_dot])

        return f

    start = np.concatenate([expm(so3.hat([0.5, 0.2, -0.4])).ravel(), np.zeros(6)])
    ends = [
        solve_ivp(rate(law, kind), (0, 40), start, rtol=1e-9, atol=1e-11).y[:, -1]
        for law, kind in ((plain, False), (full, True))
    ]
    errors = [np.linalg.norm(end[:9].reshape(3, 3) - np.eye(3)) for end in ends]
    assert errors[0] > 0.05
    assert errors[1] < 1e-5
    np.testing.assert_allclose(4 * ends[1][12:], disturbance, atol=1e-4)  # K_i s balances it


def test_the_integral_law_in_the_compiled_loop_and_its_c(tmp_path: Path) -> None:
    """Against scipy, with a disturbance and limits that bite; and the C program drives itself to rest."""
    so3 = load("so3")
    J, gains = np.diag([3.0, 2, 2]), {"K_p": 8, "K_d": 6, "K_i": 4, "c": 1}
    disturbance, R0 = [0.8, -0.5, 0.3], expm(so3.hat([0.5, 0.2, -0.4]))
    law = integral_law(so3, inertia=J, error="so3_right", gains=gains, limits=3)
    still = formula_reference(so3, ["0", "0", "0"])
    run = lc.closed_loop(
        so3, inertia=J, law=law, reference=still, external=lambda *_: disturbance, X0=R0, t=np.linspace(0, 2, 9)
    )
    plain, rest = interpreted(law), (np.eye(3), np.zeros(3), np.zeros(3))

    def rate(_, x):
        R, w, s = x[:9].reshape(3, 3), x[9:12], x[12:]
        out = plain(R, w, *rest, s)
        w_dot = np.linalg.solve(J, out[0] + disturbance - np.cross(w, J @ w))
        return np.concatenate([(R @ so3.hat(w)).ravel(), w_dot, out[1]])

    start = np.concatenate([R0.ravel(), np.zeros(6)])
    end = solve_ivp(rate, (0, 2), start, method="DOP853", rtol=1e-11, atol=1e-12, max_step=0.01).y[:, -1]
    assert np.max(np.abs(run.outputs["force"])) == 3  # the limits bite
    np.testing.assert_allclose(run.X[-1].ravel(), end[:9], atol=1e-7)
    np.testing.assert_allclose(run.outputs["integral"][-1], end[12:], atol=1e-7)

    folder = lc.generate_closed_loop(so3, tmp_path / "loop", inertia=J, law=law, reference=still, X0=R0)
    run_example(folder, "so3", "closed_loop.c")


def test_laws_with_unknown_inputs_are_refused() -> None:
    so3 = load("so3")
    law = integral_law(so3, inertia=[3, 2, 2], error="so3_right", gains={"K_p": 8, "K_d": 6, "K_i": 4})
    odd = replace(law, outputs=tuple(p for p in law.outputs if p.name != "integral_dot"))
    with pytest.raises(InputError, match="z_dot"):
        lc.closed_loop(so3, inertia=[3, 2, 2], law=odd, t=[0, 1])


def test_anti_windup_shortens_the_overshoot_under_limits() -> None:
    so3 = load("so3")
    J, rest = np.diag([3.0, 2, 2]), (np.eye(3), np.zeros(3), np.zeros(3))
    base = {"K_p": 8, "K_d": 6, "K_i": 4, "c": 1}

    def overshoot(w):
        law = interpreted(integral_law(so3, inertia=J, error="so3_right", gains={**base, "w": w}, limits=0.4))

        def rate(_, x):
            left, _, right = np.linalg.svd(x[:9].reshape(3, 3))
            R, v, s = left @ right, x[9:12], x[12:]  # this integrator leaves the group, where the law gives NaN
            force, s_dot, *_ = law(R, v, *rest, s)
            assert np.max(np.abs(force)) <= 0.4 + 1e-15
            return np.concatenate([(R @ so3.hat(v)).ravel(), np.linalg.solve(J, force - np.cross(v, J @ v)), s_dot])

        start = np.concatenate([expm(so3.hat([0, 0, 1.5])).ravel(), np.zeros(6)])
        run = solve_ivp(rate, (0, 30), start, rtol=1e-7, atol=1e-9, max_step=0.05)
        return -np.min(np.arctan2(run.y[3], run.y[0]))

    assert overshoot(4) < 0.5 * overshoot("1/1000")


def test_limits_clip_the_first_output_and_nothing_else() -> None:
    law = attitude_law("pd", inertia=[3, 2, 2], k_p=4, k_d=6)
    clipped = interpreted(with_limits(law, [0.1, 0.2, 0.3]))
    R, w = expm(hat(np.array([1.0, -1, 0.01]))), np.zeros(3)
    torque, V, _ = clipped(R, w)
    free, V_free, _ = interpreted(law)(R, w)
    np.testing.assert_allclose(torque, np.clip(free, [-0.1, -0.2, -0.3], [0.1, 0.2, 0.3]))
    assert V_free == V
    with pytest.raises(InputError, match="must be positive"):
        with_limits(law, [1, 0, 1])
    with pytest.raises(ShapeError, match="2 limits for 3"):
        with_limits(law, [1, 1])


def vehicle(**changes):
    given = {
        "inertia": [2, 3, 4, 10, 10, 10], "added": [1, 1, 2, 2, 6, 8], "linear_damping": [1, 1, 1, 2, 4, 4],
        "quadratic_damping": [1, 1, 1, 3, 5, 5], "weight": 98.1, "buoyancy": 100, "r_G": [0, 0, 0.1], "r_B": [0, 0, -0.05],
    }  # fmt: skip
    return underwater_vehicle(load("se3"), **(given | changes))


def test_a_current_is_a_galilean_boost() -> None:
    """The motion in a current c is that in still water seen from a frame moving with -c: R equal, p shifted by c t."""
    se3 = load("se3")
    c = np.array([0.3, -0.2, 0.1])
    moving, still = vehicle(current=c.tolist()), vehicle()
    X0 = expm(se3.hat([0.3, -0.2, 0.5, 1, 0, 0]))
    xi0 = np.array([0.1, 0.2, -0.3, 0.5, 0.1, 0])
    slow = xi0 - np.concatenate([np.zeros(3), X0[:3, :3].T @ c])
    inertia = np.array(moving.inertia.tolist(), dtype=float)
    t = np.linspace(0, 3, 7)
    a = closed_loop(se3, inertia=inertia, external=underwater_forces(moving), X0=X0, xi0=xi0, t=t, tolerance=1e-8)
    b = closed_loop(se3, inertia=inertia, external=underwater_forces(still), X0=X0, xi0=slow, t=t, tolerance=1e-8)
    np.testing.assert_allclose(a.X[:, :3, :3], b.X[:, :3, :3], atol=1e-6)
    np.testing.assert_allclose(a.X[:, :3, 3], b.X[:, :3, 3] + t[:, None] * c, atol=1e-6)


def test_restoring_forces_and_damping_by_hand() -> None:
    se3 = load("se3")
    X, xi = expm(se3.hat([0.3, -0.2, 0.5, 1, 0, 0])), np.array([0.1, 0.2, -0.3, 0.5, 0.1, 0])
    force = interpreted(underwater_kernel(vehicle()))(X, xi)[0]
    down = X[:3, :3].T @ [0, 0, 1]
    torque = np.cross([0, 0, 0.1], 98.1 * down) + np.cross([0, 0, -0.05], -100 * down)
    drag = np.array([1, 1, 1, 2, 4, 4]) * xi + np.array([1, 1, 1, 3, 5, 5]) * np.abs(xi) * xi
    np.testing.assert_allclose(force, np.concatenate([torque, -1.9 * down]) - drag, atol=1e-12)


def test_a_vehicle_in_a_current_tracks_with_its_forces_compensated() -> None:
    se3 = load("se3")
    auv = vehicle(current=[0.3, -0.2, 0.1])
    inertia = np.array(auv.inertia.tolist(), dtype=float)
    law = tracking_law(se3, inertia=inertia, error="se3_2", gains={"K_1": 30, "K_2": 30, "K_d": 40})
    reference = formula_reference(se3, ["0", "0", "t/5", "t/2", "sin(t/2)", "0"])
    run = closed_loop(
        se3, inertia=inertia, law=compensated(law, auv), reference=reference, external=underwater_forces(auv),
        X0=expm(se3.hat([0.5, 0, 1, 1, -1, 0.5])), t=np.linspace(0, 20, 41), tolerance=1e-6,
    )  # fmt: skip
    assert run.outputs["W"][-1] < 1e-6 * run.outputs["W"][0]


def test_wrong_vehicles_are_refused() -> None:
    with pytest.raises(InputError, match="would drive the vehicle"):
        vehicle(linear_damping=[1, 1, 1, -1, 1, 1])
    with pytest.raises(InputError, match="inertia \\+ added is not positive definite"):
        vehicle(added=-20)
    with pytest.raises(InputError, match="needs the gains k_x, k_v, k_R, k_W"):
        quadrotor_law(**QUAD, gains={"k_x": 1})
    with pytest.raises(InputError, match="three formulas"):
        flat_reference(["t", "t"])


def test_allocation_reproduces_the_force_with_the_least_effort() -> None:
    rng = np.random.default_rng(0)
    B = thruster_matrix(rng.normal(size=(8, 3)), rng.normal(size=(8, 3)))
    prices = rng.uniform(1, 3, size=8)
    kernel = interpreted(allocation_kernel(allocate(B, weights=prices)))
    f = rng.normal(size=6)
    u, residual = kernel(f)
    np.testing.assert_allclose(B @ u, f, atol=1e-12)
    np.testing.assert_allclose(residual, 0, atol=1e-12)
    for null in np.linalg.svd(B)[2][6:]:
        assert abs(null @ (prices * u)) < 1e-12  # stationary: orthogonal to what has no effect


def test_one_sided_jets_push_only_and_say_what_is_left_undone() -> None:
    arms = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)
    sides = np.roll(arms, 1, axis=1) * 1.0
    positions, directions = np.vstack([arms, arms]), np.vstack([sides, -sides])
    B = thruster_matrix(positions, directions)[:3]
    allocation = allocate(B, one_sided=True)
    kernel = interpreted(allocation_kernel(allocation, limits=1, namespace="so3"))
    rng = np.random.default_rng(1)
    for f in rng.normal(size=(20, 3)):
        u, residual = kernel(0.2 * f)
        assert np.all(u >= -1e-15)
        np.testing.assert_allclose(B @ u + residual, 0.2 * f, atol=1e-14)
        np.testing.assert_allclose(residual, 0, atol=1e-13)
    assert np.max(np.abs(kernel([100, 0, 0])[1])) > 1
    with pytest.raises(InputError, match="out of reach"):
        allocate(np.eye(3), one_sided=True)
    with pytest.raises(InputError, match="span 2 of 3"):
        allocate(np.eye(3)[:, :2])
