"""Angles (7), bounds (16) and k^2 (18) against SciPy's integration and mpmath."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lie_codegen as lc
from lie_codegen.errors import InputError

BODIES = [((3, 4, 5), (0.5, 0.5, 1)), ((5, 4, 3), (0.3, -0.4, 1.0)), ((4, 5, 3), (0.4, 0.2, 1.1))]


@pytest.mark.parametrize(("moments", "omega"), BODIES)
def test_the_angles_move_between_the_bounds(moments, omega):
    body = lc.free_rigid_body(moments).adapted_to(omega)
    J = np.array(moments, dtype=float)
    t = np.linspace(0, 60, 6001)
    w = solve_ivp(lambda _, w: np.cross(J * w, w) / J, (0, 60), omega, rtol=1e-11, atol=1e-12, t_eval=t).y.T
    theta, _ = lc.coning_angles(body, w)
    low, high = lc.coning_bounds(body, body.to_slow(omega).k)
    np.testing.assert_allclose([theta.min(), theta.max()], [low, high], atol=2e-5)
    parameter = np.sum((J * omega) ** 2) / np.sum(J * np.square(omega))
    assert lc.modulus_squared(body, parameter) == pytest.approx(float(body.to_slow(omega).k) ** 2, rel=1e-12)


def test_the_angles_are_those_of_the_direction_cosines():
    body = lc.free_rigid_body((3, 4, 5))
    omega = np.array([[0.1, 0.2, 1.0], [-0.4, 0.3, -0.5]])
    theta, psi = lc.coning_angles(body, omega)
    momentum = omega * [3, 4, 5]
    cosines = momentum / np.linalg.norm(momentum, axis=1)[:, None]
    built = np.stack([np.sin(psi) * np.sin(theta), np.cos(psi) * np.sin(theta), np.cos(theta)], axis=1)
    np.testing.assert_allclose(built, cosines, atol=1e-15)


def test_bounds_in_many_digits():
    body = lc.free_rigid_body((3, 4, 5))
    with mp.workdps(40):
        square = mp.mpf(3) * (4 - 5) / (5 * (3 - 4))  # gamma_13^2 = j1 / j3
        for k in (1e-9, 0.3, 0.99):
            exact = [
                mp.acos(1 / mp.sqrt(1 + square * mp.mpf(k) ** 2)),
                mp.acos(mp.sqrt((1 - mp.mpf(k) ** 2) / (1 + square * mp.mpf(k) ** 2))),
            ]
            np.testing.assert_allclose(lc.coning_bounds(body, k), [float(e) for e in exact], rtol=1e-14)


def test_refusals():
    body = lc.free_rigid_body((3, 4, 5))
    with pytest.raises(InputError, match="middle moment"):
        lc.modulus_squared(body, 3.5)
    with pytest.raises(InputError, match="separatrix"):
        lc.coning_bounds(body, 1.5)
    with pytest.raises(InputError, match="at rest"):
        lc.coning_angles(body, (0, 0, 0))
