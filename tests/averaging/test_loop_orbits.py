"""Floquet multipliers of closed loops on matrix groups, against SciPy's flow of the same motion and closed forms."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.control.reference_kernels import reference_kernel
from lie_codegen.errors import ComputationError, InputError, PeriodError

INERTIA = np.array([[2, 0.3, -0.2], [0.3, 1.5, 0.1], [-0.2, 0.1, 1]])


def hat(x):
    return np.array([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]])


def vee(A):
    return np.array([A[2, 1] - A[1, 2], A[0, 2] - A[2, 0], A[1, 0] - A[0, 1]]) / 2


def pushed_home(ops, X, t):
    """u = -k_i vee(skew X)_i + a drive of period 2 pi."""
    s = [(X[2][1] - X[1][2]) / 2, (X[0][2] - X[2][0]) / 2, (X[1][0] - X[0][1]) / 2]
    drive = (0.5 * ops.sin(t), 0.3 * ops.cos(2 * t), 0.1 + 0.4 * ops.cos(t))
    return ([d - g * x for d, g, x in zip(drive, (0.6, 0.5, 0.7), s, strict=True)],)


def home_law():
    return lc.Kernel("home", "so3", (lc.Port("X", (3, 3)), lc.Port("t", ())), (lc.Port("u", (3,)),), pushed_home)


def test_a_driven_velocity_on_rotations():
    """Monodromy and orbit against SciPy in the nine entries of X, differenced along X exp(hat(e_a))."""
    run = lc.closed_loop("so3", law=home_law(), X0=expm(hat([0.2, -0.1, 0.3])), t=np.linspace(0, 40, 5), order=1)
    orbit = lc.floquet(run, period="2*pi")

    def flow(X):
        def rate(t, x):
            X = x.reshape(3, 3)
            drive = np.array([0.5 * np.sin(t), 0.3 * np.cos(2 * t), 0.1 + 0.4 * np.cos(t)])
            return (X @ hat(drive - np.array([0.6, 0.5, 0.7]) * vee(X))).ravel()

        span = (orbit.t0, orbit.t0 + 2 * np.pi)
        return solve_ivp(rate, span, X.ravel(), method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1].reshape(3, 3)

    end = flow(orbit.X)
    np.testing.assert_allclose(end, orbit.X, atol=1e-11)
    step = 1e-5
    columns = [
        vee(end.T @ (flow(orbit.X @ expm(step * hat(e))) - flow(orbit.X @ expm(-step * hat(e))))) / (2 * step)
        for e in np.eye(3)
    ]
    np.testing.assert_allclose(orbit.monodromy, np.stack(columns, axis=1), atol=1e-8)
    assert orbit.stable
    assert not orbit.autonomous
    assert orbit.trivial is None


def test_a_body_that_tracks_against_a_periodic_disturbance():
    """Order 2: SciPy integrates Euler's equations with the law's compiled force."""
    law = lc.tracking_law(
        "so3", inertia=INERTIA, error="so3_right", gains={"K_p": np.diag([4, 5, 6.0]), "K_d": np.diag([1, 0.4, 0.5])}
    )
    texts = ["0.8*sin(t)", "0.4*cos(2*t)", "0.3*sin(t) + 0.2"]
    reference = lc.reference("so3", texts)
    run = lc.closed_loop(
        "so3", law=law, inertia=INERTIA, reference=reference, t=[0, 20], disturbance=["0.3*sin(t)", "0.2", "0"]
    )
    orbit = lc.floquet(run, period="2*pi")
    target = reference_kernel(reference)
    library = lc.build([law, target])
    compiled, follows = library[law.name], library[target.name]

    def flow(X, xi):
        def rate(t, x):
            X, w = x[:9].reshape(3, 3), x[9:]
            given = dict(zip(("X_d", "xi_d", "xi_d_dot"), follows(t), strict=True))
            command = compiled(X=X, xi=w, **given)
            force = np.asarray(command[0] if isinstance(command, tuple) else command)
            momentum = INERTIA @ w
            turned = np.cross(momentum, w) + force + np.array([0.3 * np.sin(t), 0.2, 0])
            return np.concatenate([(X @ hat(w)).ravel(), np.linalg.solve(INERTIA, turned)])

        span = (orbit.t0, orbit.t0 + 2 * np.pi)
        return solve_ivp(rate, span, [*X.ravel(), *xi], method="DOP853", rtol=1e-10, atol=1e-11).y[:, -1]

    end = flow(orbit.X, orbit.xi)
    np.testing.assert_allclose(end, [*orbit.X.ravel(), *orbit.xi], atol=1e-9)
    step, columns = 1e-5, []
    for e in np.eye(6)[[0, 4]]:  # a turn and a velocity
        ends = [flow(orbit.X @ expm(s * hat(e[:3])), orbit.xi + s * e[3:]) for s in (step, -step)]
        moved = (ends[0] - ends[1]) / (2 * step)
        columns.append(np.concatenate([vee(orbit.X.T @ moved[:9].reshape(3, 3)), moved[9:]]))
    np.testing.assert_allclose(orbit.monodromy[:, [0, 4]], np.stack(columns, axis=1), atol=1e-7)


def circling(ops, X):
    """On SE(2): the position goes by van der Pol's equation in the plane, the heading to zero: u = R^T p', -sin(theta)."""
    x, y = X[0][2], X[1][2]
    speed = (y, -x + ops.constant(1) / 2 * (1 - x * x) * y)
    return ([-X[1][0], X[0][0] * speed[0] + X[1][0] * speed[1], -X[1][0] * speed[0] + X[0][0] * speed[1]],)


def test_an_autonomous_limit_cycle_on_a_group():
    """Period and multiplier of van der Pol's equation (published to 12 and 9 digits), and exp(-T) of the heading."""
    law = lc.Kernel("circling", "se2", (lc.Port("X", (3, 3)),), (lc.Port("u", (3,)),), circling)
    start = np.array([[np.cos(0.3), -np.sin(0.3), 2.2], [np.sin(0.3), np.cos(0.3), 0.1], [0, 0, 1]])
    orbit = lc.floquet(lc.closed_loop("se2", law=law, X0=start, t=[0, 5], order=1))
    assert orbit.autonomous
    assert orbit.period == pytest.approx(6.380675801774, abs=1e-10)
    np.testing.assert_allclose(orbit.multipliers, [1, 0.0391769202, np.exp(-orbit.period)], atol=1e-9)
    assert orbit.trivial_error < 1e-9
    assert orbit.stable
    np.testing.assert_allclose(orbit.X[:2, :2], np.eye(2), atol=1e-10)


def unitary(ops, X, t):
    """The same law of SO(3), read off an element of SU(2) with the basis -i sigma / 2: of its quaternion (a, b, c, d)."""
    a, b, c, d = X[0][0].re, -X[0][1].im, -X[0][1].re, -X[0][0].im
    s = (2 * a * b, 2 * a * c, 2 * a * d)
    drive = (0.5 * ops.sin(t), 0.3 * ops.cos(2 * t), 0.1 + 0.4 * ops.cos(t))
    return ([e - g * x for e, g, x in zip(drive, (0.6, 0.5, 0.7), s, strict=True)],)


def test_a_complex_group():
    """SU(2) covers SO(3): where an orbit closes in both, the multipliers are the same."""
    ports = (lc.Port("X", (2, 2), is_complex=True), lc.Port("t", ()))
    law = lc.Kernel("unitary", "su2", ports, (lc.Port("u", (3,)),), unitary)
    known = lc.floquet(lc.closed_loop("so3", law=home_law(), t=np.linspace(0, 40, 5), order=1), period="2*pi")
    orbit = lc.floquet(lc.closed_loop("su2", law=law, t=np.linspace(0, 40, 5), order=1), period="2*pi")
    np.testing.assert_allclose(orbit.multipliers, known.multipliers, atol=1e-10)


def test_the_law_s_own_states_are_part_of_it():
    """An integral law under a constant force: its integral moves on, and its slowest multiplier is that of a long run."""
    law = lc.integral_law("so3", inertia=INERTIA, error="so3_right", gains={"K_p": 4 * np.eye(3), "K_d": 3 * np.eye(3), "K_i": 0.8 * np.eye(3)})  # fmt: skip
    given = {
        "law": law,
        "inertia": INERTIA,
        "reference": ["0.3*sin(t)", "0", "0.2*cos(t)"],
        "disturbance": [0.1, 0.2, -0.1],
    }
    orbit = lc.floquet(lc.closed_loop("so3", **given, t=np.linspace(0, 30, 4)), period="2*pi")
    assert orbit.monodromy.shape == (9, 9)
    (name, value), *_ = orbit.states.items()
    period = 2 * np.pi
    t = orbit.t0 + period * np.arange(6)
    run = lc.closed_loop(
        "so3", **given, t=t, X0=orbit.X @ expm(hat([1e-4, 2e-4, -1e-4])), xi0=orbit.xi, states={name: value}
    )
    off = np.linalg.norm(run.states[name] - value, axis=1)
    assert off[5] / off[4] == pytest.approx(abs(orbit.multipliers[0]), rel=0.02)


def test_what_has_no_linearised_flow_is_refused():
    with pytest.raises(PeriodError, match="give its period"):
        lc.floquet(lc.closed_loop("so3", law=home_law(), t=[0, 1], order=1))
    run = lc.closed_loop("so3", law=home_law(), t=[0, 1], order=1)
    with pytest.raises(PeriodError, match="is not f"):
        lc.floquet(run, period=3.0)
    with pytest.raises(InputError, match="last state is the guess"):
        lc.floquet(run, guess=np.eye(3), period="2*pi")
    with pytest.raises(InputError, match="knows its law only"):
        lc.floquet(pickle.loads(pickle.dumps(run)), period="2*pi")
    with pytest.raises(InputError, match="many loops"):
        lc.floquet(lc.closed_loop("so3", law=home_law(), t=[0, 1], order=1, X0=np.stack([np.eye(3)] * 2)), period=1)
    with pytest.raises(InputError, match="sampled"):
        lc.floquet(lc.closed_loop("so3", law=home_law(), t=[0, 1], order=1, sample=0.1), period="2*pi")
    rest = lc.attitude_law("pd", inertia=INERTIA, k_p=4, k_d=3)
    with pytest.raises((InputError, ComputationError), match="equilibrium"):
        lc.floquet(lc.closed_loop(law=rest, inertia=INERTIA, t=[0, 60]))
