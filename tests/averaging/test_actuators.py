"""Momentum wheels, the point-mass oscillator and vibration: section 6 of TR 93-59."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.linalg import logm

import lie_codegen as lc
from lie_codegen.averaging.actuated_inputs import oscillator_areas, oscillator_average, wheel_input
from lie_codegen.averaging.vibration_drift import VibrationLine, line_drift, spectral_drift
from lie_codegen.errors import AssumptionError, InputError, ShapeError
from lie_codegen.flow.batched_exponential import expm as batched_expm
from lie_codegen.mechanics.actuators import MomentumWheels, PointMassOscillator

SKEW = MomentumWheels(
    inertia=[[20, "-1/2", 1], ["-1/2", 17, "3/10"], [1, "3/10", 12]],
    axes=[[1, 1, 0], [0, 1, "1/2"], ["-1/5", 0, 2]],
    axial=["1/2", "2/5", "3/5"],
    transverse=["1/4", "1/5", "3/10"],
)


def hat(v: np.ndarray) -> np.ndarray:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def test_the_body_rate_keeps_the_total_angular_momentum_zero() -> None:
    """sum Jbar_i (Omega + theta_i' b_i) + J* Omega = 0 with Jbar_i = R_i diag(k, k, j) R_i^T, from scratch."""
    rng = np.random.default_rng(2)
    rates = rng.normal(size=3)
    omega = SKEW.body_rate(rates)
    total = np.array(SKEW.inertia.tolist(), dtype=float) @ omega
    for i, rate in enumerate(rates):
        b = np.array(SKEW.axes.row(i), dtype=float).ravel()
        assert np.linalg.norm(b) == pytest.approx(1, abs=1e-15)
        a = np.linalg.svd(b[None])[2][1:]
        R = np.column_stack([*a, b])
        Jbar = R @ np.diag([float(SKEW.transverse[i])] * 2 + [float(SKEW.axial[i])]) @ R.T
        total = total + Jbar @ (omega + rate * b)
    np.testing.assert_allclose(total, 0, atol=1e-14)


def test_principal_wheels_have_the_printed_rates() -> None:
    wheels = MomentumWheels(
        inertia=[5, 6, 7], axes=np.eye(3).tolist(), axial=["1/2", "1/3", "1/4"], transverse=["1/5", "1/6", "1/7"]
    )
    j, k, i = wheels.axial, wheels.transverse, (5, 6, 7)
    expected = [
        -j[0] / (i[0] + j[0] + k[1] + k[2]),
        -j[1] / (i[1] + j[1] + k[0] + k[2]),
        -j[2] / (i[2] + j[2] + k[0] + k[1]),
    ]
    assert wheels.exact_C == sp.diag(*expected)


def test_areas_transform_by_the_cofactor_matrix() -> None:
    u = lc.PeriodicInput(["cos(t)", "sin(t) + 1/2*cos(2*t)", "sin(2*t + 1)"], "2*pi")
    so3 = lc.group("so3")
    wheel_areas = lc.average(so3, u, 1).areas
    body_areas = lc.average(so3, wheel_input(SKEW, u), 1).areas
    np.testing.assert_allclose(SKEW.body_areas(wheel_areas), body_areas, atol=1e-15)

    def axial(a: np.ndarray) -> np.ndarray:
        return np.array([a[1, 2], a[2, 0], a[0, 1]])

    np.testing.assert_allclose(SKEW.area_transform @ axial(wheel_areas), axial(body_areas), atol=1e-15)


def test_two_and_four_wheels() -> None:
    two = MomentumWheels(inertia=[5, 6, 7], axes=[[1, 0, 0], [0, 1, 1]], axial=[1, 1], transverse=[0.5, 0.5])
    assert two.C.shape == (3, 2)
    with pytest.raises(InputError, match="cofactor"):
        _ = two.area_transform
    four = MomentumWheels(
        inertia=[5, 6, 7], axes=[[1, 1, 1], [1, -1, 1], [-1, 1, 1], [-1, -1, 1]], axial=[1] * 4, transverse=[0.5] * 4
    )
    u = lc.PeriodicInput(["cos(t)", "sin(t)", "cos(2*t)", "sin(3*t)"], "2*pi")
    np.testing.assert_allclose(wheel_input(four, u)(0.7), four.body_rate(u(0.7)), atol=1e-15)


def test_the_oscillator_and_both_averages_against_the_true_system() -> None:
    """Drift of the exact Omega (70) over one period: the paper's average, and one with the next order."""
    so3 = lc.group("so3")
    body = PointMassOscillator(body_mass=10, point_mass=2, inertia=[[4, "1/5", 0], ["1/5", 3, "1/10"], [0, "1/10", 2]])
    x_dot = lc.PeriodicInput(["cos(t)", "sin(t) + 1/2*cos(2*t)", "sin(2*t)"], "2*pi")
    averaged = oscillator_average(so3, body, x_dot)
    a = oscillator_areas(x_dot)
    printed = -2 * body.reduced_mass / x_dot.period * body.inertia.inv() * sp.Matrix([a[1, 2], a[2, 0], a[0, 1]])
    assert sp.expand(printed - averaged.first) == sp.zeros(3, 1)
    errors = []
    for eps in (0.2, 0.1):

        def rate(t: float, X: np.ndarray, eps: float = eps) -> np.ndarray:
            omega = body.body_rate(eps * x_dot.integral(t), eps * x_dot(t))
            return (X.reshape(3, 3) @ hat(omega)).ravel()

        X = (
            solve_ivp(rate, (0, x_dot.T), np.eye(3).ravel(), rtol=1e-12, atol=1e-14, method="DOP853")
            .y[:, -1]
            .reshape(3, 3)
        )
        drift = so3.project(logm(X)) / x_dot.T
        errors.append([np.linalg.norm(averaged.drift(eps, order) - drift) for order in (1, 2)])
    slopes = np.log2(np.array(errors[0]) / np.array(errors[1]))
    assert slopes[0] == pytest.approx(4, abs=0.2)
    assert slopes[1] == pytest.approx(6, abs=0.2)


def test_vibration_lines_drift_as_simulated() -> None:
    """Two incommensurate lines: the mean velocity over a long time against a product of exponentials."""
    so3 = lc.group("so3")
    lines = [
        VibrationLine(11.0, (0.04, 0, 0.02), (0, 0.06, 0)),
        VibrationLine(7 * np.sqrt(5), (0, 0.04, 0), (0.02, 0, 0.06)),
    ]
    drift = line_drift(so3, lines)
    h, X = 2e-3, np.eye(3)
    t = (np.arange(200_000) + 0.5) * h
    u = sum(np.outer(np.cos(v.omega * t), v.cosine) + np.outer(np.sin(v.omega * t), v.sine) for v in lines)
    for step in batched_expm(so3.hat(h * u)):
        X = X @ step
    end = h * len(t)
    wobble = sum(
        (np.sin(v.omega * end) * np.array(v.cosine) + (1 - np.cos(v.omega * end)) * np.array(v.sine)) / v.omega
        for v in lines
    )
    measured = so3.project(logm(X @ batched_expm(so3.hat(-wobble)))) / end
    np.testing.assert_allclose(measured, drift, atol=0.02 * np.linalg.norm(drift))


def test_a_spectrum_of_narrow_lines_gives_the_drift_of_the_lines() -> None:
    so3 = lc.group("so3")
    line = VibrationLine(9.0, (0.3, 0.1, 0.0), (0.0, 0.2, 0.5))
    z = np.array(line.cosine) - 1j * np.array(line.sine)
    omega = np.linspace(8, 10, 4001)
    shape = np.exp(-(((omega - 9) / 0.02) ** 2))
    shape /= np.trapezoid(shape, omega)
    density = shape[:, None, None] * np.outer(z, z.conj()) / 2
    np.testing.assert_allclose(spectral_drift(so3, omega, density), line_drift(so3, [line]), rtol=1e-4)


def test_refusals() -> None:
    so3 = lc.group("so3")
    with pytest.raises(InputError, match="positive definite"):
        MomentumWheels(inertia=[1, -1, 1], axes=[[1, 0, 0]], axial=[1], transverse=[1])
    with pytest.raises(ShapeError, match="axial has 2"):
        MomentumWheels(inertia=[1, 1, 1], axes=[[1, 0, 0]], axial=[1, 2], transverse=[1])
    with pytest.raises(InputError, match="axis 1 is zero"):
        MomentumWheels(inertia=[1, 1, 1], axes=[[0, 0, 0]], axial=[1], transverse=[1])
    body = PointMassOscillator(10, 1, [1, 2, 3])
    with pytest.raises(AssumptionError, match="zero-mean"):
        oscillator_average(so3, body, lc.PeriodicInput(["1 + cos(t)", "0", "0"]))
    with pytest.raises(InputError, match="not the group of rotations"):
        oscillator_average(lc.group("se2"), body, lc.PeriodicInput(["cos(t)", "0", "0"]))
    with pytest.raises(InputError, match="Hermitian"):
        spectral_drift(so3, [1.0, 2.0], np.ones((2, 3, 3)) * 1j)
    with pytest.raises(InputError, match="two lines"):
        line_drift(so3, [VibrationLine(1.0, (1, 0, 0), (0, 1, 0))] * 2)
