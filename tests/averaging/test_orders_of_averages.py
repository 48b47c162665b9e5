"""Orders of averages on random systems in one to four dimensions, trigonometric and not, down to eps = .0025; nodes and aliases."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.special import i0

import lie_codegen as lc
from lie_codegen.errors import AssumptionError, InputError, PeriodError

EPS = (0.02, 0.01, 0.005, 0.0025)


def random_system(n, polynomial, seed, phase="t"):
    """n damped formulas in y1 .. yn and the phase."""
    rng = np.random.default_rng(seed)

    def number(scale):
        return f"{rng.uniform(0.3, 1) * scale * rng.choice([-1, 1]):.3f}"

    names, rates = [f"y{i + 1}" for i in range(n)], []
    for i, name in enumerate(names):
        other = names[(i + 1) % n]
        waves = [
            f"{number(0.4)}*{other}*cos({phase})",
            f"{number(0.4)}*{name}*{other}*sin(2*{phase})",
            f"{number(0.3)}*sin({phase})",
        ]
        if not polynomial:
            waves[1] = f"{number(0.4)}*sin({other})/(2 + cos({phase}))"
            waves[2] = f"{number(0.3)}*exp({name}*sin({phase})/2)"
        rates.append(" + ".join([f"-0.4*{name}", f"{number(0.2)}*{name}^2", *waves]).replace("+ -", "- "))
    return names, rates


def function(names, formulas, *others):
    symbols = sp.symbols([*names, *others])
    return sp.lambdify([symbols], [sp.sympify(each.replace("^", "**")) for each in formulas])


def slopes(errors):
    return np.log2(np.array(errors)[:-1] / np.array(errors)[1:])


def errors_in_time(n, polynomial, orders, seed):
    names, rates = random_system(n, polynomial, seed)
    start, table = np.linspace(0.3, 0.6, n), {order: [] for order in orders}
    f = function(names, rates, "t")
    slow = {order: lc.time_average(rates, variables=names, order=order) for order in orders}
    assert all(each.exact == polynomial for each in slow.values())
    for eps in EPS:
        t = np.linspace(0, 1 / eps, 41)
        true = solve_ivp(lambda t, y, eps=eps: eps * np.array(f([*y, t])), (0, t[-1]), start, method="DOP853", rtol=1e-13, atol=1e-15, t_eval=t).y.T  # fmt: skip
        for order, average in slow.items():
            table[order].append(np.abs(average.solve(start, t, eps, rtol=1e-13).y - true).max())
    return table


@pytest.mark.slow
@pytest.mark.parametrize("polynomial", [True, False])
@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_time_averages_of_random_systems(n, polynomial):
    for order, errors in errors_in_time(n, polynomial, (1, 2, 3, 4), 10 * n + polynomial).items():
        # both integrations err by some 5e-12 over 400 turns: below 4e-11 that is more than the slope may be off
        seen = [slope for slope, error in zip(slopes(errors), errors[1:], strict=True) if error > 4e-11]
        assert seen, errors
        assert min(seen) > order - 0.2, (order, errors)
        assert errors[-1] < 20 * EPS[-1] ** order


@pytest.mark.slow
def test_the_fourth_order_of_a_random_system():
    errors = errors_in_time(2, False, (4,), 5)[4]
    assert slopes(errors)[0] > 3.8
    assert errors[-1] < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("polynomial", [True, False])
@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_phase_averages_of_random_systems(n, polynomial):
    names, rates = random_system(n, polynomial, 100 * n + polynomial, phase="p")
    rate, G = "1.5 + y1^2/2", "0.4*y1*cos(p) + 0.3*sin(p)^2 - 0.2*y1"
    two = lc.phase_average(rates, G=G, rate=rate, variables=names, phase="p", period="2*pi")
    F, speed, push = function(names, rates, "p"), function(names, [rate]), function(names, [G], "p")
    start, table = np.linspace(0.3, 0.6, n), {1: [], 2: []}
    for eps in EPS:
        t = np.linspace(0, 1 / eps, 41)

        def true_rate(t, y, eps=eps):
            return np.array([*(eps * each for each in F(y)), speed(y[:-1])[0] + eps * push(y)[0]])

        true = solve_ivp(true_rate, (0, t[-1]), [*start, 0.3], method="DOP853", rtol=1e-12, atol=1e-14, t_eval=t).y.T
        for order, rows in table.items():
            run = two.solve(start, 0.3, t, eps, order=order)
            rows.append([np.abs(run.x - true[:, :n]).max(), np.abs(run.phi - true[:, n]).max()])
    first, second = (np.array(slopes(rows)) for rows in table.values())
    assert np.all(first[:, 0] > 0.85), table
    assert np.all(second[:, 0] > 1.8), table
    assert np.all(second[:, 1] > 0.85), table


def test_nodes_are_not_taken_in_by_aliases():
    """cos(64 t) looks constant on 64 nodes, cos(32 p) on 16 and 32."""
    fast = lc.time_average(["a*cos(64*t)^2 + cos(64*t)"], variables=("a",), order=3)
    np.testing.assert_allclose(fast.terms([0.5])[0], [0.25], atol=1e-13)
    assert fast.exact
    for m in (16, 32, 48):
        two = lc.phase_average([f"a*cos(2*pi*{m}*p)^2"], G=f"cos(2*pi*{m}*p)", rate=1, variables=("a",), phase="p")
        np.testing.assert_allclose(two.terms([0.5]).F1, [0.25], atol=1e-13)
        np.testing.assert_allclose(two.phase_terms([0.5]), [1, 0, -0.5], atol=1e-12)


def test_steep_functions_and_narrow_domains():
    steep = lc.time_average(["a/(1.01 + cos(t))"], variables=("a",), order=1)
    np.testing.assert_allclose(steep.terms([0.5])[0], 0.5 / np.sqrt(1.01**2 - 1), rtol=1e-9)
    assert not steep.exact
    narrow = lc.time_average(["sqrt(a - 1)*exp(cos(t))"], variables=("a",), order=2)
    np.testing.assert_allclose(narrow.terms([1.49])[0], 0.7 * i0(1), rtol=1e-12)
    with pytest.raises(InputError, match="no finite value"):
        lc.time_average(["sqrt(a - 100)*cos(t)"], variables=("a",))


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda: lc.time_average(["a*atan2(sin(t), cos(t))"], variables=("a",)), AssumptionError, "do not decay"),
        (lambda: lc.time_average(["a*abs(sin(t))"], variables=("a",)), AssumptionError, "do not decay"),
        (lambda: lc.time_average(["cos(t) + cos(sqrt(2)*t)"], variables=("a",)), PeriodError, "has not the period"),
        (lambda: lc.time_average(["a*cos(t)"], variables=("a",), order=5), InputError, "order is 1 to 4"),
        (lambda: lc.time_average(["a*cos(t)"], variables=("a",), order=0), InputError, "order is 1 to 4"),
        (lambda: lc.phase_average(["a*abs(sin(pi*p))"], rate=1, variables=("a",), phase="p"), AssumptionError, "do not decay"),
        (lambda: lc.phase_average(["a"], G="p", rate=1, variables=("a",), phase="p"), PeriodError, "has not the period"),
        (lambda: lc.phase_average(["a*cos(p)"], rate="1 + p", variables=("a",), phase="p", period="2*pi"), ValueError, "p"),
    ],
)  # fmt: skip
def test_refusals(call, error, words):
    with pytest.raises(error, match=words):
        call()
