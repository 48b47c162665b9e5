"""Second-order averaging with one phase: published numbers, closed forms, the change of variables itself, slopes, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from package_program import run_example
from scipy.integrate import solve_ivp

import lie_codegen as lc
from lie_codegen.errors import AssumptionError, InputError, PeriodError, ShapeError
from lie_codegen.kernel.numpy_arithmetic import evaluate

F = ["a*cos(2*pi*p)^2 - 0.3*b*sin(2*pi*p)", "0.5*a*b*sin(2*pi*p) + 0.2*cos(2*pi*p) - 0.1*a"]
G, RATE = "0.4*a*cos(2*pi*p) + b*sin(2*pi*p)^2", "1 + a^2/2"


def system(**changes):
    return lc.phase_average(F, **{"G": G, "rate": RATE, "variables": ("a", "b"), "phase": "p", **changes})


def true_rate(eps):
    def rate(t, y):
        a, b, p = y
        c, s = np.cos(2 * np.pi * p), np.sin(2 * np.pi * p)
        slow = [a * c**2 - 0.3 * b * s, 0.5 * a * b * s + 0.2 * c - 0.1 * a]
        return [eps * slow[0], eps * slow[1], 1 + a**2 / 2 + eps * (0.4 * a * c + b * s**2)]

    return rate


def test_published():
    two = system()
    F1, F2 = two.terms((0.7, -0.4))
    np.testing.assert_allclose(F1, [0.35, -0.07], atol=1e-14)
    np.testing.assert_allclose(F2, [-0.0319475087, -0.0171532213], atol=1e-10)
    np.testing.assert_allclose(two.phase_terms((0.7, -0.4)), [1.245, -0.2, -0.0492267953], atol=1e-10)
    W, V = two.near_identity((0.7, -0.4), 0.2)
    np.testing.assert_allclose([*W, V], [0.0084090543, 0.0298461772, 0.0410602214], atol=1e-10)


def test_van_der_pol():
    """x = r cos: F1 = r/2 (1 - r^2/4), F2 = 0, and the frequency falls by eps^2/16 on the cycle."""
    force = "(1 - r^2*cos(p)^2)*(-r*sin(p))"
    two = lc.phase_average(
        [f"-sin(p)*{force}"], G=f"-cos(p)*{force}/r", rate=1, variables=("r",), phase="p", period="2*pi"
    )
    F1, F2 = two.terms([[2.0], [0.7]])
    np.testing.assert_allclose(F1[:, 0], [0, 0.35 * (1 - 0.49 / 4)], atol=1e-14)
    np.testing.assert_allclose(F2, 0, atol=1e-14)
    assert pytest.approx(-1 / 16, abs=1e-14) == two.phase_terms([2.0]).G2


def test_the_change_of_variables_leaves_the_averaged_system():
    """What x = y + eps W, phi = psi + eps V leaves of the true rates has zero mean at order eps^2; differences of W and V alone."""
    two, y, eps, h = system(), np.array([0.7, -0.4]), 1e-3, 1e-5
    psi = np.arange(64) / 64

    def shift(y, psi):
        W, V = two.near_identity(y, psi)
        return np.concatenate([W, V[..., None]], axis=-1)

    (F1, F2), (L, G1, G2) = two.terms(y), two.phase_terms(y)
    mean_rate = np.array([*(eps * F1 + eps**2 * F2), L + eps * G1 + eps**2 * G2])
    at = np.concatenate([np.broadcast_to(y, (64, 2)), psi[:, None]], axis=1)
    moved = at + eps * shift(y, psi)
    columns = [(shift(y + h * u, psi) - shift(y - h * u, psi)) / (2 * h) for u in np.eye(2)]
    columns.append((shift(y, psi + h) - shift(y, psi - h)) / (2 * h))
    left = (
        np.array([true_rate(eps)(0, row) for row in moved])
        - mean_rate
        - eps * sum(c * r for c, r in zip(columns, mean_rate, strict=True))
    )
    assert np.abs(left).max() < 5 * eps**2
    assert np.abs(left.mean(axis=0)).max() < 5 * eps**3
    wrong = np.abs((left + np.array([eps**2 * F2[0], 0, 0])).mean(axis=0)).max()
    assert wrong > 20 * eps**3  # the test sees a missing F2


def test_slopes_to_the_smallest_eps():
    two, table = system(), {1: [], 2: []}
    for eps in (0.02, 0.01, 0.005, 0.0025):
        t = np.linspace(0, 1 / eps, 101)
        true = solve_ivp(
            true_rate(eps), (0, t[-1]), [0.7, -0.4, 0.1], method="DOP853", rtol=1e-12, atol=1e-13, t_eval=t
        ).y.T
        for order, rows in table.items():
            run = two.solve((0.7, -0.4), 0.1, t, eps, order=order)
            assert run.status == "ok"
            rows.append([np.abs(run.x - true[:, :2]).max(), np.abs(run.phi - true[:, 2]).max()])
    first, second = (np.log2(np.array(rows)[:-1] / np.array(rows)[1:]) for rows in table.values())
    assert np.all(second[:, 0] > 1.9)
    assert np.all(second[:, 1] > 0.9)
    assert np.all(first[:, 0] > 0.9)
    assert np.all(np.abs(first[-1, 1]) < 0.5)  # the phase of first order does not converge
    naive = two.solve((0.7, -0.4), 0.1, t, eps, order=1, start="osculating")
    assert np.abs(naive.x - true[:, :2]).max() > table[1][-1][0]


def test_start_at_the_mean_and_back():
    two = system()
    y, psi, status = two.to_mean((0.7, -0.4), 0.1, 0.05)
    assert status == "ok"
    x, phi = two.to_osculating(y, psi, 0.05)
    np.testing.assert_allclose([*x, phi], [0.7, -0.4, 0.1], atol=1e-13)
    *_, status = two.to_mean((0.7, -0.4), 0.1, 40.0)
    assert "too large" in status
    assert "too large" in two.solve((0.7, -0.4), 0.1, [0, 0.01], 40.0).status


def test_batches_and_an_end_in_between():
    two = system()
    runs = two.solve([(0.7, -0.4), (0.5, 0.2)], [0.1, 0.2], [0, 5, 10], 0.01)
    np.testing.assert_array_equal(runs[1].x, two.solve((0.5, 0.2), 0.2, [0, 5, 10], 0.01).x)
    blow = lc.phase_average(["a^2*(1 + cos(2*pi*p))"], rate=1, variables=("a",), phase="p").solve(
        [1.0], 0, [0, 5, 20], 0.1
    )
    assert "no solution beyond" in blow.status
    assert len(blow.t) == 2


def test_the_twin_in_numpy_is_the_c(tmp_path):
    two = system()
    for kernel in two.kernels()[:2]:
        arguments = ([0.7, -0.4],) if kernel.name == "terms" else ([0.7, -0.4], 0.2)
        compiled = getattr(two.library, kernel.name)(*arguments)
        for mine, theirs in zip(evaluate(kernel, *arguments), compiled, strict=True):
            np.testing.assert_allclose(mine, theirs, atol=1e-14)


def test_the_package_in_c(tmp_path):
    folder = lc.generate(list(system().kernels()), tmp_path / "out", name="phase_average")
    text = (folder / "src" / "phase_average.c").read_text()
    assert text.count("sin(") < 30  # nodes are looped over
    run_example(folder, "phase_average")


def test_refusals():
    with pytest.raises(PeriodError, match="has not the period"):
        lc.phase_average(["a*cos(p)"], rate=1, variables=("a",), phase="p")
    with pytest.raises(AssumptionError, match="do not decay"):
        lc.phase_average(["a*atan2(sin(p), cos(p))"], rate=1, variables=("a",), phase="p", period="2*pi")
    with pytest.raises(InputError, match="order is 1 or 2"):
        system(order=5)
    with pytest.raises(InputError, match="2 formulas for the variables a"):
        system(variables=("a",))
    with pytest.raises(ShapeError, match="the variables are a, b"):
        system().terms([1.0])
    with pytest.raises(PeriodError, match="not positive"):
        system(period=0)


def test_an_average_is_a_value(tmp_path):
    two = system(parameters={"c": 0.5})
    assert lc.load(two.save(tmp_path / "two.npz")) == two
