"""lc.transition_step in compiled C against differences of the step in 50 digits, in a filter, and in a flight package."""

from __future__ import annotations

import math
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from multiprecision_kernels import DIGITS, combined, components, matrices, multiprecision, slopes

import lie_codegen as lc
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.kernel.complex_scalar import Complex


def complex_rows(X: Any) -> Any:
    return [[Complex(mp.re(z), mp.im(z)) for z in row] for row in X.tolist()]


@pytest.mark.parametrize("tangent", ["right", "left"])
@pytest.mark.parametrize("name", ["so3", "se3", "su2", "sl2"])
def test_against_differences(name: str, tangent: str) -> None:
    group, basis = lc.group(name), matrices(lc.group(name))
    n, step = group.dim, lc.rkmk4_step(name)
    made = lc.transition_step(step, by=("u0", "h"), tangent=tangent)
    lib = lc.build([made, step])
    u = [np.linspace(0.3, -0.7, n), np.linspace(0.1, -0.4, n), np.linspace(-0.2, 0.5, n)]
    h = 0.1
    with mp.workdps(DIGITS):
        X = mp.expm(combined(basis, np.linspace(-0.4, 0.5, n)))

        def moved(e: Any, du: Any, dh: Any) -> Any:
            start = X * mp.expm(combined(basis, e)) if tangent == "right" else mp.expm(combined(basis, e)) * X
            rows = complex_rows(start) if group.is_complex else start.tolist()
            u0 = [mp.mpf(a) + b for a, b in zip(u[0], du, strict=True)]
            (after,) = step.evaluate(multiprecision(), rows, u0, u[1].tolist(), u[2].tolist(), mp.mpf(h) + dh)
            return mp.matrix([[mp.mpc(z.re, z.im) if isinstance(z, Complex) else z for z in row] for row in after])

        zero = [mp.mpf(0)] * n
        inverse = mp.inverse(moved(zero, zero, 0))

        def error(after: Any) -> Any:
            return components(basis, mp.logm(inverse * after if tangent == "right" else after * inverse))

        Phi = slopes(lambda e: error(moved(e, zero, 0)), n)
        Gamma_u0 = slopes(lambda e: error(moved(zero, e, 0)), n)
        Gamma_h = slopes(lambda e: error(moved(zero, zero, e[0])), 1)
        element = np.array(X.tolist(), dtype=complex)
    found = lib[made.name](element if group.is_complex else element.real, *u, h)
    np.testing.assert_allclose(found.Phi, Phi, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.Gamma_u0, Gamma_u0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.Gamma_h, Gamma_h, rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        found.X_next, lib.rkmk4_step(element if group.is_complex else element.real, *u, h), atol=1e-15
    )


def imu() -> lc.Kernel:
    rotate = lc.rkmk4_step("so3")

    def body(ops: Any, X: Any, bias: Any, rate: Any, h: Any) -> tuple[Any, ...]:
        u = [a - b for a, b in zip(rate, bias, strict=True)]
        return rotate.evaluate(ops, X, u, u, u, h)[0], [b + 0 for b in bias]

    inputs = (lc.Port("X", (3, 3)), lc.Port("bias", (3,)), lc.Port("rate", (3,)), lc.Port("h", ()))
    return lc.Kernel("imu", "so3", inputs, (lc.Port("X_next", (3, 3)), lc.Port("bias_next", (3,))), body)


def rotation(x: Any) -> np.ndarray:
    """Rodrigues."""
    angle = float(np.linalg.norm(x))
    if angle < 1e-12:
        return np.eye(3) + cross(x)
    K = cross(np.asarray(x) / angle)
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K)


def cross(x: Any) -> np.ndarray:
    return np.array([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]])


def angles(R: np.ndarray) -> np.ndarray:
    angle = math.acos(min(1.0, max(-1.0, (np.trace(R) - 1) / 2)))
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return axis / 2 if angle < 1e-7 else axis * angle / (2 * math.sin(angle))


def test_a_state_of_a_group_and_a_bias() -> None:
    """Rotation vector and bias: exp(-hat(h u)) acts on the attitude error, -h rjac(h u) on the bias."""
    lib = lc.build(lc.transition_step(imu(), by="rate"))
    X, bias, rate, h = rotation([0.3, -0.2, 0.5]), np.array([0.1, 0.2, -0.1]), np.array([0.5, -0.4, 1.2]), 0.2
    found = lib.imu_transition(X, bias, rate, h)
    theta = h * (rate - bias)
    series = sum(
        (np.linalg.matrix_power(-cross(theta), k) / math.factorial(k + 1) for k in range(20)), np.zeros((3, 3))
    )
    np.testing.assert_allclose(found.Phi[:3, :3], rotation(-theta), rtol=0, atol=1e-13)
    # RKMK4 itself is right to h^5 for a constant rate: exactly, for it commutes
    np.testing.assert_allclose(found.Phi[:3, 3:], -h * series, rtol=0, atol=2e-5)
    np.testing.assert_allclose(found.Phi[3:], np.hstack([np.zeros((3, 3)), np.eye(3)]), rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.Gamma_rate[:3], -found.Phi[:3, 3:], rtol=0, atol=1e-13)
    many = lib.imu_transition.batch(np.array([X, X.T]), bias, rate, h)
    np.testing.assert_allclose(many.Phi[0], found.Phi, rtol=0, atol=1e-15)


def test_a_filter_that_knows_its_error() -> None:
    """Attitude and bias of 40 satellites from a gyroscope and two directions: the errors have the covariance that it says."""
    rng = np.random.default_rng(5)
    lib = lc.build(lc.transition_step(imu(), by="rate"))
    runs, h, s_rate, s_seen = 40, 0.1, 0.02, 0.05
    stars = np.array([[1.0, 0, 0], [0, 0.6, 0.8]])
    true = np.array([rotation(rng.normal(size=3)) for _ in range(runs)])
    drift = 0.05 * rng.normal(size=(runs, 3))
    X = np.array([R @ rotation(-0.1 * rng.normal(size=3)) for R in true])
    bias, P = np.zeros((runs, 3)), np.tile(np.diag([0.01] * 3 + [0.0025] * 3), (runs, 1, 1))
    for k in range(60):
        rate = np.array([0.3 * math.sin(k * h), 0.2, -0.1])
        true = np.array([R @ rotation(h * rate) for R in true])
        measured = rate + drift + s_rate * rng.normal(size=(runs, 3))
        X, bias, Phi, Gamma = lib.imu_transition.batch(X, bias, measured, h)
        P = Phi @ P @ Phi.swapaxes(1, 2) + s_rate**2 * Gamma @ Gamma.swapaxes(1, 2)
        for i in range(runs):
            seen = (true[i].T @ stars.T).T + s_seen * rng.normal(size=(2, 3))
            expected = (X[i].T @ stars.T).T
            H = np.vstack([np.hstack([cross(e), np.zeros((3, 3))]) for e in expected])
            K = P[i] @ H.T @ np.linalg.inv(H @ P[i] @ H.T + s_seen**2 * np.eye(6))
            d = K @ (seen - expected).ravel()
            X[i], bias[i], P[i] = X[i] @ rotation(d[:3]), bias[i] + d[3:], (np.eye(6) - K @ H) @ P[i]
    errors = [np.concatenate([angles(X[i].T @ true[i]), drift[i] - bias[i]]) for i in range(runs)]
    size = np.mean([e @ np.linalg.solve(P[i], e) for i, e in enumerate(errors)])
    # chi-square of 240 degrees over 40: 6 +- 3.3 sigma, sigma = sqrt(12 / 40)
    assert 4.2 < size < 7.8


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
def test_the_flight_package_checks_itself(tmp_path: Path) -> None:
    step = lc.rkmk4_step("se3")
    log = next(kernel for kernel in lc.group_kernels("so3") if kernel.name == "log")
    law = lc.tracking_law("so3", inertia=(1, 2, 3), error="so3_right", gains={"K_p": (4, 5, 6), "K_d": 6})
    made = [
        lc.transition_step(step, by=("u0", "um", "u1")),
        lc.jacobian(log, "X"),
        lc.jacobian(law, "X", output="force"),
        lc.hessian(law, "X", output="W"),
    ]
    folder = lc.generate(made, tmp_path / "flight", name="flight")
    strict = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O1", "-Iinclude"]
    subprocess.run(["gcc", *strict, "example.c", "src/flight.c", "-lm", "-o", "example"], cwd=folder, check=True)
    subprocess.run(["./example"], cwd=folder, check=True, capture_output=True)


def test_it_is_a_value_and_a_step() -> None:
    made = lc.transition_step(lc.rkmk4_step("so3"), by="u0")
    assert made == lc.transition_step(lc.rkmk4_step("so3"), by=("u0",))
    assert made != lc.transition_step(lc.rkmk4_step("so3"), by="um")
    lib = lc.build([made, lc.rkmk4_step("so3")])
    u = np.array([0.3, 0.1, -0.2])
    run = lib[made.name].scan(np.eye(3), u, u, u, 0.1, n=50)
    np.testing.assert_allclose(run, lib.rkmk4_step.scan(np.eye(3), u, u, u, 0.1, n=50), rtol=0, atol=1e-14)


def refusals() -> list[tuple[Callable[[], Any], type[Exception], str]]:
    step = lc.rkmk4_step("so3")
    return [
        (lambda: lc.transition_step("so3"), InputError, "takes a Kernel"),  # type: ignore[arg-type]
        (lambda: lc.transition_step(step, by="v"), InputError, "there are X, u0"),
        (lambda: lc.transition_step(step, state="u0"), InputError, "no output u0_next"),
        (lambda: lc.transition_step(step, tangent="body"), InputError, "right, left, entries"),
        (lambda: lc.transition_step(step, by="X"), InputError, "stands in by="),
        (lambda: lc.transition_step(step, group="se3"), ShapeError, "no element of se3"),
    ]


@pytest.mark.parametrize("number", range(6))
def test_what_is_refused(number: int) -> None:
    call, error, words = refusals()[number]
    with pytest.raises(error, match=words):
        call()
