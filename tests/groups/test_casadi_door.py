"""group.casadi in problems that a user writes in CasADi: values, a pose fit, a step of model predictive control."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
import scipy.linalg
from scipy.spatial.transform import Rotation

import lie_codegen as lc

QUIET = ("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})


@pytest.mark.parametrize("name", ["so3", "se3", "su2", "sl2"])
def test_maps_against_scipy(name: str) -> None:
    group = lc.group(name)
    x, v = np.linspace(-0.4, 0.5, group.dim), np.linspace(0.3, -0.2, group.dim)
    X = scipy.linalg.expm(group.hat(x))
    seen = np.array(group.casadi.exp(x))
    np.testing.assert_allclose(seen, np.ascontiguousarray(X).view(float), rtol=0, atol=1e-14)
    np.testing.assert_allclose(np.array(group.casadi.log(seen)).ravel(), x, rtol=0, atol=1e-13)
    moved = group.vee(X @ group.hat(v) @ np.linalg.inv(X))
    np.testing.assert_allclose(np.array(group.casadi.Ad(seen) @ v).ravel(), moved, rtol=0, atol=1e-13)
    # d/dt exp(x + t v) = hat(ljac(x) v) exp(x), by a block exponential
    hat, zero = group.hat(x), np.zeros_like(X)
    block = scipy.linalg.expm(np.block([[hat, group.hat(v)], [zero, hat]]))
    rate = group.vee(block[: group.degree, group.degree :] @ np.linalg.inv(X))
    np.testing.assert_allclose(np.array(group.casadi.ljac(x) @ v).ravel(), rate, rtol=0, atol=1e-13)


def test_every_kernel_is_there_once() -> None:
    group = lc.group("so3")
    names = {kernel.name for kernel in lc.group_kernels(group)}
    assert set(group.casadi) == {*names, "rkmk4_step"}
    assert set(group.casadi) < set(dir(group.casadi))
    assert group.casadi.exp is group.casadi.exp
    with pytest.raises(AttributeError, match="it has product_exp"):
        group.casadi.expp  # noqa: B018


def test_a_pose_fit() -> None:
    truth = np.array([0.3, -0.5, 0.2, 1.0, 2.0, -1.0])
    points = np.random.default_rng(3).normal(size=(3, 8))
    R = Rotation.from_rotvec(truth[:3]).as_matrix()
    seen = R @ points + truth[3:, None]
    opti, se3 = ca.Opti(), lc.group("se3")
    x = opti.variable(6)
    X = se3.casadi.exp(x)
    opti.minimize(ca.sumsqr(X[:3, :3] @ points + ca.repmat(X[:3, 3], 1, 8) - seen))
    opti.solver(*QUIET)
    found = np.array(opti.solve().value(X))
    np.testing.assert_allclose(found[:3, :3], R, rtol=0, atol=1e-7)
    np.testing.assert_allclose(found[:3, 3], truth[3:], rtol=0, atol=1e-7)


def test_a_controller_parks_a_car() -> None:
    """Receding horizon on SE(2) without sideways motion; the car itself is moved by scipy's exponential."""
    se2, N, h = lc.group("se2"), 12, 0.25
    opti = ca.Opti()
    start, u = opti.parameter(3, 3), opti.variable(3, N)
    X, cost = start, 0
    for k in range(N):
        X = X @ se2.casadi.exp(h * u[:, k])
        cost = cost + ca.sumsqr(X - np.eye(3)) * (1 if k < N - 1 else 20)
    opti.minimize(cost + 0.01 * ca.sumsqr(u))
    opti.subject_to(opti.bounded(-2, ca.vec(u), 2))
    opti.subject_to(u[2, :] == 0)
    opti.solver(*QUIET)
    car = scipy.linalg.expm(se2.hat([0.4, -1.0, 0.0])) @ scipy.linalg.expm(se2.hat([0.0, 0.0, 0.3]))
    distance = [np.linalg.norm(car - np.eye(3))]
    opti.set_initial(u, 0.1)
    for _ in range(16):
        opti.set_value(start, car)
        solved = opti.solve()
        opti.set_initial(u, solved.value(u))
        control = solved.value(u[:, 0])
        assert np.all(np.abs(control) < 2 + 1e-6)
        car = car @ scipy.linalg.expm(se2.hat(h * control))
        distance.append(np.linalg.norm(car - np.eye(3)))
    assert distance[0] > 1
    assert distance[-1] < 0.05
