"""Attitude laws of Geyer's paper, corrected, against closed forms, the published targets and scipy."""

from __future__ import annotations

import warnings

import mpmath
import numpy as np
import pytest
import sympy as sp
from kernel_calls import interpreted
from scipy.integrate import solve_ivp
from scipy.linalg import expm, logm
from scipy.spatial.transform import Rotation

from lie_codegen.control.attitude import attitude_linearisation, attitude_region, cross_term_bound, gains_for_response
from lie_codegen.control.attitude_law import attitude_law
from lie_codegen.control.attitude_lyapunov import attitude_lyapunov
from lie_codegen.errors import InertiaWarning, InputError
from lie_codegen.groups.conventions import rotation_from_quaternion
from lie_codegen.groups.maps.quaternion import with_quaternion
from lie_codegen.groups.maps.rotation_log import rotation_log
from lie_codegen.kernel.dual import decimal_arithmetic

J = np.diag([6.0, 3, 1])
pytestmark = pytest.mark.filterwarnings("ignore::lie_codegen.errors.InertiaWarning")


def hat(w: np.ndarray) -> np.ndarray:
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def closed_loop(law, inertia, R, w, t, **options):
    def rate(_, x):
        R, w = x[:9].reshape(3, 3), x[9:]
        torque = law(R, w)[0]
        return np.concatenate([(R @ hat(w)).ravel(), np.linalg.solve(inertia, torque - np.cross(w, inertia @ w))])

    start = np.concatenate([R.ravel(), w])
    return solve_ivp(rate, (0, t), start, method="DOP853", rtol=1e-12, atol=1e-13, **options)


def test_published_trajectory_of_the_second_order_law() -> None:
    law = interpreted(attitude_law("pd", inertia=J, k_p=4, k_d=6, gyroscopic="cancel"))
    run = closed_loop(law, J, expm(hat(np.array([1.2, -0.8, 1]))), np.array([0.3, -0.4, 0.5]), 10)
    R, w = run.y[:9, -1].reshape(3, 3), run.y[9:, -1]
    theta = Rotation.from_matrix(R).as_rotvec()
    np.testing.assert_allclose(theta, [0.0101356443745298, 7.72832249593381e-05, 7.32487101341846e-04], atol=1e-9)
    assert law(R, w)[1][0] == pytest.approx(2.06713158951836e-4, abs=1e-11)


def test_published_eigenvalues_of_the_linearisation() -> None:
    found = attitude_linearisation(inertia=J, k_p=4, k_d=6)
    expected = [-0.5 + 0.6455j, -0.5 - 0.6455j, -1 + 0.5774j, -1 - 0.5774j, -0.7639, -5.2361]
    for value in expected:
        assert np.min(np.abs(found - value)) < 5e-5


@pytest.mark.parametrize("gyroscopic", ["cancel", "none", "double"])
def test_lyapunov_rate_is_minus_kd_omega_squared_for_every_variant(gyroscopic: str) -> None:
    law = interpreted(attitude_law("pd", inertia=J, k_p=4, k_d=6, gyroscopic=gyroscopic))
    rng = np.random.default_rng(0)
    c = {"cancel": 1, "none": 0, "double": -1}[gyroscopic]
    for _ in range(5):
        theta, w = rng.normal(size=(2, 3))
        R = expm(hat(theta))
        torque, V, V_dot = law(R, w)
        by_hand = c * np.cross(w, J @ w) - 4 * np.real([logm(R)[2, 1], logm(R)[0, 2], logm(R)[1, 0]]) - 6 * w
        np.testing.assert_allclose(torque, by_hand, atol=1e-11)
        accel = np.linalg.solve(J, torque - np.cross(w, J @ w))
        h = 1e-4
        ahead, behind = (law(R @ expm(s * hat(w)), w + s * accel)[1][0] for s in (h, -h))
        assert (ahead - behind) / (2 * h) == pytest.approx(V_dot[0], rel=1e-6)
        assert V_dot[0] == pytest.approx(-6 * w @ w, rel=1e-14)
        assert V[0] > 0


def test_gyroscopic_term_of_the_printed_law_is_off_at_the_stored_point() -> None:
    theta, w = np.array([1.2, -0.8, 1]), np.array([0.3, -0.4, 0.5])
    true, printed = (
        interpreted(attitude_law("pd", inertia=J, k_p=4, k_d=6, gyroscopic=g))(expm(hat(theta)), w)[0]
        for g in ("cancel", "double")
    )
    np.testing.assert_allclose(printed - true, [-0.8, -1.5, -0.72], atol=1e-12)


def test_first_order_law_follows_its_closed_form() -> None:
    law = interpreted(attitude_law("p", k_p=0.7))
    theta = np.array([2.0, -1.5, 1.0])
    run = solve_ivp(
        lambda _, x: (x.reshape(3, 3) @ hat(law(x)[0])).ravel(),
        (0, 3),
        expm(hat(theta)).ravel(),
        rtol=1e-12,
        atol=1e-13,
    )
    np.testing.assert_allclose(run.y[:, -1].reshape(3, 3), expm(np.exp(-2.1) * hat(theta)), atol=1e-10)


def test_reduced_law_follows_its_closed_form_and_sees_only_its_direction() -> None:
    z = np.array([0.6, 0, 0.8])
    law = interpreted(attitude_law("reduced", k_p=0.7, z=("3/5", 0, "4/5")))
    R0 = expm(hat(np.array([0.9, -0.4, 1.1])))
    run = solve_ivp(
        lambda _, x: (x.reshape(3, 3) @ hat(law(x.reshape(3, 3).T @ z)[0])).ravel(), (0, 2), R0.ravel(),
        rtol=1e-12, atol=1e-13,
    )  # fmt: skip
    y = R0.T @ z
    normal = np.cross(z, y) / np.linalg.norm(np.cross(z, y))
    alpha = np.arccos(z @ y)
    expected = R0 @ expm(alpha * (1 - np.exp(-1.4)) * hat(normal))
    np.testing.assert_allclose(run.y[:, -1].reshape(3, 3), expected, atol=1e-10)
    np.testing.assert_allclose(law(z)[0], 0, atol=1e-16)
    np.testing.assert_allclose(np.concatenate(law(-z)), 0, atol=1e-16)  # the antipode: no way is the shorter
    np.testing.assert_allclose(law(y)[1:], [[alpha**2 / 2], [-0.7 * alpha**2]], rtol=1e-13)


@pytest.mark.parametrize(
    "angle", ["0", "1e-12", "1e-5", "0.1", "0.1999", "0.2003", "1", "3", "3.14159", "3.1415926535"]
)
def test_logarithm_keeps_its_digits_from_0_to_180_degrees(angle: str) -> None:
    """Against 50-digit arithmetic of the closed form, from the exact matrix rounded to double."""
    kernel = attitude_law("p", k_p=1)
    law = interpreted(kernel)
    axis = np.array([2.0, -1, 0.5]) / np.linalg.norm([2, -1, 0.5])
    with mpmath.workdps(50):
        theta = mpmath.mpf(angle)
        n = mpmath.matrix([mpmath.mpf(float(a)) for a in axis])
        n = n / mpmath.norm(n)
        K = mpmath.matrix([[0, -n[2], n[1]], [n[2], 0, -n[0]], [-n[1], n[0], 0]])
        R = mpmath.eye(3) + mpmath.sin(theta) * K + (1 - mpmath.cos(theta)) * K * K
        exact = np.array([[float(R[i, j]) for j in range(3)] for i in range(3)])
        expected = [float(theta * n[i]) for i in range(3)]
    np.testing.assert_allclose(-law(exact)[0], expected, rtol=0, atol=4e-16 * max(1.0, float(angle)))


def test_logarithm_at_180_degrees_picks_one_way_and_has_norm_pi() -> None:
    law = interpreted(attitude_law("p", k_p=1))
    for axis in (np.array([1.0, 0, 0]), np.array([0, -1.0, 0]), np.array([0.6, 0, -0.8])):
        R = 2 * np.outer(axis, axis) - np.eye(3)
        theta = -law(R)[0]
        assert np.linalg.norm(theta) == pytest.approx(np.pi, abs=1e-15)
        np.testing.assert_allclose(expm(hat(theta)), R, atol=1e-14)


def test_no_unwinding() -> None:
    """340 degrees goes the short way, 20 degrees back."""
    law = interpreted(attitude_law("p", k_p=1))
    theta = -law(expm(hat(np.radians([0, 0, 340.0]))))[0]
    np.testing.assert_allclose(theta, np.radians([0, 0, -20.0]), atol=1e-14)


def test_logarithm_derivative_matches_the_jacobian_of_proposition_11() -> None:
    """theta' = A(theta) omega, A = 1 + theta^/2 + (1 - (a/2) cot(a/2)) theta^2/a^2; also near 0 and near pi."""
    bound = {"inertia": J, "k_p": 4, "k_d": 6}
    with_cross, without = (
        interpreted(attitude_lyapunov(**bound, epsilon=e, gyroscopic="none", name=f"v{i}"))
        for i, e in enumerate(("1/8", "1/16"))
    )
    rng = np.random.default_rng(1)
    for size in (1e-9, 1e-3, 0.5, 2.0, 3.1):
        n = rng.normal(size=3)
        theta, w = size * n / np.linalg.norm(n), rng.normal(size=3)
        K = hat(theta)
        A = np.eye(3) + K / 2 + (1 - size / 2 / np.tan(size / 2)) / size**2 * (K @ K)
        R = expm(K)
        crossing = 16 * (with_cross(R, w)[1][0] - without(R, w)[1][0])
        force = -np.cross(w, J @ w) - 4 * theta - 6 * w
        assert crossing == pytest.approx((A @ w) @ J @ w + theta @ force, abs=3e-12)


def test_cross_term_bound_makes_a_strict_lyapunov_function() -> None:
    bound = cross_term_bound(inertia=J, k_p=4, k_d=6)
    function = interpreted(attitude_lyapunov(inertia=J, k_p=4, k_d=6, epsilon=0.999 * bound))
    rng = np.random.default_rng(2)
    for _ in range(200):
        n = rng.normal(size=3)
        theta = n / np.linalg.norm(n) * rng.uniform(0, 3.14)
        V, V_dot = function(expm(hat(theta)), rng.normal(size=3) * rng.uniform(0, 3))
        assert V[0] > 0 > V_dot[0]


def test_printed_region_of_attraction_fails_and_the_corrected_one_says_so() -> None:
    """G20: inside (19) as printed, and |theta| reaches pi at t = 3.66646712292794."""
    w = np.array([0.9, 0, 0])
    assert 6 * w @ w <= np.pi**2 / 2
    region = attitude_region([0, 0, 0], w, inertia=J, k_p=0.05)
    assert not region.inside
    law = interpreted(attitude_law("pd", inertia=J, k_p=0.05, k_d=0.1))

    def reaches(_, x):
        return np.trace(x[:9].reshape(3, 3)) + 1 - 1e-9

    reaches.terminal = True
    run = closed_loop(law, J, np.eye(3), w, 5, events=reaches)
    assert run.t_events[0][0] == pytest.approx(3.66646712292794, abs=1e-4)
    assert attitude_region([1.2, -0.8, 1], [0.3, -0.4, 0.5], inertia=J, k_p=4).inside


def test_gains_for_a_wanted_response() -> None:
    inertia = np.array([[3.0, 0.2, 0], [0.2, 2.5, 0.1], [0, 0.1, 2]])
    gains = gains_for_response(inertia, bandwidth=2, damping=0.5)
    np.testing.assert_allclose((np.trace(gains.K_p) * np.eye(3) - gains.K_p) / 2, gains.stiffness, atol=1e-12)
    M = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.linalg.solve(inertia, np.hstack([gains.stiffness, gains.K_d]))]])
    np.testing.assert_allclose(np.abs(np.linalg.eigvals(M)), 2, atol=1e-12)
    np.testing.assert_allclose(np.linalg.eigvals(M).real, -1, atol=1e-12)


def test_logarithm_in_forty_digits_is_the_same_body() -> None:
    ops = decimal_arithmetic(40)
    with mpmath.workdps(45):
        theta = mpmath.mpf("0.3")
        exact = {"c": str(mpmath.cos(theta)), "s": str(mpmath.sin(theta))}
    c, s = (sp.Float(exact[key], 40) for key in ("c", "s"))
    found = rotation_log(ops, [[c, -s, 0], [s, c, 0], [0, 0, 1]])
    assert abs(found[2] - sp.Rational(3, 10)) < 1e-17  # the series of the body is made for doubles
    assert found[0] == found[1] == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"kind": "pid"}, "choose one of p, pd, reduced"),
        ({"kind": "pd", "k_d": 1}, "needs inertia and k_d"),
        ({"kind": "pd", "inertia": [1, 1, -1], "k_d": 1}, "not positive definite"),
        ({"kind": "pd", "inertia": [2, 2, 1], "k_d": -1}, "k_d = -1 must be positive"),
        ({"kind": "pd", "inertia": [2, 2, 1], "k_d": 1, "gyroscopic": "on"}, "choose one of cancel, none, double"),
        ({"kind": "p", "inertia": [2, 2, -1]}, "not positive definite"),
        ({"kind": "reduced", "gyroscopic": "on"}, "choose one of cancel, none, double"),
        ({"kind": "reduced", "z": (0, 0, 0)}, "z is zero"),
    ],
)
def test_wrong_input_is_refused(arguments: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        attitude_law(arguments.pop("kind"), **arguments)


def test_one_call_serves_all_kinds() -> None:
    X = Rotation.from_rotvec([0.3, -0.2, 0.4]).as_matrix()
    for kind, place in (("p", X), ("reduced", X[2])):
        law = attitude_law(kind, inertia=[3, 2, 2], k_p=4, k_d=6, gyroscopic="cancel")
        np.testing.assert_array_equal(interpreted(law)(place)[0], interpreted(attitude_law(kind, k_p=4))(place)[0])


def test_a_legal_metric_of_no_rigid_body_warns_and_a_body_does_not() -> None:
    with pytest.warns(InertiaWarning, match="triangle"):
        attitude_law("pd", inertia=J, k_p=4, k_d=6)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        attitude_law("pd", inertia=[3, 2, 1], k_p=4, k_d=6)


def test_quaternion_input_gives_the_same_command_and_its_order_must_be_named() -> None:
    law = attitude_law("pd", inertia=[3, 2, 2], k_p=4, k_d=6)
    rng = np.random.default_rng(0)
    for order, take in (("scalar_first", [3, 0, 1, 2]), ("scalar_last", [0, 1, 2, 3])):
        by_quaternion = interpreted(with_quaternion(law, order=order))
        for _ in range(3):
            R, w = Rotation.random(random_state=rng), rng.normal(size=3)
            q = R.as_quat()[take]
            expected = interpreted(law)(R.as_matrix(), w)[0]
            np.testing.assert_allclose(by_quaternion(q, w)[0], expected, atol=1e-13)
            np.testing.assert_allclose(by_quaternion(-q, w)[0], expected, atol=1e-13)  # no unwinding
            np.testing.assert_allclose(rotation_from_quaternion(q, order=order), R.as_matrix(), atol=1e-15)
    with pytest.raises(InputError, match="the quaternion order is not given"):
        with_quaternion(law)
    with pytest.raises(InputError, match="'wzyx'; name it"):
        rotation_from_quaternion([1, 0, 0, 0], order="wzyx")
