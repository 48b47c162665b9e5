"""Averages by coefficients and brackets: Fig. 2 of the paper, the symbolic route, order three, the three-link chain."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from mechanical_systems import arm, cart, pendulum

import lie_codegen as lc
from lie_codegen.errors import InputError
from lie_codegen.mechanics.lagrangian_average import LagrangianSeries
from lie_codegen.mechanics.vibrational_average import VibrationalAverage


def test_table_behind_figure_two():
    """T^1, T^2, T^4 as printed, T^3 corrected: -alpha (pi^2/3 + 1/4) / omega."""
    omega, a, pi = 50, sp.Symbol("alpha", real=True), sp.pi
    u = lc.PeriodicInput(["alpha*50*(1 - cos(100*t)) + 50*sin(50*t)"], parameters=("alpha",))
    table = {row.bracket: (row.order, row.coefficient) for row in lc.bracket_table(u, 2)}
    square = sp.Rational(3, 2) + 2 * pi * a + 5 * a**2 / 8 + 4 * pi**2 * a**2 / 3
    fourth = (100 * a + pi * (36 + a * (3 * a + 16 * pi * (2 + pi * a)))) / (24 * omega) - pi / omega * square
    expected = {
        "[Y,X]": (1, 1 + pi * a),
        "<Y:Y>": (1, -square / 2),
        "[[Y,X],X]": (2, -a * (pi**2 / 3 + sp.Rational(1, 4)) / omega),
        "[<Y:Y>,X]": (2, -fourth / 2),
    }
    for name, (order, value) in expected.items():
        assert table[name][0] == order
        assert sp.expand(table[name][1] - value) == 0
    assert table["X"] == (1, 1)


def test_a_mean_belongs_to_the_pull_back_gauge():
    with pytest.raises(InputError, match="pull_back"):
        lc.bracket_table(lc.PeriodicInput(["1 + cos(t)"]), 2, "zero_mean")
    with pytest.raises(InputError, match="1 to 4"):
        lc.bracket_table(lc.PeriodicInput(["cos(t)"]), 5)


@pytest.mark.parametrize("gauge", ["zero_mean", "pull_back"])
@pytest.mark.parametrize(
    "make",
    [
        pendulum,
        lambda: lc.routh_reduce(cart(), momentum={"x": "1/2"}).system,
        pytest.param(arm, marks=pytest.mark.slow),
    ],
)
def test_dual_numbers_give_the_symbolic_fields(make, gauge):
    system = make()
    u = lc.PeriodicInput(["4*sin(t) + 3*cos(2*t) - 2*cos(t)", "cos(t + 1)"][: len(system.inputs)], period="2*pi")
    symbolic = lc.vibrational_average(system, u, order=2, gauge=gauge)
    series = VibrationalAverage(LagrangianSeries(system, u, 2, gauge, False))
    z = np.random.default_rng(0).normal(size=(5, len(system.state)))
    for q in (1, 2):
        size = np.abs(symbolic.term(q, z)).max()
        np.testing.assert_allclose(series.term(q, z), symbolic.term(q, z), atol=1e-12 * max(1, size))
    np.testing.assert_allclose(series.rate(z, 0.1), symbolic.rate(z, 0.1), rtol=1e-10, atol=1e-9)
    np.testing.assert_allclose(series.actual(z, 0.7, 0.1), symbolic.actual(z, 0.7, 0.1), rtol=1e-10, atol=1e-9)
    assert {(row.order, row.bracket) for row in series.table} == {(row.order, row.bracket) for row in symbolic.table}


def test_kapitza_to_third_order():
    """The published numbers of a rotation of SO(3), here by the Lagrangian route."""
    u = lc.PeriodicInput(["6*cos(t)"], period="2*pi")
    average = lc.vibrational_average(pendulum(), u, order=3, gauge="pull_back")
    end = average.solve([0.4, 0], [0, 4.0212385966], 0.01)[-1]
    np.testing.assert_allclose(end, (-0.0490245311673, 0.8112709658100), atol=3e-10)


def chain():
    """Three point masses on unit links below a pivot that is shaken vertically."""
    vx = ("cos(a)*da", "cos(a)*da + cos(b)*db", "cos(a)*da + cos(b)*db + cos(c)*dc")
    vy = ("sin(a)*da", "sin(a)*da + sin(b)*db", "sin(a)*da + sin(b)*db + sin(c)*dc")
    kinetic = " + ".join(f"(({x})^2 + ({y})^2)/2" for x, y in zip(vx, vy, strict=True))
    return lc.lagrangian_system(
        coordinates=["a", "b", "c"],
        lagrangian=f"{kinetic} - 9.81*(3*cos(a) + 2*cos(b) + cos(c))",
        forces={"a": "3*sin(a)*u", "b": "2*sin(b)*u", "c": "sin(c)*u"},
    )


@pytest.mark.slow
def test_three_link_chain_in_seconds_with_slopes_one_and_two():
    system, u = chain(), lc.PeriodicInput(["4*cos(t) + 3*cos(2*t + 1)"])
    y0, t = np.array([0.3, -0.2, 0.4, 0.1, 0.2, -0.3]), 0.4
    eps = np.array([t / (2 * np.pi * N + 1.3) for N in (16, 32)])
    for order in (1, 2):
        average = lc.vibrational_average(system, u, order=order)
        errors = []
        for small in eps:
            actual = average.solve_actual(y0, [0, t], small)[-1]
            start = (
                average.estimate(y0, 0.0, small) if order > 1 else average.estimate(y0, 0.0, small, floquet_map=False)
            )
            end = average.reconstruct(average.solve(start, [0, t], small)[-1], t / small, small)
            errors.append(np.abs(end - actual).max())
        assert np.log(errors[0] / errors[1]) / np.log(eps[0] / eps[1]) == pytest.approx(order, abs=0.3)


def test_refusals_of_the_series():
    u = lc.PeriodicInput(["cos(t)"])
    with pytest.raises(InputError, match="1 to 4"):
        lc.vibrational_average(pendulum(), u, order=5)
    with pytest.raises(InputError, match="order 1 to 2"):
        lc.vibrational_average(pendulum(), u, order=2).term(3, [0, 0])
    with pytest.raises(InputError, match="mean_to_drift"):
        lc.vibrational_average(pendulum(), lc.PeriodicInput(["1 + cos(t)"]), order=3)
    cubic = lc.lagrangian_system(coordinates=["x"], lagrangian="dx^2/2", forces={"x": "u - dx^3"})
    with pytest.raises(InputError, match="degree 3"):
        lc.vibrational_average(cubic, u, order=3)
