"""Averages on groups: published numbers, the Lagrangian route, Floquet exponents, orders of convergence, kernels."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lie_codegen as lc

J_TOP = (1.2, 0.9, 0.6)
TOML = """
name = "ugly"
labels = ["a", "b", "c"]
[matrices]
a = [[0, 0, 0], [0, 0, -2], [0, 2, 0]]
b = [[0, 0, 1], [0, 0, -1], [-1, 1, 0]]
c = [[0, -1, 0], [1, 0, -1], [0, 1, 0]]
"""


def top(**more):
    """A heavy top on a pivot shaken along the vertical: l = (.1, 0, .8), m = 1."""
    torque = ["0.8*G2", "0.1*G3 - 0.8*G1", "-0.1*G2"]
    given = {"damping": 0.2, "inertia": J_TOP, "advected": {"G": ("direction", (0, 0, 1))}}
    return lc.mechanical_system("so3", force=[f"9.81*({x})" for x in torque], inputs=[torque], **{**given, **more})


def turn(*w):
    return expm(lc.group("so3").hat(w))


SHAKEN = ["6*cos(t) + 2*cos(2*t + 1)"]


def test_fields_of_the_heavy_top_to_order_four():
    average = lc.vibrational_average(top(), lc.PeriodicInput(SHAKEN), order=4)
    xi, g = (0.1, 0.2, -0.3), (0.6, 0, 0.8)
    expected = {
        1: ((0.1, 0.2, -0.3), (-0.0316666666667, 2.01061728395, 0.11)),
        2: ((0, 0, 0), (0, -3.28183622824, 0)),
        3: ((2.4343441358, 9.0388498448, -1.30141975309), (1.12214217082, -46.6381683853, 1.04729136917)),
    }
    for q, value in expected.items():
        np.testing.assert_allclose(average.term(q, xi, G=g), value, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(
        average.term(4, xi, G=g)[0], (-0.778641159425, -1.83232150299, 0.853215217872), rtol=1e-11
    )
    many = average.term(3, np.tile(xi, (4, 5, 1)), G=g)
    assert many.shape == (4, 5, 2, 3)
    np.testing.assert_allclose(many[2, 3], average.term(3, xi, G=g), rtol=1e-14)


def test_errors_of_the_heavy_top_by_order():
    X0, eps = turn(0.4, 0.2, 0), 1 / (32 * np.pi)
    u = lc.PeriodicInput(SHAKEN)
    actual = lc.vibrational_average(top(), u).solve_actual(X0, (0, 0, 0), 1.0, eps)
    np.testing.assert_allclose(actual.xi[-1], (-0.4873747, -0.4633829, 0.31804919), atol=6e-8)
    for order, size in zip(range(1, 5), (0.0460, 0.00160, 4.45e-5, 6.9e-6), strict=True):
        found = lc.vibrational_average(top(), u, order=order).predict(X0, (0, 0, 0), 1.0, eps)
        error = max(np.abs(found.X[-1] - actual.X[-1]).max(), np.abs(found.xi[-1] - actual.xi[-1]).max())
        assert error == pytest.approx(size, rel=0.01)


def test_the_actual_run_is_that_of_scipy():
    X0, eps, J = turn(0.4, 0.2, 0), 0.02, np.diag(J_TOP)
    arm = np.array([0.1, 0, 0.8])

    def rate(t, y):
        R, w = y[:9].reshape(3, 3), y[9:]
        G = R.T @ (0, 0, 1)
        shaken = 9.81 + (6 * np.cos(t / eps) + 2 * np.cos(2 * t / eps + 1)) / eps
        hat = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        torque = np.cross(J @ w, w) + shaken * np.cross(G, arm) - 0.2 * w
        return np.concatenate([(R @ hat).ravel(), np.linalg.solve(J, torque)])

    average = lc.vibrational_average(top(), lc.PeriodicInput(SHAKEN), order=1)
    run = average.solve_actual(X0, (0.3, 0, -0.2), [0.1, 0.5, 0.9], eps)
    y0 = np.concatenate([X0.ravel(), (0.3, 0, -0.2)])
    expected = solve_ivp(rate, (0.1, 0.9), y0, method="DOP853", rtol=1e-12, atol=1e-12, max_step=eps / 4).y[:, -1]
    np.testing.assert_allclose(np.concatenate([run.X[-1].ravel(), run.xi[-1]]), expected, atol=2e-9)
    np.testing.assert_allclose(run.advected[-1], run.X[-1].T @ (0, 0, 1), atol=1e-9)


def test_kapitza_as_a_rotation_is_the_lagrangian_route():
    """J = diag(1, 1, .7), l = e3: th'' = g sin th - c th' + (1/eps) u sin th about e1."""
    body = lc.mechanical_system(
        "so3",
        inertia=(1, 1, 0.7),
        advected={"G": ("direction", (0, 0, 1))},
        force=["9.81*G2", "-9.81*G1", "0"],
        damping=0.2,
        inputs=[["G2", "-G1", "0"]],
    )
    pendulum = lc.lagrangian_system(
        coordinates=["th"],
        lagrangian="dth^2/2 - 9.81*cos(th)",
        forces={"th": "sin(th)*u"},
        dissipation="0.2*dth^2/2",
    )
    u = lc.PeriodicInput(["6*cos(t) - sin(2*t)"])
    for gauge in ("zero_mean", "pull_back"):
        rotation = lc.vibrational_average(body, u, order=2, gauge=gauge)
        plane = lc.vibrational_average(pendulum, u, order=2, gauge=gauge)
        for th, w in ((0.4, 0.0), (1.1, -0.7), (2.9, 2.0)):
            for eps in (0.02, 0.3):
                alpha, beta = rotation.rate((w, 0, 0), eps, G=(0, np.sin(th), np.cos(th)))
                expected = plane.rate([th, w], eps)
                assert (alpha[0], beta[0]) == pytest.approx(tuple(expected), abs=1e-10)
    third = lc.vibrational_average(body, lc.PeriodicInput(["6*cos(t)"]), order=3, gauge="pull_back")
    end = third.solve(turn(0.4, 0, 0), (0, 0, 0), 4.0212385966, 0.01)
    G = end.advected[-1]
    assert (np.arctan2(G[1], G[2]), end.xi[-1, 0]) == pytest.approx((-0.0490245311673, 0.8112709658100), abs=3e-10)


def test_free_body_under_two_torques():
    body = lc.mechanical_system("so3", inertia=(3, 2, 1), inputs=["w1", "w2"])
    xi = (0.1, 0.2, 0.3)
    phase = lc.vibrational_average(body, lc.PeriodicInput(["cos(t)", "2*cos(t)"]), order=4)
    assert phase.symmetric == (2, 4)
    np.testing.assert_allclose(phase.term(1, xi)[1], (0.02, -0.03, 0.1866666667), atol=1e-10)
    assert not phase.term(2, xi).any()
    assert not phase.term(4, xi).any()
    np.testing.assert_allclose(phase.term(3, xi)[0], (0.08888888889, -0.03888888889, -0.1333333333), atol=1e-10)
    quadrature = lc.vibrational_average(body, lc.PeriodicInput(["cos(t)", "-2*sin(t)"]), order=2)
    assert quadrature.symmetric == ()
    np.testing.assert_allclose(quadrature.term(2, xi), ((0, 0, -1 / 6), (-1 / 90, -1 / 60, 0)), atol=1e-14)


def _ugly(tmp_path):
    path = tmp_path / "ugly.toml"
    path.write_text(TOML)
    gravity = ("direction", (0, 0, 1))
    return lc.mechanical_system(
        path, inertia=[[3, 0.4, 0], [0.4, 2, 0.3], [0, 0.3, 2.5]], advected={"G": gravity},
        force=["G2", "0.5*G1*G3", "-0.2*xi3*xi1"], damping=0.1, inputs=[["1", "G3", "0"], ["0", "0", "1"]],
    )  # fmt: skip


def _vehicle(_):
    """Kirchhoff's body with buoyancy, quadratic drag and two forces."""
    return lc.mechanical_system(
        "se3", inertia=np.diag([1, 1.4, 1.2, 5, 6, 7]) + 0.1 * np.eye(6)[::-1], advected={"G": ("direction", (0, 0, 1))},
        force=["0.4*G2", "-0.4*G1", "0", "-0.1*xi4^2", "0.1*G2*xi5", "0"], damping=[0.1, 0.1, 0.1, 0.2, 0.2, 0.2],
        inputs=["v1", ["0", "0", "0.3", "0", "1", "0"]],
    )  # fmt: skip


def _disc(_):
    return lc.mechanical_system(
        "se2", inertia=(1, 2, 2.5), advected={"P": ("point", (0.3, -0.2))}, force=["0.3*P1", "-0.5*P1", "-0.5*P2"],
        damping=0.1, inputs=["omega", ["0", "P1", "1"]],
    )  # fmt: skip


@pytest.mark.parametrize(
    ("make", "gauge"),
    [
        (lambda _: top(), "zero_mean"),
        (lambda _: top(), "pull_back"),
        (_disc, "pull_back"),
        (_vehicle, "zero_mean"),
        (_ugly, "zero_mean"),
    ],
)
def test_slopes_one_to_four_at_a_fixed_fast_phase(make, gauge, tmp_path):
    system = make(tmp_path)
    signals = ["cos(t) + 0.5*cos(2*t + 1)", "0.7*sin(t + 0.3)"][: len(system.inputs)]
    average = lc.vibrational_average(system, lc.PeriodicInput(signals), order=4, gauge=gauge)
    X0 = expm(system.group.hat(np.linspace(0.2, -0.3, system.dim)))
    check = average.order_check(X0, np.linspace(-0.2, 0.3, system.dim), cycles=(8, 16, 32))
    np.testing.assert_allclose(check.slopes[:, -1], (1, 2, 3, 4), atol=0.3)


def test_symmetric_input_gives_an_order_for_nothing():
    """F_1 with Lambda_1, hence order 2, has no F_2 to add; order 4 has no F_4."""
    body = lc.mechanical_system("so3", inertia=(3, 2, 1), inputs=["w1", "w2"])
    average = lc.vibrational_average(body, lc.PeriodicInput(["cos(t)", "2*cos(t)"]), order=4)
    check = average.order_check(np.eye(3), (0.1, 0.2, 0.3), cycles=(8, 16, 32))
    np.testing.assert_allclose(check.slopes[[1, 3], -1], (2, 4), atol=0.3)


def test_estimate_undoes_reconstruct_and_starts_at_the_actual_state_in_the_pull_back_gauge():
    X, xi = turn(0.4, 0.2, -0.1), np.array([0.3, -0.2, 0.5])
    for gauge in ("zero_mean", "pull_back"):
        average = lc.vibrational_average(top(), lc.PeriodicInput(SHAKEN), order=4, gauge=gauge)
        there = average.reconstruct(X, xi, 1.7, 0.01)
        back = average.estimate(there.X, there.xi, 1.7, 0.01)
        np.testing.assert_allclose(back.X, X, atol=1e-11)
        np.testing.assert_allclose(back.xi, xi, atol=1e-11)
        start = average.estimate(X, xi, 0.0, 0.01)
        moved = np.abs(start.X - X).max() + np.abs(start.xi - xi).max()
        assert moved < 1e-13 if gauge == "pull_back" else moved > 1e-3


def test_inverted_pendulum_threshold_and_frequencies_against_floquet():
    """Full J, l = (.1, -.05, .8): lambda_c = g |l| / min eig(Q' hat(l)' J^-1 hat(l) Q); frequencies at beta = 6, eps = .02."""
    J = np.array([[1.2, 0.1, -0.05], [0.1, 0.9, 0.07], [-0.05, 0.07, 0.6]])
    arm, eps = np.array([0.1, -0.05, 0.8]), 0.02
    length = np.linalg.norm(arm)
    torque = ["0.8*G2 + 0.05*G3", "0.1*G3 - 0.8*G1", "-0.05*G1 - 0.1*G2"]
    body = lc.mechanical_system(
        "so3",
        inertia=J,
        advected={"G": ("direction", (0, 0, 1))},
        force=[f"9.81*({x})" for x in torque],
        inputs=[torque],
    )
    u = lc.PeriodicInput(["6*cos(t)"])
    potential = lc.vibrational_average(body, u).effective_potential
    G = sp.symbols("G1:4", real=True)
    jac = sp.lambdify(G, sp.hessian(potential, G))
    slope = sp.lambdify(G, [sp.diff(potential, g) for g in G])
    up = arm / length
    Q = np.linalg.svd(up[None])[2][1:].T
    # V on the sphere: second derivative in the tangent plane less the normal slope
    stiffness = Q.T @ np.array(jac(*up), dtype=float) @ Q - np.eye(2) * (np.array(slope(*up), dtype=float) @ up)
    hat = np.cross(np.eye(3), arm)
    added = Q.T @ hat.T @ np.linalg.inv(J) @ hat @ Q
    np.testing.assert_allclose(stiffness, 18 * added - 9.81 * length * np.eye(2), rtol=1e-12)
    threshold = 9.81 * length / np.linalg.eigvalsh(added)[0]
    assert threshold == pytest.approx(14.9043815075, abs=1e-9)
    assert np.sqrt(2 * threshold) == pytest.approx(5.45974019666, abs=1e-10)
    for order, expected in ((1, (1.15805, 2.49468)), (3, (1.15605, 2.50875))):
        average = lc.vibrational_average(body, u, order=order)
        assert _frequencies(average, up, eps) == pytest.approx(expected, abs=6e-6)
    assert _floquet(J, arm, up, eps) == pytest.approx((1.15605, 2.50895), abs=6e-6)
    orbit = lc.floquet(average.loop(eps), guess=np.concatenate([np.zeros(3), up]), period=average.period(eps))
    assert np.sort(np.asarray(orbit.exponents).imag)[-2:] == pytest.approx((1.15605, 2.50895), abs=6e-6)


def _frequencies(average, up, eps, step=1e-4):
    def rate(s):
        alpha, beta = average.rate(s[:3], eps, G=s[3:])
        return np.concatenate([beta, np.cross(s[3:], alpha)])

    at = np.concatenate([np.zeros(3), up])
    columns = [(rate(at + step * e) - rate(at - step * e)) / (2 * step) for e in np.eye(6)]
    found = np.sort(np.linalg.eigvals(np.array(columns).T).imag)
    return tuple(found[-2:])


def _floquet(J, arm, up, eps):
    """Of the linear periodic system of (w, dG) about the inverted rest."""
    inverse = np.linalg.inv(J)

    def rate(t, y):
        w, g = y.reshape(6, 6)[:3], y.reshape(6, 6)[3:]
        strength = 9.81 + 6 * np.cos(t / eps) / eps
        return np.concatenate([strength * inverse @ np.cross(g.T, arm).T, np.cross(up, w.T).T]).ravel()

    period = 2 * np.pi * eps
    end = solve_ivp(rate, (0, period), np.eye(6).ravel(), method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    angles = np.sort(np.angle(np.linalg.eigvals(end.reshape(6, 6))))
    return tuple(angles[-2:] / period)


def test_kernels_in_c_are_the_average():
    average = lc.vibrational_average(top(), lc.PeriodicInput(SHAKEN), order=3)
    lib, eps, tau = average.library, 0.02, 2.1
    X, xi = turn(0.4, 0.2, -0.1), np.array([0.3, -0.2, 0.5])
    G = X.T @ (0, 0, 1)
    assert lib.compiled
    rate = lib.rate(xi, G, eps)
    np.testing.assert_allclose((rate.alpha, rate.beta), average.rate(xi, eps, X=X), rtol=1e-13)
    there = lib.reconstruct(X, xi, G, tau, eps)
    expected = average.reconstruct(X, xi, tau, eps)
    np.testing.assert_allclose(there[0], expected.X, atol=3e-7)  # two steps of the flow in C, eight here
    np.testing.assert_allclose(there[1], expected.xi, atol=3e-6)
    back = lib.estimate(there[0], there[1], there[0].T @ (0, 0, 1), tau, eps)
    np.testing.assert_allclose(back[0], X, atol=1e-6)
    np.testing.assert_allclose(back[1], xi, atol=1e-5)
    strength = 9.81 + (6 * np.cos(tau) + 2 * np.cos(2 * tau + 1)) / eps
    J = np.diag(J_TOP)
    torque = np.cross(J @ xi, xi) + strength * np.cross(G, (0.1, 0, 0.8)) - 0.2 * xi
    np.testing.assert_allclose(lib.actual(xi, G, tau, eps), np.linalg.solve(J, torque), rtol=1e-12)


def test_effective_potential_says_why_there_is_none():
    body = lc.mechanical_system("so3", inertia=(3, 2, 1), inputs=["w1"])
    average = lc.vibrational_average(body, lc.PeriodicInput(["cos(t)"]))
    assert average.effective_potential is None
    assert "input 1" in average.no_potential
    assert "gradient" in average.no_potential


def test_mean_force_is_the_slope_of_the_effective_potential():
    """On SE(2), a point held by a spring to a shaken line: -J^-1 dV_eff is F_1 at rest."""
    body = lc.mechanical_system(
        "se2", inertia=(1, 2, 2.5), advected={"P": ("point", (0.3, -0.2))}, force=["0", "0", "0"],
        inputs=[["0", "2*P1", "2*P2"]],
    )  # fmt: skip
    average = lc.vibrational_average(body, lc.PeriodicInput(["3*cos(2*t) + sin(t)"]))
    P = sp.symbols("P1:3", real=True)
    V = average.effective_potential
    point = (0.7, -0.4)
    slope = [float(sp.diff(V, p).subs(dict(zip(P, point, strict=True)))) for p in P]
    # P' = -(w x P + v): dV along w, v1, v2
    force = np.array([slope[0] * -point[1] + slope[1] * point[0], *slope])
    expected = force / np.array([1, 2, 2.5])
    np.testing.assert_allclose(average.term(1, (0, 0, 0), P=point)[1], expected, atol=1e-13)


def test_averages_pickle_and_compare():
    import pickle

    average = lc.vibrational_average(top(), lc.PeriodicInput(SHAKEN), order=2)
    again = pickle.loads(pickle.dumps(average))
    assert again == average
    assert hash(again) == hash(average)
    assert again != lc.vibrational_average(top(), lc.PeriodicInput(SHAKEN), order=3)
    np.testing.assert_array_equal(again.term(2, (1, 2, 3), G=(0, 0, 1)), average.term(2, (1, 2, 3), G=(0, 0, 1)))
