"""lc.momentum_wheels against Newton and Euler's equations by scipy, which know nothing of conserved momentum or of groups."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.spatial.transform import Rotation

import lie_codegen as lc
from lie_codegen.errors import InputError, ShapeError

INERTIA = [[2, -0.05, 0.1], [-0.05, 1.7, 0.03], [0.1, 0.03, 1.2]]
SKEW = [[1, 0.2, 0], [0, 1, 0.3], [1, -0.5, 1]]
TWO: dict[str, Any] = {"axes": SKEW[:2], "inertia": INERTIA, "wheel_inertia": 0.05, "transverse": 0.02}
THREE: dict[str, Any] = {"axes": SKEW, "inertia": INERTIA, "wheel_inertia": [0.03, 0.02, 0.05], "transverse": 0.01}
FOUR: dict[str, Any] = {
    "axes": [[1, 1, 1], [1, -1, 1], [-1, 1, 1], [-1, -1, 1]],
    "inertia": INERTIA,
    "wheel_inertia": 0.03,
}
STORED = [0.1, 0.2, -0.1]
TARGET = Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix()


def ugly() -> lc.MatrixGroup:
    rows = {"a": {"w1": 1, "w2": "1/2"}, "b": {"w2": 3, "w3": -1}, "c": {"w3": "1/5"}}
    return lc.change_of_basis("so3", rows, name="bent")


def numbers(data: dict[str, Any]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """J locked, unit axes, axial inertias: written down again."""
    b = np.array(data["axes"], dtype=float)
    b /= np.linalg.norm(b, axis=1)[:, None]
    j = np.broadcast_to(np.asarray(data["wheel_inertia"], dtype=float), len(b))
    k = np.broadcast_to(np.asarray(data.get("transverse", 0), dtype=float), len(b))
    J = np.array(data["inertia"], dtype=float)
    for i in range(len(b)):
        J = J + k[i] * np.eye(3) + (j[i] - k[i]) * np.outer(b[i], b[i])
    return J, b, j


def newton_euler(
    data: dict[str, Any],
    torque: Callable[[float], np.ndarray],
    R: np.ndarray,
    w: np.ndarray,
    speeds: np.ndarray,
    edges: Any,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Body and wheels under motor torques; the torque may jump at the edges. R, w, speeds at the end."""
    J, b, j = numbers(data)
    p = len(b)
    mass = np.block([[J, b.T * j], [j[:, None] * b, np.diag(j)]])

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        R, w, speeds = y[:9].reshape(3, 3), y[9:12], y[12:]
        gyro = -np.cross(w, J @ w + b.T @ (j * speeds))
        change = np.linalg.solve(mass, np.concatenate([gyro, torque(t)]))
        hat = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        return np.concatenate([(R @ hat).ravel(), change[:3], change[3:]])

    y = np.concatenate([R.ravel(), w, speeds])
    for a, c in pairwise(edges):

        def inside(t: float, y: np.ndarray, a: float = a, c: float = c) -> np.ndarray:
            return rate(min(max(t, a + 1e-12), c - 1e-12), y)

        y = solve_ivp(inside, (a, c), y, rtol=1e-10, atol=1e-12).y[:, -1]
    return y[:9].reshape(3, 3), y[9:12], y[12 : 12 + p]


def torque(t: float, p: int) -> np.ndarray:
    return np.array([0.02 * np.sin(t), 0.01 * np.cos(2 * t), 0.008, -0.01 * np.sin(3 * t)])[:p]


@pytest.mark.parametrize("data", [TWO, THREE, FOUR], ids=["two", "three", "four"])
def test_torques_move_body_and_wheels(data: dict[str, Any]) -> None:
    system = lc.momentum_wheels(**data, stored=STORED)
    p = system.count
    speeds0 = np.linspace(1, -2, p)
    X0 = Rotation.from_rotvec([0.2, 0.1, -0.4]).as_matrix()
    t = np.linspace(0, 6, 13)
    run = system.simulate(torques=lambda s: torque(s, p), t=t, X0=X0, speeds0=speeds0)
    w0 = np.linalg.solve(numbers(data)[0], X0.T @ STORED - (numbers(data)[1].T * numbers(data)[2]) @ speeds0)
    np.testing.assert_allclose(run.omega[0], w0, rtol=0, atol=1e-13)
    R, w, speeds = newton_euler(data, lambda s: torque(s, p), X0, w0, speeds0, [0.0, 6.0])
    np.testing.assert_allclose(run.X[-1], R, rtol=0, atol=1e-7)
    np.testing.assert_allclose(run.omega[-1], w, rtol=0, atol=1e-7)
    np.testing.assert_allclose(run.speeds[-1], speeds, rtol=0, atol=1e-6)
    np.testing.assert_allclose(run.momentum, np.tile(STORED, (13, 1)), rtol=0, atol=1e-13)


def test_speeds_and_torques_are_two_views_of_one_motion() -> None:
    """Speeds of a motion under torques, given back as speeds, make the same motion; on SU(2) and in another basis too."""
    system = lc.momentum_wheels(**THREE, stored=STORED)
    t = np.linspace(0, 4, 401)
    run = system.simulate(torques=["0.02*sin(t)", "0.01*cos(2*t)", "0.008"], t=t)
    again = system.simulate(run.speeds, t=t)
    np.testing.assert_allclose(again.X[-1], run.X[-1], rtol=0, atol=1e-6)  # speeds are linear between 400 samples
    for group in (ugly(), "su2"):
        other = lc.momentum_wheels(group, **THREE, stored=STORED)
        same = other.simulate(torques=["0.02*sin(t)", "0.01*cos(2*t)", "0.008"], t=t)
        np.testing.assert_allclose(other.rotation(same.X), run.X, rtol=0, atol=1e-8)
        np.testing.assert_allclose(same.speeds, run.speeds, rtol=0, atol=1e-7)


@pytest.mark.parametrize("group", ["so3", ugly(), "su2"], ids=["so3", "bent", "su2"])
def test_two_skew_wheels_reach_three_axes(group: Any) -> None:
    system = lc.momentum_wheels(group, **TWO)
    plan = system.steer(TARGET, 8.0)
    assert plan.error < 1e-6
    assert plan.status in (lc.Status.SOLVED, lc.Status.LOCAL)
    J, b, j = numbers(TWO)
    C = -np.linalg.solve(J, b.T * j)

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        w = C @ plan.speeds(min(t, 8.0))
        return (y.reshape(3, 3) @ np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])).ravel()

    R = solve_ivp(rate, (0, 8), np.eye(3).ravel(), rtol=1e-9, atol=1e-10).y[:, -1].reshape(3, 3)
    assert Rotation.from_matrix(R.T @ TARGET).magnitude() < 1e-6
    cost = quad(lambda t: np.sum(plan.speeds(t) ** 2), 0, 8, limit=200)[0]
    assert plan.cost == pytest.approx(cost, rel=1e-8)
    h = 1e-5
    slope = (plan.speeds(3.0 + h) - plan.speeds(3.0 - h)) / (2 * h)
    np.testing.assert_allclose(plan.torques(3.0), j * (slope + b @ C @ slope), rtol=0, atol=1e-8)


def test_the_cost_does_not_depend_on_the_basis_and_the_error_is_an_angle() -> None:
    plans = [lc.momentum_wheels(group, **TWO).steer(TARGET, 8.0) for group in ("so3", ugly())]
    assert plans[1].cost == pytest.approx(plans[0].cost, rel=1e-6)
    system = lc.momentum_wheels(ugly(), **TWO)
    rough = system.steer(Rotation.from_rotvec([0.02, 0.01, 0.05]).as_matrix(), 8.0, method="area_rule", exact=False)
    angle = Rotation.from_matrix(np.asarray(rough.X_final).T @ np.asarray(rough.target)).magnitude()
    assert rough.error == pytest.approx(angle, rel=1e-6)
    assert rough.error != pytest.approx(rough.plan.error, rel=0.01)  # Euclidean in the wheels' basis


@pytest.mark.parametrize("data", [THREE, FOUR], ids=["three", "four"])
def test_limits_and_stored_momentum(data: dict[str, Any]) -> None:
    system = lc.momentum_wheels(**data, stored=STORED, torque_limits=0.06, speed_limits=60)
    plan = system.steer(TARGET, 12.0)
    assert plan.error < 1e-5
    assert plan.violation["speeds"] < 1e-3
    knots = plan.plan.t
    start = plan.speeds(0.0)
    assert np.all(np.abs(plan.torques(np.linspace(0, 12, 301))) <= 0.06 + 1e-12)
    R, w, speeds = newton_euler(data, lambda t: plan.torques(t), np.eye(3), np.zeros(3), start, knots)
    assert Rotation.from_matrix(R.T @ TARGET).magnitude() < 1e-5
    assert np.max(np.abs(w)) < 1e-5  # rest to rest
    np.testing.assert_allclose(speeds, plan.speeds(12.0), rtol=0, atol=1e-5)
    _, b, j = numbers(data)
    np.testing.assert_allclose(b.T @ (j * start), STORED, rtol=0, atol=1e-12)


def test_speed_limits_alone() -> None:
    free = lc.momentum_wheels(**TWO).steer(TARGET, 8.0)
    limit = 0.9 * float(np.max(np.abs(free.speeds(np.linspace(0, 8, 401)))))
    plan = lc.momentum_wheels(**TWO, speed_limits=limit).steer(TARGET, 8.0)
    assert plan.error < 1e-6
    assert np.max(np.abs(plan.speeds(np.linspace(0, 8, 801)))) <= limit * (1 + 1e-9)
    assert plan.cost >= free.cost * (1 - 1e-6)
    spare = lc.momentum_wheels(**FOUR, speed_limits=40).steer(TARGET, 8.0)
    assert spare.error < 1e-6
    assert spare.violation["speeds"] == 0.0


def test_two_wheels_from_rest_to_rest() -> None:
    system = lc.momentum_wheels(**TWO, torque_limits=2.0)
    plan = system.steer(TARGET, 12.0)
    np.testing.assert_allclose(plan.speeds([0.0, 12.0]), 0, rtol=0, atol=1e-4)
    R, w, _ = newton_euler(TWO, lambda t: plan.torques(t), np.eye(3), np.zeros(3), np.zeros(2), plan.plan.t)
    assert Rotation.from_matrix(R.T @ TARGET).magnitude() < 1e-5
    assert np.max(np.abs(w)) < 1e-5


def test_the_average_is_the_drift() -> None:
    """Zero-mean speeds: log X(T)/T by scipy, to the order of the average, in the basis of the group."""
    J, b, j = numbers(TWO)
    C = -np.linalg.solve(J, b.T * j)
    speeds = lc.PeriodicInput(["6*cos(t)", "5*sin(t)"], period="2*pi")
    errors = []
    for eps in (0.8, 0.4):

        def rate(t: float, y: np.ndarray, eps: float = eps) -> np.ndarray:
            w = eps * C @ np.array([6 * np.cos(t), 5 * np.sin(t)])
            return (y.reshape(3, 3) @ np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])).ravel()

        R = solve_ivp(rate, (0, 2 * np.pi), np.eye(3).ravel(), rtol=1e-11, atol=1e-13).y[:, -1].reshape(3, 3)
        drift = Rotation.from_matrix(R).as_rotvec() / (2 * np.pi)
        system = lc.momentum_wheels(ugly(), **TWO)
        F = system.average(speeds, order=2).F
        errors.append(np.linalg.norm(system.frame @ (eps * F[0] + eps**2 * F[1]) - drift))
    assert 2.7 < np.log2(errors[0] / errors[1]) < 4.3
    assert errors[1] < 0.1 * np.linalg.norm(drift)


def test_loops() -> None:
    system = lc.momentum_wheels(**THREE, stored=STORED, torque_limits=0.05)
    t = np.linspace(0, 60, 601)
    run = system.closed_loop(t=t, X0=TARGET)
    assert run.error[0] == pytest.approx(Rotation.from_matrix(TARGET).magnitude(), abs=1e-12)
    assert run.error[-1] < 1e-6
    assert np.max(np.abs(run.torques)) <= 0.05 + 1e-15
    np.testing.assert_allclose(run.momentum, np.tile(STORED, (601, 1)), rtol=0, atol=1e-12)
    # the torques that it reports, held over each sample, move Newton and Euler's body alike
    R, w, _ = newton_euler(
        THREE, lambda s: run.torques[min(int(s / 0.1), 599)], TARGET, run.omega[0], run.speeds[0], t[:101]
    )
    np.testing.assert_allclose(run.X[100], R, rtol=0, atol=1e-6)
    np.testing.assert_allclose(run.omega[100], w, rtol=0, atol=1e-6)
    noisy = system.closed_loop(t=t, X0=TARGET, runs=5, noise={"X": 1e-3, "xi": 1e-4}, seed=3)
    fewer = system.closed_loop(t=t, X0=TARGET, runs=3, noise={"X": 1e-3, "xi": 1e-4}, seed=3)
    np.testing.assert_array_equal(noisy.X[:, :3], fewer.X)
    assert 1e-4 < np.max(noisy.error[-100:]) < 2e-2


def test_a_wheel_that_is_too_fast_is_driven_no_further() -> None:
    free = lc.momentum_wheels(**THREE).closed_loop(t=np.linspace(0, 10, 201), X0=TARGET)
    fastest = np.max(np.abs(free.speeds))
    kept = lc.momentum_wheels(**THREE, speed_limits=0.7 * fastest).closed_loop(t=np.linspace(0, 10, 201), X0=TARGET)
    assert np.max(np.abs(kept.speeds)) < 0.8 * fastest  # beyond the limit by one sample at most
    assert kept.error[-1] < 0.05


def test_attitude_laws_are_laws_of_so3() -> None:
    with pytest.raises(InputError, match="give a tracking law on bent"):
        lc.momentum_wheels(ugly(), **FOUR).closed_loop(t=np.linspace(0, 1, 11))


def test_a_tracking_law_follows_a_reference() -> None:
    system = lc.momentum_wheels(**FOUR)
    law = lc.tracking_law("so3", inertia=system.inertia, error="so3_right", gains={"K_p": (4, 4, 4), "K_d": 4})
    reference = lc.reference("so3", ["0.2*sin(t/4)", "0.1*cos(t/5)", "0.05*t"])
    run = system.closed_loop(law, t=np.linspace(0, 20, 401), reference=reference)
    assert run.error[-1] < 0.02
    with pytest.raises(InputError, match="needs a reference"):
        system.closed_loop(law, t=np.linspace(0, 1, 11))


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
def test_c(tmp_path: Path) -> None:
    strict = ["gcc", "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O1", "-Iinclude"]
    system = lc.momentum_wheels(**TWO)
    folder = lc.generate(system.steer(TARGET, 8.0), tmp_path / "turn", name="sat")
    subprocess.run(
        [*strict, "example.c", "src/sat.c", "src/sat_plan.c", "-lm", "-o", "example"], cwd=folder, check=True
    )
    subprocess.run(["./example"], cwd=folder, check=True, capture_output=True)
    subprocess.run(
        [*strict, "sat_plan_replay.c", "src/sat.c", "src/sat_plan.c", "-lm", "-o", "replay"], cwd=folder, check=True
    )
    subprocess.run(["./replay"], cwd=folder, check=True, capture_output=True)
    assert "wheel_body_rate(" in (folder / "include" / "sat.h").read_text()


def test_what_is_refused() -> None:
    system = lc.momentum_wheels(**TWO)
    with pytest.raises(InputError, match="no continuous"):
        system.closed_loop(t=np.linspace(0, 1, 11))
    with pytest.raises(InputError, match="do not give this rate"):
        system.wheel_speeds([0, 0, 1])
    with pytest.raises(InputError, match="one of the two"):
        system.simulate(t=[0, 1])
    with pytest.raises(ShapeError, match="for 2 wheels"):
        system.simulate([1, 2, 3], t=[0, 1])
    with pytest.raises(InputError, match="one direction"):
        lc.momentum_wheels(axes=[[1, 0, 0]], inertia=[1, 2, 3]).steer(TARGET, 1.0)
    with pytest.raises(InputError, match="not a group of rotations"):
        lc.momentum_wheels("se3", **TWO)
    with pytest.raises(ShapeError, match="3 entries for 2 wheels"):
        lc.momentum_wheels(**{**TWO, "wheel_inertia": [1, 2, 3]})
    with pytest.raises(InputError, match="must be positive"):
        lc.momentum_wheels(**TWO, torque_limits=-1)
    stored = lc.momentum_wheels(**THREE, stored=STORED)
    with pytest.raises(InputError, match="zero stored momentum"):
        stored.average(lc.PeriodicInput(["cos(t)", "sin(t)", "0"], period="2*pi"))
    with pytest.raises(InputError, match="give X"):
        stored.body_rate([1, 2, 3])
    with pytest.raises(InputError, match="knows no torques"):
        stored.steer(TARGET, 5.0, method="circle")
