"""A law whose damping is shortened where actuators are weak: W still falls, and the certificate covers the loop."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

import lie_codegen as lc
from lie_codegen.errors import InputError, ShapeError

INERTIA = np.array([[2, 0.3, -0.2], [0.3, 1.5, 0.1], [-0.2, 0.1, 1]])
K_D = np.array([[3, 1, 0.5], [1, 4, -1], [0.5, -1, 5]])
LOOP: dict[str, Any] = {"inertia": INERTIA, "error": "so3_right", "gains": {"K_p": [4, 5, 6], "K_d": K_D}}
LIMITS = np.array([0.4, 0.7, 1.0])
ZERO = np.zeros(3)


def hat(w: Any) -> Any:
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def test_the_direction_stays_and_every_component_is_within_its_limit() -> None:
    free = lc.build(lc.tracking_law("so3", **LOOP)).tracking_law
    bounded = lc.build(lc.tracking_law("so3", **LOOP, damping_limits=LIMITS)).tracking_law
    rng = np.random.default_rng(3)
    for _ in range(50):
        X, X_d = Rotation.random(2, random_state=rng).as_matrix()
        xi, xi_d, xi_d_dot = rng.normal(size=(3, 3))
        wanted = K_D @ (xi - X.T @ X_d @ xi_d)
        share = min(1, float(np.min(LIMITS / np.abs(wanted))))
        plain, kept = free(X, xi, X_d, xi_d, xi_d_dot), bounded(X, xi, X_d, xi_d, xi_d_dot)
        np.testing.assert_allclose(kept.force - plain.force, (1 - share) * wanted, atol=1e-12)
        assert kept.W_dot == pytest.approx(share * plain.W_dot, rel=1e-12)
        assert (kept.phi, kept.W) == (plain.phi, plain.W)


def test_as_inputs_they_are_the_same_law() -> None:
    fixed = lc.build(lc.tracking_law("so3", **LOOP, damping_limits=LIMITS)).tracking_law
    tuned = lc.build(lc.tracking_law("so3", **LOOP, damping_limits="input")).tracking_law
    state = (expm(hat([0.5, -1, 0.8])), [1, -2, 0.5], np.eye(3), ZERO, ZERO)
    np.testing.assert_allclose(tuned(*state, LIMITS).force, fixed(*state).force, atol=1e-14)
    np.testing.assert_allclose(
        lc.build(lc.tracking_law("so3", **LOOP, damping_limits=0.5)).tracking_law(*state).force,
        tuned(*state, [0.5, 0.5, 0.5]).force,
        atol=1e-14,
    )


@pytest.mark.parametrize("level", [2.0, 5.0])
def test_no_loop_leaves_its_certificate(level: float) -> None:
    """Against an integration by other means, whose right-hand side shares nothing with the law."""
    cert = lc.certificate(
        "so3", law=lc.tracking_law("so3", **LOOP, damping_limits=LIMITS), level=level, overshoot=2.0, prove=False
    )
    wanted = np.sqrt(2 * level * np.diag(K_D @ np.linalg.inv(INERTIA) @ K_D))
    assert cert.damping_share == pytest.approx(np.min(LIMITS / wanted), rel=1e-12)
    assert 0 < cert.rate < lc.certificate("so3", **LOOP, level=level, overshoot=2.0, prove=False).rate
    A = 15 * np.eye(3) - np.diag([4.0, 5, 6])
    rng = np.random.default_rng(7)

    def slope(_: float, y: Any) -> Any:
        R, w = y[:9].reshape(3, 3), y[9:]
        K = np.diag([4.0, 5, 6])
        skew = (K @ R - R.T @ K) / 2
        push = -np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
        damping = K_D @ w
        damping *= min(1, float(np.min(LIMITS / np.maximum(np.abs(damping), 1e-300))))
        # levi_civita and basic feedforward vanish for a reference at rest
        return np.concatenate(
            [(R @ hat(w)).ravel(), np.linalg.solve(INERTIA, np.cross(INERTIA @ w, w) + push - damping)]
        )

    def energy(y: Any) -> float:
        R, w = y[:9].reshape(3, 3), y[9:]
        return float(np.trace(np.diag([4.0, 5, 6]) @ (np.eye(3) - R)) / 2 + w @ INERTIA @ w / 2)

    assert np.all(np.linalg.eigvalsh(A) > 0)
    for _ in range(6):
        w = rng.normal(size=3)
        w *= np.sqrt(2 * rng.uniform(0.2, 0.95) * level / (w @ INERTIA @ w))
        axis = rng.normal(size=3)
        R = expm(hat(0.1 * axis))
        start = np.concatenate([R.ravel(), w])
        if energy(start) > level:
            start[9:] *= 0.5
        W0 = energy(start)
        assert cert.inside(R, start[9:], np.eye(3), ZERO) is True
        times = np.linspace(0, 12, 25)
        run = solve_ivp(slope, (0, 12), start, t_eval=times, rtol=1e-8, atol=1e-10)
        assert run.success
        W = np.array([energy(y) for y in run.y.T])
        assert np.all(np.diff(W) <= 1e-9)
        assert np.all(cert.k * W0 * np.exp(-cert.rate * times) * (1 + 1e-6) >= W)


def test_what_the_proportional_part_asks() -> None:
    """phi = k (1 - cos a) has |d phi| = k sin a about any axis: k sqrt(1 - (1 - level/k)^2), and k from a quarter turn on."""
    for level, largest in ((1.5, 3 * np.sqrt(0.75)), (3.0, 3.0), (5.0, 3.0)):
        cert = lc.certificate("so3", inertia=1, error="so3_right", gains={"K_p": 3, "K_d": 4}, level=level, prove=False)
        np.testing.assert_allclose(cert.proportional, largest, rtol=1e-5)
        assert cert.damping_share == 1


def test_what_is_refused() -> None:
    with pytest.raises(InputError, match="damping_limits"):
        lc.tracking_law("so3", **LOOP, damping_limits=-1)
    with pytest.raises(ShapeError, match="damping_limits"):
        lc.tracking_law("so3", **LOOP, damping_limits=[1, 2])
    with pytest.raises(InputError, match="inputs"):
        lc.certificate("so3", law=lc.tracking_law("so3", **LOOP, damping_limits="input"), level=2)
    law = lc.tracking_law("so3", **LOOP, damping_limits=1)
    with pytest.raises(InputError, match="damping_limits beside law"):
        lc.certificate("so3", law=law, damping_limits=2, level=2)
