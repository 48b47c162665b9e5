"""Values, first and second derivatives of exp, log and the Jacobians on a log grid of angles, against 66-digit arithmetic."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from angle_grid import ANGLES, point, relative_error
from kernel_calls import call, function, load
from multiprecision import fixed, oracle, to_floats, value_and_derivatives

GROUPS = ("so3", "su2", "se2", "se3", "sl2", "h3")
#: The right Jacobians are the left ones at -x, which the axiom suite holds them to.
CASES = [(name, k) for name in GROUPS for k in ("exp", "ljac", "ljac_inv")] + [("so3", "rjac"), ("so3", "rjac_inv")]


def derivatives(name: str, kernel_name: str) -> ca.Function:
    """(x, u, v) -> value, Df u, D^2 f (u, v), by CasADi's differentiation of the kernel's own expressions."""
    f = function(name, kernel_name)
    x, u, v = (ca.SX.sym(letter, load(name).dim) for letter in "xuv")
    value = f(x)
    first = ca.jtimes(value, x, u)
    return ca.Function("derivatives", [x, u, v], [value, first, ca.jtimes(first, x, v)])


@pytest.mark.parametrize(("name", "kernel_name"), CASES)
def test_values_and_derivatives_on_the_grid(name: str, kernel_name: str) -> None:
    rng = np.random.default_rng(7)
    ours, theirs = derivatives(name, kernel_name), oracle(load(name), kernel_name)
    for angle in ANGLES:
        # ad of sl2 turns by twice the angle: beyond 3 its inverse Jacobian is near its pole at 2 pi and ill-conditioned.
        if name == "sl2" and "inv" in kernel_name and angle > 2.9:
            angle = 2.9
        x = point(name, angle, rng)
        u, v = rng.normal(size=(2, x.size))
        expected = value_and_derivatives(theirs, x, u, v)
        for order, (a, b) in enumerate(zip(ours(x, u, v), expected, strict=True)):
            error = relative_error(np.array(a).ravel(), b)
            assert error < 1e-13, f"derivative {order} at angle {angle}: {error:.1e}"


@pytest.mark.parametrize("name", ["so3", "su2", "se2", "se3", "h3", "sl2"])
def test_log_undoes_exp_with_both_its_derivatives(name: str) -> None:
    """log(exp(x)) = x: first derivative the identity, second zero, with the oracle's exp in and reverse mode as well."""
    n = load(name).dim
    x, u, v = (ca.SX.sym(letter, n) for letter in "xuv")
    back = function(name, "log")(function(name, "exp")(x))
    first = ca.jtimes(back, x, u)
    both = ca.Function("both", [x, u, v], [first, ca.jtimes(first, x, v)])
    reverse = ca.Function("reverse", [x], [ca.hessian(ca.sumsqr(back), x)[0]])
    exact = oracle(load(name), "exp")
    rng = np.random.default_rng(11)
    for angle in ANGLES:
        # exp of sl2 is singular at the angle pi: derivatives of log grow like 1/(pi - angle) there.
        place = point(name, min(angle, 2.0) if name == "sl2" else angle, rng)
        X = to_floats(exact(fixed(place)))
        size = float(np.max(np.abs(place)))
        # The diagonal of a matrix of sl2 near the identity has lost the digits of x before log sees it.
        floor = 2e-16 if name == "sl2" else 0.0
        assert np.max(np.abs(np.array(function(name, "log")(X)).ravel() - place)) <= 1e-15 * size + floor
        a, b = rng.normal(size=(2, n))
        first_value, second_value = (np.array(part).ravel() for part in both(place, a, b))
        np.testing.assert_allclose(first_value, a, rtol=0, atol=2e-14 * np.linalg.norm(a))
        np.testing.assert_allclose(second_value, 0, atol=2e-14 * np.linalg.norm(a) * np.linalg.norm(b))
        np.testing.assert_allclose(np.array(reverse(place)), 2 * np.eye(n), atol=1e-13)


@pytest.mark.parametrize("name", ["so3", "se3"])
@pytest.mark.parametrize(
    "axis", [[1, 0, 0], [0, -1, 0], [0, 0, 1], [1, -1, 0], [-1, -2, 2], [1e-9, 1, -1e-9], [1, 1, 1]]
)
def test_half_turns_have_a_defined_logarithm(name: str, axis: list[float]) -> None:
    """The component of largest modulus, the first of equals, is positive; a rotation a rounding away has it too, or the other sign."""
    n = np.array(axis, dtype=float) / np.linalg.norm(axis)
    X = np.eye(load(name).degree)
    X[:3, :3] = 2 * np.outer(n, n) - np.eye(3)
    if name == "se3":
        X[:3, 3] = [0.3, -2.0, 5.0]
    x = call(name, "log", X)
    leading = n[int(np.argmax(np.abs(n) > np.max(np.abs(n)) * (1 - 1e-9)))]
    np.testing.assert_allclose(x[:3], np.pi * n * np.sign(leading), atol=1e-14)
    np.testing.assert_allclose(call(name, "exp", x), X, atol=5e-15)


def test_su2_reaches_a_full_turn() -> None:
    for angle in (3.2, 5.0, 6.0, 6.28, 2 * np.pi - 1e-6):
        axis = np.array([0.48, -0.6, 0.64])
        x = call("su2", "log", call("su2", "exp", angle * axis))
        np.testing.assert_allclose(x, angle * axis, rtol=1e-14 / min(1.0, 2 * np.pi - angle))
    np.testing.assert_allclose(call("su2", "log", -np.eye(2)), [2 * np.pi, 0, 0], rtol=1e-15)
    np.testing.assert_allclose(call("su2", "exp", [2 * np.pi, 0, 0]), -np.eye(2), atol=1e-15)


def test_sl2_elliptic_parabolic_and_hyperbolic() -> None:
    for x in ([0.2, 1.0, -2.0], [0.0, 1.5, 0.0], [1.0, 1.0, -1.0], [2.0, 0.5, 0.3], [6.0, 1.0, 2.0], [0.0, 0.0, 0.0]):
        np.testing.assert_allclose(call("sl2", "log", call("sl2", "exp", x)), x, atol=2e-15 * max(1, np.exp(abs(x[0]))))
    np.testing.assert_allclose(call("sl2", "exp", call("sl2", "log", -np.eye(2))), -np.eye(2), atol=1e-15)
    # A trace below -2 is the exponential of no real matrix.
    assert np.all(np.isnan(call("sl2", "log", np.diag([-2.0, -0.5]))))


@pytest.mark.parametrize("name", ["so3", "su2", "se2", "se3", "se_2_3", "sl2", "so4", "su3"])
def test_large_arguments_stay_finite(name: str) -> None:
    rng = np.random.default_rng(2)
    for size in (2 * np.pi, 5.0, 12.0):
        x = rng.normal(size=load(name).dim)
        x *= size / np.linalg.norm(x)
        X = call(name, "exp", x)
        assert np.all(np.isfinite(X))
        for jacobian in ("ljac", "rjac"):
            assert np.all(np.isfinite(call(name, jacobian, x)))
        assert np.all(np.isfinite(call(name, "log", X))) or name == "sl2"
