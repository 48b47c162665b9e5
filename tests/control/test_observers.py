"""Observers, output feedback and pointing: published runs, covariances against simulation, what one direction cannot do."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from kernel_calls import interpreted
from scipy.integrate import solve_ivp
from scipy.linalg import expm, logm

import lie_codegen as lc
from lie_codegen.errors import InputError, ShapeError

SO3, ONE = lc.group("so3"), np.eye(3)
INERTIA = np.array([[2, 0.3, -0.2], [0.3, 1.5, 0.1], [-0.2, 0.1, 1]])
TWO = np.array([[0, 0, 1], [0.6, 0, 0.8]])


def attitude_filter() -> Any:
    return lc.observer("so3", directions=TWO, weights=[1, 0.5], k_p=1.2, k_i=0.3)


def test_attitude_and_bias_of_the_published_run() -> None:
    """A first-order step: two step sizes, and the limit of their sequence."""
    step, bias = interpreted(attitude_filter()), np.array([0.05, -0.08, 0.03])

    def run(h: float) -> tuple[np.ndarray, float]:
        X, X_hat, b = np.eye(3), expm(SO3.hat([1, -0.5, 0.8])), np.zeros(3)
        for k in range(round(10 / h)):
            t = k * h
            omega = np.array([0.3 * np.sin(t), 0.2 * np.cos(2 * t), 0.4])
            flat, b = step(X_hat, b, omega + bias, TWO @ X, h)
            X_hat = flat.reshape(3, 3)
            middle = np.array([0.3 * np.sin(t + h / 2), 0.2 * np.cos(2 * t + h), 0.4])
            X = X @ expm(h * SO3.hat(middle))
        return b, float(np.linalg.norm(SO3.vee(logm(X.T @ X_hat).real)))

    coarse, fine = run(0.02), run(0.01)
    limit = 2 * fine[0] - coarse[0]
    assert limit == pytest.approx([0.0617713088, -0.1167214721, 0.1086612906], abs=5e-6)
    assert 2 * fine[1] - coarse[1] == pytest.approx(0.1390534, abs=5e-6)


def test_poles_and_covariance() -> None:
    observer = attitude_filter()
    wanted = [-0.0789205 + 0.1822959j, -0.0789205 - 0.1822959j, -1.3345304, -0.3076286, -1.5, -0.3]
    assert np.sort_complex(observer.poles) == pytest.approx(np.sort_complex(wanted), abs=1e-6)
    deviation = np.sqrt(np.diag(observer.covariance(step=0.02, direction_noise=0.02, rate_noise=0.01)))
    assert deviation[:3] == pytest.approx([0.0024572, 0.0022804, 0.0037173], rel=1e-4)
    assert deviation[3:] == pytest.approx([7.2048e-4, 7.1212e-4, 6.6353e-4], rel=1e-4)
    with pytest.raises(InputError, match="shorter step"):
        observer.covariance(step=3.0, direction_noise=0.02)


def test_pose_from_landmarks_does_not_depend_on_the_motion() -> None:
    se3, points = lc.group("se3"), np.array([(1, 0, 0), (0, 2, 0), (0, 0, 1.5), (-1, -1, 0.5)])
    weights = np.array([1, 0.8, 0.6, 0.5])
    step = interpreted(lc.observer(se3, points=points, weights=weights, k_p=1, k_i=0))
    c = np.c_[points, np.ones(4)]

    def pose(turn: list, place: list) -> np.ndarray:
        X = np.eye(4)
        X[:3, :3], X[:3, 3] = expm(SO3.hat(turn)), place
        return X

    def run(h: float, speed: float) -> tuple[float, float]:
        X, X_hat = pose([0.3, 0.2, -0.1], [0.5, -0.3, 0.2]), pose([-0.5, 0.6, 0.7], [-0.5, 0.8, 0])

        def cost() -> float:
            return float(weights @ np.sum((c @ np.linalg.inv(X).T @ X_hat.T - c) ** 2, axis=1) / 2)

        first = cost()
        for k in range(round(5 / h)):
            u = speed * np.array([0.3, 0.2, 0.1, 0.5, -0.2, np.sin(k * h)])
            flat, _ = step(X_hat, np.zeros(6), u, (c @ np.linalg.inv(X).T)[:, :3], h)
            X_hat, X = flat.reshape(4, 4), X @ expm(h * se3.hat(u))
        return first, cost()

    for speed in (0.0, 1.0):
        (first, coarse), (_, fine) = run(0.01, speed), run(0.005, speed)
        assert first == pytest.approx(6.4471858, rel=1e-7)
        assert 2 * fine - coarse == pytest.approx(7.7335e-8, rel=1e-2)  # a step of first order: its limit


def test_one_direction_is_refused_unless_it_is_said() -> None:
    with pytest.raises(InputError, match="determine 2 of 3"):
        lc.observer("so3", directions=[[0, 0, 1]])
    reduced = lc.observer("so3", directions=[[0, 0, 1]], k_i=0.3, reduced=True)
    assert np.min(np.abs(np.linalg.eigvalsh(reduced.A))) < 1e-12
    with pytest.raises(InputError, match="no steady covariance"):
        reduced.covariance(step=0.01, direction_noise=0.01)
    with pytest.raises(InputError, match="points are seen on SE"):
        lc.observer("so3", points=[[0, 0, 1]])


def feedback_run(law: Any, X: np.ndarray, omega: list, z: np.ndarray, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    function = interpreted(law)

    def polar(M: np.ndarray) -> np.ndarray:
        U, _, V = np.linalg.svd(M)
        return U @ V

    def rate(_: float, s: np.ndarray) -> np.ndarray:
        R, R_hat, w = polar(s[:9].reshape(3, 3)), polar(s[9:18].reshape(3, 3)), s[18:]
        force, u = function(R_hat, z @ R)
        turn = np.linalg.solve(INERTIA, np.cross(INERTIA @ w, w) + force)
        return np.concatenate([(R @ SO3.hat(w)).ravel(), (R_hat @ SO3.hat(u)).ravel(), turn])

    start = np.concatenate([X.ravel(), X.ravel(), omega])
    end = solve_ivp(rate, [0, seconds], start, rtol=1e-9, atol=1e-11).y[:, -1]
    return polar(end[:9].reshape(3, 3)), end[18:]


def test_two_directions_stop_the_body_without_a_rate_sensor() -> None:
    target = expm(SO3.hat([0.3, -0.2, 0.5]))
    law = lc.output_feedback_law("so3", directions=TWO, target=target, r=[3, 2], g=[4, 3], G=1.5)
    X, omega = feedback_run(law, expm(SO3.hat([-0.8, 1, 0.4])), [0.2, -0.3, 0.1], TWO, 20)
    assert omega == pytest.approx([0.0117940655, -0.0049228097, -0.0065749043], abs=1e-6)
    assert np.max(np.abs(X - target)) < 0.05
    assert law.offset(X, omega, inertia=INERTIA) == 0


def test_one_direction_keeps_a_momentum_and_misses() -> None:
    law = lc.output_feedback_law("so3", directions=[[0, 0, 1]], target_directions=[[0, 0.6, 0.8]], r=3, g=4, G=1.5)
    X, omega = expm(SO3.hat([0.9, 0, 0])), [0.3, 1.1, 1.6]
    offset = law.offset(X, omega, inertia=INERTIA)
    assert offset.p == pytest.approx(2.513977576, rel=1e-9)
    assert offset == pytest.approx(0.3585656, abs=1e-6)
    assert offset.spin == pytest.approx(1.6802515, rel=1e-6)
    R, w = feedback_run(law, X, omega, np.array([[0, 0, 1.0]]), 4)
    y = R.T[:, 2]
    assert y @ INERTIA @ w == pytest.approx(offset.p, rel=1e-7)  # conserved along the way, not only in the end
    still = law.offset(X, [0, 0, 0], inertia=INERTIA)
    assert still == pytest.approx(0, abs=1e-6)


def test_pointing_law_damps_what_it_says() -> None:
    """d/dt of k_p (1 - y.b) + omega.I omega/2 is -omega.K_d omega, and the free spin keeps y.I omega."""
    rng, K_d = np.random.default_rng(2), np.diag([2.0, 3, 4])
    b = np.array([0, 0.6, 0.8])
    for spin in ("damped", "free"):
        law = interpreted(lc.pointing_law(axis=b, inertia=INERTIA, k_p=4, K_d=K_d, gyroscopic="none", spin=spin))
        for _ in range(4):
            y, omega = rng.normal(size=(2, 3))
            y /= np.linalg.norm(y)
            (torque,) = law(y, omega)
            turn = np.linalg.solve(INERTIA, np.cross(INERTIA @ omega, omega) + torque)
            rate = -4 * np.cross(y, omega) @ b + omega @ INERTIA @ turn
            seen = omega - (y @ omega) * y if spin == "free" else omega
            assert rate == pytest.approx(-seen @ K_d @ seen, abs=1e-12)
            if spin == "free":
                momentum = np.cross(y, omega) @ INERTIA @ omega + y @ INERTIA @ turn
                assert momentum == pytest.approx(0, abs=1e-12)
    law = lc.pointing_law(axis=b, k_p=4, K_d=5, z=[0, 0, 2])
    run = lc.closed_loop("so3", law=law, inertia=INERTIA, X0=expm(SO3.hat([1, 0.3, 0])), t=[0, 20, 40], step=0.02)
    assert run.X[-1].T[:, 2] == pytest.approx(b, abs=1e-4)
    with pytest.raises(InputError, match="needs the inertia"):
        lc.pointing_law(axis=b, gyroscopic="cancel")


def test_inertia_of_mass_points() -> None:
    rng = np.random.default_rng(4)
    m, p = rng.uniform(0.5, 2, 7), rng.normal(size=(7, 3))
    found = lc.inertia_from_masses(m, p)
    r = p - np.average(p, axis=0, weights=m)
    J = sum(a * (x @ x * np.eye(3) - np.outer(x, x)) for a, x in zip(m, r, strict=True))
    assert found.inertia == pytest.approx(J)
    assert found.axes.T @ J @ found.axes == pytest.approx(np.diag(found.moments), abs=1e-12)
    assert np.linalg.det(found.axes) == pytest.approx(1)
    assert np.all(np.diff(found.moments) > 0)
    assert found.unique_axes
    cube = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    assert not lc.inertia_from_masses([1] * 8, cube).unique_axes
    with pytest.raises(InputError, match="one line"):
        lc.inertia_from_masses([1, 2], [[0, 0, 0], [1, 0, 0]])


def test_on_a_complex_group_the_body_sees_vectors_of_the_algebra() -> None:
    """SU(2) covers SO(3): with the same vectors its observer is that of the rotations, step by step."""
    su2, so3 = lc.group("su2"), lc.group("so3")
    options: dict[str, Any] = {
        "directions": [[0, 0, 1], [0.6, 0, 0.8]],
        "weights": [1, 0.5],
        "k_p": 1.2,
        "k_i": 0.3,
    }
    spin, turn = lc.observer(su2, **options), lc.observer(so3, **options)
    np.testing.assert_allclose(spin.A, turn.A, atol=1e-15)
    one, other = lc.build(spin).observer, lc.build(turn).observer
    rng = np.random.default_rng(4)
    for _ in range(5):
        v, bias, u = rng.normal(size=(3, 3))
        y = rng.normal(size=(2, 3))
        U, R = (expm(np.einsum("a,aij->ij", v, group.basis)) for group in (su2, so3))
        U, b = one(U, bias, u, y, 0.05)
        R, c = other(R, bias, u, y, 0.05)
        np.testing.assert_allclose(b, c, atol=1e-14)
        # tr(U e_b U^+ e_a^+)/tr(e_a e_a^+): the matrix of Ad_U, which is the rotation
        Ad = 2 * np.einsum("ij,bjk,lk,ail->ab", U, su2.basis, U.conj(), su2.basis.conj()).real
        np.testing.assert_allclose(Ad, R, atol=1e-14)


def test_a_loop_on_su2_with_an_observer_comes_home() -> None:
    su2 = lc.group("su2")
    law = lc.tracking_law(su2, inertia=[1, 2, 3], error="frobenius", gains={"K_p": 4, "K_d": 5})
    watching = lc.observer(su2, directions=[[0, 0, 1], [0.6, 0, 0.8]], k_p=2)
    run = lc.closed_loop(
        su2,
        inertia=[1, 2, 3],
        law=law,
        reference=lc.reference(su2, ["t/5", "sin(t)/3", "cos(t)/4"]),
        observer=watching,
        states={"X_hat": expm(np.einsum("a,aij->ij", [0.4, -0.3, 0.2], su2.basis))},
        t=np.linspace(0, 20, 5),
        sample=0.05,
    )
    assert run.outputs["W"][-1] < 1e-3 * run.outputs["W"][0]


def test_vectors_of_complex_groups_are_refused_where_they_fit_not() -> None:
    with pytest.raises(InputError, match="6 of 8 components"):
        lc.observer("su3", directions=[[1, 2, 3, 4, 5, 6, 7, 9]])
    with pytest.raises(InputError, match="vectors of the algebra"):
        lc.observer("su2", points=[[1, 2, 3]])
    with pytest.raises(ShapeError, match="give 8"):
        lc.observer("su3", directions=[[1, 2, 3]])
