"""The Magnus series, its convergence conditions, the charts of the theorems, and the corollaries' bounds."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import quad

import lie_codegen as lc
from lie_codegen.averaging.chart_limit import chart_end, inverse_determinant
from lie_codegen.averaging.convergence import convergence
from lie_codegen.averaging.corollary_bounds import corollary_bound, corollary_check
from lie_codegen.averaging.magnus import magnus
from lie_codegen.errors import AssumptionWarning, InputError
from lie_codegen.flow.reference_flow import reference_flow

MIXED = ["1/2 + cos(t)", "-3/10 + sin(t) + 3/10*cos(2*t)", "4/10 + 1/2*cos(t + 1)"]


def test_the_printed_terms_of_38() -> None:
    """Z_2 and Z_3 as iterated integrals, by symbolic integration with the printed 1/2, 1/4 and 1/12."""
    so3 = lc.group("so3")
    texts = ["1/2 + cos(t)", "sin(t)", "1/3"]
    t = sp.Symbol("t", real=True)
    U = sp.Matrix([sp.Rational(1, 2) + sp.cos(t), sp.sin(t), sp.Rational(1, 3)])

    def integral(f: sp.Matrix) -> sp.Matrix:
        return f.applyfunc(lambda x: sp.integrate(sp.expand(x), (t, 0, t)))

    W = integral(U)
    second = integral(W.cross(U))
    third = integral(second.cross(U)) / 4 + integral(W.cross(W.cross(U))) / 12
    series = magnus(so3, lc.PeriodicInput(texts, "2*pi"), 3)
    for moment in (0.9, 4.2):
        np.testing.assert_allclose(
            series.Z[1](moment), np.array((second / 2).subs(t, moment), float).ravel(), atol=1e-13
        )
        np.testing.assert_allclose(series.Z[2](moment), np.array(third.subs(t, moment), float).ravel(), atol=1e-13)
        exact = [float(value) for value in series.exact_Z[2].subs(t, moment)]
        np.testing.assert_allclose(series.Z[2](moment), exact, atol=1e-13)


@pytest.mark.parametrize("name", ["so3", "sl2", "se2"])
def test_over_one_period_the_series_is_that_of_the_averaged_rates(name: str) -> None:
    group, u = lc.group(name), lc.PeriodicInput(MIXED, "2*pi")
    series, averaged = magnus(group, u, 6), lc.average(group, u, 6)
    for z, f in zip(series.Z, averaged.F, strict=True):
        np.testing.assert_allclose(z(u.T), u.T * f, atol=1e-13)


def test_partial_sums_have_the_order_of_the_first_term_left_out() -> None:
    group, u = lc.group("so3"), lc.PeriodicInput(MIXED, "2*pi")
    for order in (1, 2, 3, 4):
        series = magnus(group, u, order)
        errors = []
        for eps in (0.04, 0.02):
            flow = reference_flow(group, u, eps, 6.28)
            errors.append(np.max(np.abs(series.state(eps, flow.t) - flow.X)))
        assert np.log2(errors[0] / errors[1]) == pytest.approx(order + 1, abs=0.15)


def test_convergence_conditions_are_integrals_of_norms() -> None:
    group, u = lc.group("so3"), lc.PeriodicInput(["cos(t)", "1/2*sin(t)", "1"], "2*pi")
    report = convergence(group, u, 0.1)
    length = quad(lambda t: np.linalg.norm(u(t)), 0, u.T)[0] / u.T
    assert report.matrix_rate == pytest.approx(0.1 * length, rel=1e-10)
    assert report.adjoint_rate == pytest.approx(report.matrix_rate, rel=1e-12)
    assert report.until_41 == pytest.approx(np.log(2) / (0.1 * length), rel=1e-10)
    other = convergence(lc.group("se3"), lc.PeriodicInput(["cos(t)", "0", "0", "1", "0", "0"], "2*pi"), 0.1)
    assert other.until_41 is None
    assert "nothing is claimed" in other.statement
    with pytest.raises(InputError):
        convergence(group, u, 0.0)


def test_the_end_of_the_chart_of_the_area_rule() -> None:
    """SO(3): zbar_2 = eps^2 t / T Area_31 reaches pi / 2."""
    so3 = lc.group("so3")
    u = lc.PeriodicInput(["cos(t)", "0", "sin(t)"], "2*pi")
    averaged = lc.average(so3, u, 2, "product")
    assert chart_end(averaged, 0.2, 2.5) is None
    assert chart_end(averaged, 0.2, 25.0) == pytest.approx(np.pi / 2 / (0.04 * 0.5), rel=0.01)
    with pytest.warns(AssumptionWarning, match="leaves its chart"):
        lc.order_check(so3, u, 2, "product", horizon=16.0, eps=(0.2, 0.1))
    g = np.random.default_rng(5).normal(size=(4, 3))
    np.testing.assert_allclose(inverse_determinant(so3, g), np.cos(g[:, 1]), atol=1e-14)


def test_the_corollaries_bounds_hold_with_the_printed_constants() -> None:
    so3 = lc.group("so3")
    for order, texts in ((1, MIXED), (2, ["cos(t)", "sin(t)", "1/2*cos(2*t)"])):
        check = corollary_check(so3, lc.PeriodicInput(texts, "2*pi"), order, horizon=1.5, eps=(0.2, 0.1))
        assert check.holds, check
        assert max(check.norm) > 0.05 * max(check.norm_bound)
    rng = np.random.default_rng(0)
    lib = lc.build(so3)
    g, h = rng.uniform(-1, 1, (2, 500, 3))
    relative = np.linalg.inv(lib.product_exp.batch(g)) @ lib.product_exp.batch(h)
    delta = np.sum(np.abs(g - h), axis=1)
    small = delta < np.pi / 2
    norm = np.sum(np.abs(relative - np.eye(3)), axis=(1, 2))
    assert np.all(norm[small] <= corollary_bound(delta[small]))
