"""Attitude laws about a desired attitude that moves, matrix gains, and laws with states of every kind, against scipy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import lie_codegen as lc
from lie_codegen.errors import InputError

J = np.array([[1.5, 0.1, 0], [0.1, 1.25, 0.2], [0, 0.2, 1.75]])
K = np.array([[3, 0.2, 0], [0.2, 2, 0.1], [0, 0.1, 4]])
D = np.array([[2, 0.1, 0], [0.1, 3, 0], [0, 0, 2.5]])
START = Rotation.from_rotvec([0.5, -0.4, 0.9]).as_matrix()
T = np.linspace(0, 2, 9)


def hat(w: Any) -> np.ndarray:
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def turning(t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """X_d = exp(.4 sin t e_1) exp(t/5 e_3) and its body velocity and acceleration, by hand."""
    a, b = Rotation.from_rotvec([0.4 * np.sin(t), 0, 0]).as_matrix(), Rotation.from_rotvec([0, 0, t / 5]).as_matrix()
    first, rate, turn = np.array([0.4, 0, 0]), np.cos(t), np.array([0, 0, 0.2])
    xi = b.T @ first * rate + turn
    return a @ b, xi, b.T @ first * -np.sin(t) - np.cross(turn, b.T @ first * rate)


STEP = 1e-5
STEPS = Rotation.from_rotvec(STEP * np.vstack([np.eye(3), -np.eye(3)])).as_matrix()


def gradient(E: np.ndarray) -> np.ndarray:
    """Of theta' K theta/2 along E exp(s e_i), by central differences of scipy's rotation vectors."""
    theta = Rotation.from_matrix(E @ STEPS).as_rotvec()
    phi = np.einsum("ki,ij,kj->k", theta, K, theta) / 2
    return (phi[:3] - phi[3:]) / (2 * STEP)


@pytest.mark.parametrize("gyroscopic", ["cancel", "none", "double"])
def test_a_torque_about_a_moving_attitude(gyroscopic: str) -> None:
    law = lc.attitude_law("pd", inertia=J, k_p=K.tolist(), k_d=D.tolist(), gyroscopic=gyroscopic)
    reference = lc.reference("so3", ["0.4*sin(t)", "0", "t/5"])
    reordered = lc.reference("so3", ["0.4*sin(t)", 0, "t/5"])
    assert reference == reordered
    run = lc.closed_loop("so3", inertia=J, law=law, reference=reference, X0=START, xi0=[0.4, 0, 0.3], t=T, rtol=1e-10)
    factor = {"cancel": 1, "none": 0, "double": -1}[gyroscopic]

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        X, w = y[:9].reshape(3, 3), y[9:]
        X_d, xi_d, xi_d_dot = turning(t)
        E = X_d.T @ X
        nu = E.T @ xi_d
        e = w - nu
        torque = factor * np.cross(e, J @ w) - gradient(E) - D @ e + np.cross(nu, J @ w)
        torque = torque + J @ (E.T @ xi_d_dot - np.cross(e, nu))
        return np.concatenate([(X @ hat(w)).ravel(), np.linalg.solve(J, np.cross(J @ w, w) + torque)])

    want = solve_ivp(rate, (0, 2), [*START.ravel(), 0.4, 0, 0.3], t_eval=T, rtol=1e-8, atol=1e-9).y.T
    np.testing.assert_allclose(run.X, want[:, :9].reshape(-1, 3, 3), atol=3e-6)
    np.testing.assert_allclose(run.xi, want[:, 9:], atol=3e-6)
    fine = lc.closed_loop(
        "so3", inertia=J, law=law, reference=reference, X0=START, t=np.linspace(0, 1, 2001), step=5e-4
    )
    V, V_dot = fine.outputs["V"], fine.outputs["V_dot"]
    slope = (V[:-4] - 8 * V[1:-3] + 8 * V[3:-1] - V[4:]) / (12 * 5e-4)
    np.testing.assert_allclose(slope, V_dot[2:-2], atol=1e-8)


@pytest.mark.parametrize(("kind", "k_p"), [("p", 2), ("reduced", 2)])
def test_a_velocity_about_a_moving_attitude(kind: str, k_p: Any) -> None:
    """theta(t) = theta(0) e^{-k t}, whatever the reference does; the reduced law turns its direction alone."""
    law = lc.attitude_law(kind, k_p=k_p, z=(0, 3, 4))
    run = lc.closed_loop("so3", law=law, reference=["0.4*sin(t)", 0, "t/5"], X0=START, t=T, rtol=1e-11)
    if kind == "p":
        theta = Rotation.from_matrix(START).as_rotvec()
        error = Rotation.from_rotvec(np.exp(-2 * T)[:, None] * theta).as_matrix()
    else:
        z = np.array([0, 0.6, 0.8])
        y = START.T @ z
        axis, angle = np.cross(z, y) / np.linalg.norm(np.cross(z, y)), np.arccos(y @ z)
        error = START @ Rotation.from_rotvec(angle * (1 - np.exp(-2 * T))[:, None] * axis).as_matrix()
    want = np.array([turning(t)[0] for t in T]) @ error
    np.testing.assert_allclose(run.X, want, atol=1e-9)
    assert run.X_d is not None
    np.testing.assert_allclose(run.X_d, [turning(t)[0] for t in T], atol=1e-14)
    tracking = lc.attitude_law("p", k_p=2, tracking=True)
    assert [port.name for port in tracking.inputs] == ["X", "X_d", "xi_d"]
    if kind == "p":
        again = lc.closed_loop("so3", law=tracking, reference=["0.4*sin(t)", 0, "t/5"], X0=START, t=T, rtol=1e-11)
        np.testing.assert_allclose(again.X, run.X, atol=1e-10)


def test_matrix_gains_as_numbers_of_each_loop() -> None:
    law = lc.attitude_law("pd", inertia=J, k_p=K, k_d=D, tunable=True)
    assert [port.shape for port in law.inputs[2:]] == [(3, 3)] * 3
    gains = {"k_p": np.array([K, 2 * K]), "k_d": D}
    many = lc.closed_loop("so3", inertia=J, law=law, gains=gains, X0=START, t=T)
    for i, factor in enumerate((1, 2)):
        one = lc.closed_loop(
            "so3", inertia=J, law=lc.attitude_law("pd", inertia=J, k_p=factor * K, k_d=D), X0=START, t=T
        )
        np.testing.assert_allclose(many.X[:, i], one.X, atol=1e-9)
    with pytest.raises(InputError, match="k_p of loop 1 is not symmetric positive definite"):
        lc.closed_loop("so3", inertia=J, law=law, gains={"k_p": np.array([K, -K]), "k_d": D}, t=T)
    with pytest.raises(InputError, match="not positive definite"):
        lc.attitude_law("pd", inertia=J, k_p=-K, k_d=1)


def kinds() -> lc.Kernel:
    """A law with a state of each kind: an integral, a filter on the group, and a switch with hysteresis."""
    ports = (
        lc.Port("X", (3, 3)),
        lc.Port("omega", (3,)),
        lc.Port("z", (3,)),
        lc.Port("X_hat", (3, 3)),
        lc.Port("q", ()),
    )

    def body(ops: Any, X: Any, w: Any, z: Any, X_hat: Any, q: Any) -> Any:
        A = [[sum(X_hat[k][i] * X[k][j] - X[k][i] * X_hat[k][j] for k in range(3)) for j in range(3)] for i in range(3)]
        late = [A[2][1] / 2, A[0][2] / 2, A[1][0] / 2]
        up = ops.where(ops.less(X[2][2], 0.85), 1.0 + 0 * q, q)
        switched = ops.where(ops.less(0.915, X[2][2]), -1.0 + 0 * q, up)
        force = [
            -2 * X[2][1] - 2 * w[0] - z[0] + 0.1 * switched,
            -late[1] - 2 * w[1] - z[1],
            -late[2] - 2 * w[2] - z[2],
        ]
        return force, [a + b / 2 for a, b in zip(w, late, strict=True)], [3 * x for x in late], switched

    outputs = (lc.Port("force", (3,)), lc.Port("z_dot", (3,)), lc.Port("u_hat", (3,)), lc.Port("q_next", ()))
    return lc.Kernel("kinds", "so3", ports, outputs, body)


def evaluated(X: np.ndarray, w: np.ndarray, z: np.ndarray, X_hat: np.ndarray, q: float) -> Any:
    A = X_hat.T @ X - X.T @ X_hat
    late = np.array([A[2, 1], A[0, 2], A[1, 0]]) / 2
    q = -1.0 if X[2, 2] > 0.915 else 1.0 if X[2, 2] < 0.85 else q
    force = np.array([-2 * X[2, 1] - 2 * w[0] - z[0] + 0.1 * q, -late[1] - 2 * w[1] - z[1], -late[2] - 2 * w[2] - z[2]])
    return force, w + late / 2, 3 * late, q


@pytest.mark.parametrize("step", [0.05, 0.01])
def test_a_law_with_states_of_every_kind_sampled(step: float) -> None:
    tilt = Rotation.from_rotvec([0.1, 0.6, -0.2]).as_matrix()
    run = lc.closed_loop(
        "so3", inertia=J, law=kinds(), X0=START, xi0=[0.1, 0, 0.2], t=np.arange(121) * 0.05, sample=0.05, step=step,
        states={"X_hat": tilt, "q": 1.0},
    )  # fmt: skip
    X, w, z, X_hat, q = START, np.array([0.1, 0, 0.2]), np.zeros(3), tilt, 1.0
    for i in range(121):
        force, z_dot, u_hat, q = evaluated(X, w, z, X_hat, q)
        np.testing.assert_allclose(run.X[i], X, atol=1e-5)
        np.testing.assert_allclose(run.states["X_hat"][i], X_hat, atol=1e-5)
        np.testing.assert_allclose(run.states["z"][i], z, atol=1e-5)
        assert run.states["q"][i] == q
        assert run.u is not None
        np.testing.assert_allclose(run.u[i], force, atol=1e-5)

        def rate(_: float, y: np.ndarray, f: np.ndarray = force) -> np.ndarray:
            v = y[9:]
            return np.concatenate([(y[:9].reshape(3, 3) @ hat(v)).ravel(), np.linalg.solve(J, np.cross(J @ v, v) + f)])

        y = solve_ivp(rate, (0, 0.05), [*X.ravel(), *w], rtol=1e-11, atol=1e-12).y[:, -1]
        X, w = y[:9].reshape(3, 3), y[9:]
        z, X_hat = z + 0.05 * z_dot, X_hat @ Rotation.from_rotvec(0.05 * u_hat).as_matrix()
    assert len(set(run.states["q"].tolist())) == 2


def test_a_law_with_states_of_every_kind_continuous() -> None:
    """Between two switches the motion is smooth: scipy with the same switch, from the same start."""
    options: dict[str, Any] = {"inertia": J, "law": kinds(), "X0": START, "xi0": [0.1, 0, 0.2], "states": {"q": 1.0}}
    run = lc.closed_loop("so3", **options, t=np.linspace(0, 0.5, 6), rtol=1e-10)

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        X, w, z, X_hat = y[:9].reshape(3, 3), y[9:12], y[12:15], y[15:].reshape(3, 3)
        force, z_dot, u_hat, _ = evaluated(X, w, z, X_hat, 1.0)
        turn = np.linalg.solve(J, np.cross(J @ w, w) + force)
        return np.concatenate([(X @ hat(w)).ravel(), turn, z_dot, (X_hat @ hat(u_hat)).ravel()])

    start = [*START.ravel(), 0.1, 0, 0.2, 0, 0, 0, *np.eye(3).ravel()]
    want = solve_ivp(rate, (0, 0.5), start, t_eval=run.t, rtol=1e-11, atol=1e-12, method="DOP853").y.T
    assert set(run.states["q"].tolist()) == {1.0}
    np.testing.assert_allclose(run.X, want[:, :9].reshape(-1, 3, 3), atol=1e-8)
    np.testing.assert_allclose(run.states["z"], want[:, 12:15], atol=1e-8)
    np.testing.assert_allclose(run.states["X_hat"], want[:, 15:].reshape(-1, 3, 3), atol=1e-8)


def test_an_element_is_a_reference_at_rest_and_the_order_may_be_said() -> None:
    law = lc.attitude_law("pd", inertia=J, k_p=2, k_d=3)
    here = Rotation.from_rotvec([0.2, -0.1, 0.5]).as_matrix()
    run = lc.closed_loop("so3", inertia=J, law=law, reference=here, X0=here @ START, t=T)
    same = lc.closed_loop("so3", inertia=J, law=law, X0=START, t=T)
    np.testing.assert_allclose(run.X, here @ same.X, atol=1e-9)
    np.testing.assert_allclose(run.error, same.error, atol=1e-9)

    def body(ops: Any, X: Any) -> Any:
        return ([X[1][2] - X[2][1], X[2][0] - X[0][2], X[0][1] - X[1][0]],)

    silent = lc.Kernel("silent", "so3", (lc.Port("X", (3, 3)),), (lc.Port("command", (3,)),), body)
    with pytest.raises(InputError, match="a velocity or a force"):
        lc.closed_loop("so3", law=silent, X0=START, t=T)
    first = lc.closed_loop("so3", law=silent, X0=START, t=T, order=1)
    np.testing.assert_allclose(
        first.X, lc.simulate("so3", ["X23 - X32", "X31 - X13", "X12 - X21"], X0=START, t=T).X, atol=1e-9
    )
    assert lc.closed_loop("so3", law=silent, inertia=J, X0=START, t=T, order=2).group is not None
    with pytest.raises(InputError, match="order = 1, and the law attitude_pd"):
        lc.closed_loop("so3", inertia=J, law=law, t=T, order=1)
    with pytest.raises(InputError, match="order is 1"):
        lc.closed_loop("so3", inertia=J, law=law, t=T, order=3)
