"""Exact mechanics: Euler-Poincare, the Levi-Civita connection on algebras, in coordinates and on spheres."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from kernel_calls import interpreted
from scipy.integrate import solve_ivp

from lie_codegen.errors import InputError
from lie_codegen.groups.catalogue_load import group as load
from lie_codegen.groups.definition import from_matrices
from lie_codegen.kernel.casadi_arithmetic import function_of
from lie_codegen.mechanics.connection import connection, metric_defect, nabla, symmetric_product, torsion
from lie_codegen.mechanics.euler_poincare import euler_poincare, velocity_symbols
from lie_codegen.mechanics.kernels import euler_poincare_kernel, spatial_momentum_kernel
from lie_codegen.vehicles.manipulator import manipulator_law
from lie_codegen.vehicles.riemannian import christoffel, coriolis, covariant_derivative, covariant_derivative_of_form
from lie_codegen.vehicles.sphere import sphere_gain_bound, sphere_law
from lie_codegen.vehicles.spheres import covariant_derivative as sphere_derivative
from lie_codegen.vehicles.spheres import feedforward, projection, transport


def so4():
    labels, matrices = [], []
    for i in range(4):
        for j in range(i + 1, 4):
            m = sp.zeros(4, 4)
            m[i, j], m[j, i] = -1, 1
            labels.append(f"r{i}{j}")
            matrices.append(m)
    return from_matrices("so4", labels, matrices)


def unit(n: int, i: int) -> list[int]:
    return [int(i == j) for j in range(n)]


def test_connection_on_so3_is_the_published_one() -> None:
    algebra, inertia = load("so3").algebra, sp.diag(6, 3, 1)
    expected = {
        (1, 2): (0, 0, -1), (2, 1): (0, 0, -2), (2, 3): (sp.Rational(1, 3), 0, 0), (3, 2): (sp.Rational(-2, 3), 0, 0),
        (3, 1): (0, sp.Rational(4, 3), 0), (1, 3): (0, sp.Rational(1, 3), 0),
        (1, 1): (0, 0, 0), (2, 2): (0, 0, 0), (3, 3): (0, 0, 0),
    }  # fmt: skip
    for (i, j), value in expected.items():
        assert tuple(nabla(algebra, inertia, unit(3, i - 1), unit(3, j - 1))) == value


@pytest.mark.parametrize("name", ["so3", "se2", "se3", "sl2", "h3", "su2", "so4"])
def test_connection_has_no_torsion_and_keeps_the_metric_exactly(name: str) -> None:
    algebra = (so4() if name == "so4" else load(name)).algebra
    n = algebra.dim
    inertia = sp.diag(*range(2, n + 2)) + sp.Matrix(n, n, lambda i, j: sp.Rational(int(abs(i - j) == 1), 3))
    table = connection(algebra, inertia)
    assert torsion(algebra, table) == 0
    assert metric_defect(inertia, table) == 0


def test_connection_on_se3_has_24_entries() -> None:
    table = connection(load("se3").algebra, sp.diag(2, 3, 4, 5, 6, 8))
    assert sum(1 for matrix in table for entry in matrix.flat() if entry != 0) == 24


@pytest.mark.parametrize("name", ["so3", "se3", "sl2"])
def test_euler_poincare_is_the_geodesic_equation_and_the_kernel(name: str) -> None:
    group = load(name)
    n = group.dim
    inertia = sp.diag(*range(2, n + 2)) + sp.Matrix(n, n, lambda i, j: sp.Rational(int(abs(i - j) == 1), 3))
    xi = velocity_symbols(group.algebra)
    rate = euler_poincare(group.algebra, inertia, xi)
    geodesic = nabla(group.algebra, inertia, xi, xi)
    assert all(sp.expand(a + b) == 0 for a, b in zip(rate, geodesic, strict=True))
    product = symmetric_product(group.algebra, inertia, xi, xi)
    assert all(sp.expand(a - 2 * b) == 0 for a, b in zip(product, geodesic, strict=True))
    x = np.random.default_rng(0).normal(size=n)
    kernel = euler_poincare_kernel(group, np.array(inertia.tolist(), dtype=float))
    value = np.array(function_of(kernel)(x, np.zeros(n))[0]).ravel()
    np.testing.assert_allclose(value, [float(e.subs(dict(zip(xi, x, strict=True)))) for e in rate], rtol=1e-13)


def test_kirchhoff_equations() -> None:
    """(27): J W' = J W x W + M V x V, M V' = M V x W."""
    J, M = np.diag([2.0, 3, 4]), np.diag([5.0, 6, 8])
    kernel = euler_poincare_kernel(load("se3"), [2, 3, 4, 5, 6, 8])
    W, V = np.random.default_rng(1).normal(size=(2, 3))
    value = np.array(function_of(kernel)(np.concatenate([W, V]), np.zeros(6))[0]).ravel()
    by_hand = [np.cross(J @ W, W) + np.cross(M @ V, V), np.cross(M @ V, W)]
    np.testing.assert_allclose(value, np.concatenate([by_hand[0] / [2, 3, 4], by_hand[1] / [5, 6, 8]]), atol=1e-14)


def test_spatial_momentum_is_kept_only_by_the_right_sign() -> None:
    """Energy and |I w| are kept under both signs of w x I w; R I w discriminates (Geyer (3) against (5))."""
    group = load("so3")
    J = np.diag([6.0, 4, 3])
    momentum = function_of(spatial_momentum_kernel(group, J))

    def drift(sign: float) -> float:
        def rate(_, x):
            R, w = x[:9].reshape(3, 3), x[9:]
            return np.concatenate([(R @ group.hat(w)).ravel(), sign * np.linalg.solve(J, np.cross(J @ w, w))])

        start = np.concatenate([np.eye(3).ravel(), [1.0, 0.8, -0.5]])
        run = solve_ivp(rate, (0, 5), start, rtol=1e-11, atol=1e-12, method="DOP853")
        values = [np.array(momentum(run.y[:9, k], run.y[9:, k])).ravel() for k in (0, -1)]
        return float(np.linalg.norm(values[1] - values[0]))

    assert drift(1) < 1e-9
    assert drift(-1) > 1


def test_christoffel_symbols_of_the_sphere_and_covariant_derivatives() -> None:
    theta, phi = q = sp.symbols("theta phi", real=True)
    M = sp.diag(1, sp.sin(theta) ** 2)
    gamma = christoffel(M, q)
    assert sp.simplify(gamma[0][1, 1] + sp.sin(theta) * sp.cos(theta)) == 0
    assert sp.simplify(gamma[1][0, 1] - sp.cos(theta) / sp.sin(theta)) == 0
    X, Y = [sp.cos(phi), theta], [theta * phi, sp.sin(theta)]
    lowered = list(M * sp.Matrix(Y))
    form = covariant_derivative_of_form(gamma, q, X, lowered)
    vector = list(M * sp.Matrix(covariant_derivative(gamma, q, X, Y)))
    assert all(sp.simplify(sp.expand_trig(sp.expand(a - b))) == 0 for a, b in zip(form, vector, strict=True))
    v = sp.symbols("v1 v2")
    defect = sp.Matrix(2, 2, lambda i, j: sum(sp.diff(M[i, j], x) * s for x, s in zip(q, v, strict=True)))
    C = coriolis(M, q, v)
    assert sp.simplify((defect - 2 * C) + (defect - 2 * C).T) == sp.zeros(2, 2)


def test_geodesics_of_so3_in_euler_angles_are_euler_poincare() -> None:
    """Christoffel symbols of the ZYX chart with I = diag(6, 3, 1) against the Euler equations, at a point."""
    a, b, c = q = sp.symbols("a b c", real=True)
    Jac = sp.Matrix([[-sp.sin(b), 0, 1], [sp.sin(c) * sp.cos(b), sp.cos(c), 0], [sp.cos(c) * sp.cos(b), -sp.sin(c), 0]])
    inertia = sp.diag(6, 3, 1)
    M = Jac.T * inertia * Jac
    point = {a: 0.3, b: -0.4, c: 0.7}
    v = np.array([0.5, -0.2, 0.9])
    C = coriolis(M, q, v)
    bias = np.array((C * sp.Matrix(v)).subs(point), dtype=float).ravel()
    accel = -np.linalg.solve(np.array(M.subs(point), dtype=float), bias)
    J = np.array(Jac.subs(point), dtype=float)
    J_dot = np.array(
        sum((sp.diff(Jac, x) * s for x, s in zip(q, v, strict=True)), sp.zeros(3, 3)).subs(point), dtype=float
    )
    w = J @ v
    np.testing.assert_allclose(J @ accel + J_dot @ v, np.cross(np.diag([6.0, 3, 1]) @ w, w) / [6, 3, 1], atol=1e-13)


def test_sphere_transport_is_compatible_and_lemma_5_1_needs_its_signs_flipped() -> None:
    rng = np.random.default_rng(0)
    q, r = (x / np.linalg.norm(x) for x in rng.normal(size=(2, 3)))
    v, w = (np.cross(x, rng.normal(size=3)) for x in (q, r))
    a = rng.normal(size=3)
    T = np.array(transport(q, r), dtype=float)
    np.testing.assert_allclose(T @ w, np.cross(np.cross(r, w), q), atol=1e-15)
    differential, other = np.array(projection(q), dtype=float) @ (-r), np.array(projection(r), dtype=float) @ (-q)
    np.testing.assert_allclose(other, -np.array(projection(r), dtype=float) @ T.T @ differential, atol=1e-15)
    a = a - (a @ r) * r  # the covariant acceleration of the reference
    force = np.array(feedforward(q, v, r, w, a), dtype=float).ravel()
    lemma = (q @ np.cross(r, w)) * np.cross(q, v) + np.cross(np.cross(r, a), q)
    np.testing.assert_allclose(force, lemma, atol=1e-14)
    law = function_of(sphere_law(2, k_p=3, k_d=2))
    value = np.array(law(q, v, r, w, a)[0]).ravel()
    np.testing.assert_allclose(value, lemma + 3 * (r - (q @ r) * q) - 2 * (v - T @ w), atol=1e-14)
    symbols = sp.symbols("q1:4")
    field = sphere_derivative(list(transport(symbols, r) * sp.Matrix(w)), symbols, v)
    at = np.array(field.subs(dict(zip(symbols, q, strict=True))), dtype=float).ravel()
    np.testing.assert_allclose(at, (q @ np.cross(r, w)) * np.cross(q, v), atol=1e-14)


@pytest.mark.parametrize("n", [1, 2, 4])
def test_sphere_law_converges_and_its_energy_decays_as_it_says(n: int) -> None:
    law = interpreted(sphere_law(n, k_p=2, k_d=2))
    A, B = np.eye(n + 1)[0], np.eye(n + 1)[1]

    def reference(t):
        s, ds, dds = np.sin(t), np.cos(t), -np.sin(t)
        c, z = np.cos(s), np.sin(s)
        r, e = c * A + z * B, -z * A + c * B
        return r, ds * e, dds * e - ds**2 * r

    def rate(t, x):
        q, v = x[: n + 1], x[n + 1 :]
        force = law(q, v, *reference(t))[0]
        return np.concatenate([v, force - (v @ v) * q])

    q0 = np.ones(n + 1) / np.sqrt(n + 1)
    v0 = 0.2 * (B - (B @ q0) * q0)
    assert sphere_gain_bound(q0, v0, *reference(0)[:2]) < 2
    run = solve_ivp(rate, (0, 14), np.concatenate([q0, v0]), rtol=1e-10, atol=1e-11, dense_output=True)
    W = [law(*np.split(run.sol(t), 2), *reference(t))[2][0] for t in (0, 14)]
    assert W[1] < 1e-6 * W[0]
    h, t = 1e-3, 1.0
    values = [law(*np.split(run.sol(s), 2), *reference(s))[2][0] for s in (t - h, t + h)]
    stated = law(*np.split(run.sol(t), 2), *reference(t))[3][0]
    assert (values[1] - values[0]) / (2 * h) == pytest.approx(stated, rel=1e-4)


@pytest.mark.parametrize("kind", ["augmented_pd", "computed_torque"])
def test_manipulator_laws_converge_with_the_stated_energy(kind: str) -> None:
    M = [["a + 2*b*cos(q2)", "c + b*cos(q2)"], ["c + b*cos(q2)", "c"]]
    parameters = {"a": 3, "b": "1/2", "c": 1, "g": "9.81"}
    law = function_of(
        manipulator_law(
            M, K_p=[9, 16], K_d=[5, 6], kind=kind, potential="g*(2*sin(q1) + sin(q1+q2)/2)", parameters=parameters
        )
    )

    def rate(t, x):
        q, v = x[:2], x[2:4]
        c2, s2 = np.cos(q[1]), np.sin(q[1])
        inertia = np.array([[3 + c2, 1 + c2 / 2], [1 + c2 / 2, 1]])
        bias = np.array([-s2 / 2 * (2 * v[0] * v[1] + v[1] ** 2), s2 / 2 * v[0] ** 2])
        gravity = 9.81 * np.array([2 * np.cos(q[0]) + np.cos(q.sum()) / 2, np.cos(q.sum()) / 2])
        r, w, a = (
            np.array([np.sin(t), np.cos(t)]),
            np.array([np.cos(t), -np.sin(t)]),
            np.array([-np.sin(t), -np.cos(t)]),
        )
        force, _, W_dot = (np.array(value).ravel() for value in law(q, v, r, w, a))
        return np.concatenate([v, np.linalg.solve(inertia, force - bias - gravity), W_dot])

    run = solve_ivp(rate, (0, 6), [1.0, -1, 0, 0, 0], rtol=1e-10, atol=1e-11)
    r, w = np.array([np.sin(6), np.cos(6)]), np.array([np.cos(6), -np.sin(6)])
    W0 = float(law([1.0, -1], [0, 0], [0, 1], [1, 0], [0, -1])[1])
    W1 = float(law(run.y[:2, -1], run.y[2:4, -1], r, w, [0, 0])[1])
    assert pytest.approx(run.y[4, -1], abs=1e-8) == W1 - W0  # the integral of W_dot
    assert W1 < 1e-3 * W0


def test_wrong_mechanics_is_refused() -> None:
    with pytest.raises(InputError, match="not positive definite"):
        euler_poincare_kernel(load("so3"), [1, -1, 1])
    with pytest.raises(InputError, match="not symmetric"):
        manipulator_law([["1", "q1"], ["0", "1"]], K_p=1, K_d=1)
    with pytest.raises(InputError, match="dimension"):
        sphere_law(0, k_p=1, k_d=1)
