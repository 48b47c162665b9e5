"""Averages in time to order 4: published numbers, SymPy's integrals, slopes against SciPy, eps in f, refusals, C."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from package_program import run_example
from scipy.integrate import solve_ivp

import lie_codegen as lc
from lie_codegen.errors import AssumptionError, InputError, PeriodError
from lie_codegen.kernel.numpy_arithmetic import evaluate

RATES = ["b*cos(t) + a^2*sin(t) - 0.3*a*(1 + cos(2*t))", "a*sin(t) + cos(t)/5 - b/5 + a*b*cos(t)/2"]


def system(order=4, **changes):
    return lc.time_average(RATES, **{"variables": ("a", "b"), "period": "2*pi", "order": order, **changes})


def actual(eps, t):
    def rate(t, y):
        a, b = y
        c, s = np.cos(t), np.sin(t)
        return [eps * (b * c + a**2 * s - 0.3 * a * (1 + np.cos(2 * t))), eps * (a * s + c / 5 - b / 5 + a * b * c / 2)]

    return solve_ivp(rate, (0, t[-1]), [0.4, -0.3], method="DOP853", rtol=1e-13, atol=1e-14, t_eval=t).y.T


def test_published():
    slow = system()
    published = [(-0.12, 0.06), (-0.32, -0.178), (0.0128, -0.020825), (-0.098, -0.10287)]
    np.testing.assert_allclose(slow.terms((0.4, -0.3)), published, atol=1e-14)
    assert slow.exact
    true = actual(0.05, np.array([0, 40.0]))[-1]
    np.testing.assert_allclose(true, [0.2039105022, -0.1852513420], atol=1e-9)
    np.testing.assert_allclose(slow.solve((0.4, -0.3), [0, 40], 0.05).y[-1], true, atol=2e-6)


def test_the_second_order_is_sympys():
    """u1 and F2 = <Df u1> - and u2 by exact integration."""
    a, b, t = sp.symbols("a b t", real=True)
    f = sp.Matrix([b * sp.cos(t) + a**2 * sp.sin(t) - a * (1 + sp.cos(2 * t)) * 3 / 10,
                   a * sp.sin(t) + sp.cos(t) / 5 - b / 5 + a * b * sp.cos(t) / 2])  # fmt: skip

    def mean(h):
        return h.applyfunc(lambda e: sp.integrate(sp.expand(e), (t, 0, 2 * sp.pi)) / (2 * sp.pi))

    def primitive(h):
        raw = (h - mean(h)).applyfunc(lambda e: sp.integrate(sp.expand(e), t))
        return (raw - mean(raw)).applyfunc(sp.expand)

    F1, u1 = mean(f), primitive(f)
    H2 = f.jacobian([a, b]) * u1 - u1.jacobian([a, b]) * F1
    at = {a: sp.Rational(2, 5), b: sp.Rational(-3, 10)}
    slow = system(order=3)
    np.testing.assert_allclose(slow.terms((0.4, -0.3))[1], np.array(mean(H2).subs(at), dtype=float).ravel(), atol=1e-14)
    for moment in (0.0, 1.3):
        exact = [np.array(u.subs(at).subs(t, moment), dtype=float).ravel() for u in (u1, primitive(H2))]
        np.testing.assert_allclose(slow.near_identity((0.4, -0.3), moment), exact, atol=1e-14)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_slopes(order):
    slow, errors = system(order), []
    for eps in (0.1, 0.05, 0.025):
        t = np.linspace(0, 2 / eps, 61)
        errors.append(np.abs(slow.solve((0.4, -0.3), t, eps).y - actual(eps, t)).max())
    assert np.log2(errors[1] / errors[2]) > order - 0.25, errors


def test_eps_in_the_formulas():
    """eps g in f adds <g> to F2, and to F3 what SymPy-free differences of the flow ask for: slope 3."""
    with_eps = lc.time_average([f"{RATES[0]} + eps*(a*cos(t) + b)", RATES[1]], variables=("a", "b"), order=3)
    plain = system(3)
    F, G = with_eps.terms((0.4, -0.3)), plain.terms((0.4, -0.3))
    np.testing.assert_allclose(F[1] - G[1], [-0.3, 0], atol=1e-14)
    errors = []
    for eps in (0.1, 0.05):
        t = np.linspace(0, 2 / eps, 41)

        def rate(t, y, eps=eps):
            a, b = y
            c, s = np.cos(t), np.sin(t)
            first = b * c + a**2 * s - 0.3 * a * (1 + np.cos(2 * t)) + eps * (a * c + b)
            return [eps * first, eps * (a * s + c / 5 - b / 5 + a * b * c / 2)]

        true = solve_ivp(rate, (0, t[-1]), [0.4, -0.3], method="DOP853", rtol=1e-13, atol=1e-14, t_eval=t).y.T
        errors.append(np.abs(with_eps.solve((0.4, -0.3), t, eps).y - true).max())
    assert np.log2(errors[0] / errors[1]) > 2.7


def test_a_function_that_is_no_polynomial():
    slow = lc.time_average(["-a/(2 + cos(t)) + exp(sin(t))/5"], variables=("a",), order=3)
    assert not slow.exact
    mean = 1 / np.sqrt(3)  # of 1 / (2 + cos)
    from scipy.special import i0

    assert slow.terms((0.7,))[0][0] == pytest.approx(-0.7 * mean + i0(1) / 5, abs=1e-13)


def test_batches_status_and_an_end():
    slow = system(2)
    runs = slow.solve([(0.4, -0.3), (0.1, 0.2)], [0, 5], 0.05)
    np.testing.assert_array_equal(runs[1].y, slow.solve((0.1, 0.2), [0, 5], 0.05).y)
    np.testing.assert_allclose(runs[0].y[0], [0.4, -0.3], atol=1e-13)
    assert "too large" in slow.solve((0.4, -0.3), [0, 0.1], 9.0).status
    blow = lc.time_average(["a^2*(1 + cos(t))"], variables=("a",)).solve([1.0], [0, 5, 20], 0.1)
    assert "no solution beyond" in blow.status
    assert len(blow.t) == 2


def test_the_twin_and_the_package_in_c(tmp_path):
    slow = system(4)
    kernel = slow.kernels()[0]
    np.testing.assert_allclose(evaluate(kernel, np.array([0.4, -0.3]))[0], slow.terms((0.4, -0.3)), atol=1e-15)
    folder = lc.generate(list(slow.kernels()), tmp_path / "out", name="time_average")
    assert len((folder / "src" / "time_average.c").read_text()) < 60_000  # nodes are looped over
    run_example(folder, "time_average")


def test_refusals():
    with pytest.raises(InputError, match="order is 1 to 4"):
        system(5)
    with pytest.raises(PeriodError, match="has not the period"):
        system(period=3)
    with pytest.raises(PeriodError, match="has not the period"):
        lc.time_average(["a*t"], variables=("a",))
    with pytest.raises(AssumptionError, match="do not decay"):
        lc.time_average(["a*atan2(sin(t), cos(t))"], variables=("a",))
    with pytest.raises(InputError, match="2 formulas"):
        system(variables=("a",))
    with pytest.raises(InputError, match="increasing"):
        system(2).solve((0.4, -0.3), [1, 0], 0.1)


def test_an_average_is_a_value(tmp_path):
    slow = system(2, parameters={"c": 0.5})
    assert lc.load(slow.save(tmp_path / "slow.npz")) == slow
