"""lc.point_mass_connection against momenta that are summed mass by mass and integrated by scipy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.linalg
from scipy.integrate import solve_ivp

import lie_codegen as lc
from lie_codegen.errors import InputError

J = np.array([[3, 0.2, -0.1], [0.2, 4, 0.3], [-0.1, 0.3, 5]])
M0, MASSES = 6.0, [0.8, 1.1]
TEXTS = ["cos(t)/2", "sin(t)/2", "cos(2*t)/4", "sin(t)/3", "cos(t)/4", "sin(2*t)/3"]


def places(t: float) -> np.ndarray:
    return np.array(
        [[np.cos(t) / 2, np.sin(t) / 2, np.cos(2 * t) / 4], [np.sin(t) / 3, np.cos(t) / 4, np.sin(2 * t) / 3]]
    )


def velocity(t: float, eps: float) -> np.ndarray:
    """(w, v) of the body: linear and angular momentum, summed over body and masses, are zero."""
    h = 1e-6
    y, rate = eps * places(t), eps * (places(t + h) - places(t - h)) / (2 * h)

    def momenta(w: np.ndarray, v: np.ndarray, moving: bool) -> np.ndarray:
        P, L = M0 * v, J @ w
        for m, place, u in zip(MASSES, y, rate, strict=True):
            own = v + np.cross(w, place) + (u if moving else 0)
            P, L = P + m * own, L + m * np.cross(place, own)
        return np.concatenate([L, P])

    zero = np.zeros(3)
    matrix = np.array([momenta(e[:3], e[3:], False) for e in np.eye(6)]).T
    return np.linalg.solve(matrix, -momenta(zero, zero, True))


def true_end(group: lc.MatrixGroup, take: Any, eps: float) -> np.ndarray:
    d = group.degree

    def rate(t: float, X: np.ndarray) -> np.ndarray:
        return (X.reshape(d, d) @ group.hat(take(velocity(t, eps)))).ravel()

    start = np.eye(d, dtype=complex if group.is_complex else float).ravel()
    return solve_ivp(rate, (0, 2 * np.pi), start, rtol=1e-10, atol=1e-12).y[:, -1].reshape(d, d)


def bent() -> lc.MatrixGroup:
    rows = {"a": {"w1": 1, "w2": "1/2"}, "b": {"w2": 3, "w3": -1}, "c": {"w3": "1/5"}}
    return lc.change_of_basis("so3", rows, name="bent")


@pytest.mark.parametrize("name", ["so3", "bent", "su2", "se3"])
def test_two_masses_turn_and_carry_the_body(name: str) -> None:
    group = bent() if name == "bent" else lc.group(name)
    made = lc.point_mass_connection(group, body_mass=M0, masses=MASSES, inertia=J)
    frame = np.array([[1, 0, 0], [0.5, 3, 0], [0, -1, 0.2]]) if name == "bent" else np.eye(3)
    take = (lambda xi: xi) if name == "se3" else (lambda xi: np.linalg.solve(frame, xi[:3]))
    gait = lc.PeriodicInput(TEXTS, period="2*pi")
    end = true_end(group, take, 0.8)
    np.testing.assert_allclose(made.displacement(gait, amplitude=0.8), end, rtol=0, atol=1e-7)
    average = made.average(gait, order=3)
    errors = []
    for eps in (0.4, 0.2):
        drift = group.vee(scipy.linalg.logm(true_end(group, take, eps)).astype(complex if group.is_complex else float))
        errors.append(np.linalg.norm(average.log(eps) - drift))
    assert np.log2(errors[0] / errors[1]) > 3.5


def test_one_mass_is_the_oscillator_of_the_paper() -> None:
    """(70) with alpha_m = m_0 m_1/(m_0 + m_1); in the plane the same body with one axis."""
    made = lc.point_mass_connection("so3", body_mass=6, masses=[2], inertia=(3, 4, 5))
    y, alpha = np.array([0.3, -0.2, 0.4]), 1.5
    lock = np.diag([3.0, 4, 5]) + alpha * (y @ y * np.eye(3) - np.outer(y, y))
    hat = np.array([[0, -y[2], y[1]], [y[2], 0, -y[0]], [-y[1], y[0], 0]])
    np.testing.assert_allclose(made.A(y), alpha * np.linalg.solve(lock, hat), rtol=0, atol=1e-14)
    flat = lc.point_mass_connection("se2", body_mass=6, masses=[2], inertia=5)
    turn = alpha * np.array([-y[1], y[0]]) / (5 + alpha * (y[0] ** 2 + y[1] ** 2))
    np.testing.assert_allclose(flat.A(y[:2])[0], turn, rtol=0, atol=1e-14)


def test_what_is_refused() -> None:
    for arguments in ({"masses": []}, {"masses": [-1]}, {"body_mass": 0}, {"inertia": (1, -1, 1)}):
        with pytest.raises(InputError):
            lc.point_mass_connection("so3", **{"body_mass": 1, "masses": [1], "inertia": (1, 1, 1), **arguments})
    with pytest.raises(InputError, match="not a group of rotations"):
        lc.point_mass_connection("h3", body_mass=1, masses=[1], inertia=(1, 1, 1))
