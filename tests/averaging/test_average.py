"""Averages of any order: published closed forms, areas and moments, and independent monodromies."""

from __future__ import annotations

import time
from fractions import Fraction

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm, logm

import lie_codegen as lc
from lie_codegen.averaging.areas import area_rate, moment_rate
from lie_codegen.averaging.nilpotent import nilpotency_step
from lie_codegen.errors import AssumptionError, AssumptionWarning, InputError, ShapeError
from lie_codegen.flow.batched_exponential import expm as batched_expm
from lie_codegen.flow.batched_exponential import logm as batched_logm

MIXED = ["1/2 + cos(t)", "-3/10 + sin(t) + 3/10*cos(2*t)", "4/10 + 1/2*cos(t + 1)"]
ZERO_MEAN = ["1/2*cos(t)", "sin(t) + 3/10*cos(2*t)", "1/2*cos(t) + sin(2*t)"]


def monodromy(group: lc.MatrixGroup, u: lc.PeriodicInput, eps: float) -> np.ndarray:
    """X(T) by an explicit Runge-Kutta method of order 8 on the entries."""
    d = group.degree

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        return (x.reshape(d, d) @ group.hat(eps * u(t))).ravel()

    start = np.eye(d, dtype=group.basis.dtype).ravel()
    return solve_ivp(rate, (0, u.T), start, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1].reshape(d, d)


def test_so3_closed_form_to_order_ten() -> None:
    """F = (1 - (1 + eps^2)^(-1/2)) (eps, 0, 1) for u = (cos t, sin t, 0)."""
    averaged = lc.average(lc.group("so3"), lc.PeriodicInput(["cos(t)", "sin(t)", "0"], period="2*pi"), order=10)
    eps = sp.Symbol("eps")
    series = sp.series((1 - (1 + eps**2) ** sp.Rational(-1, 2)) * eps, eps, 0, 12).removeO()
    for q in range(1, 11):
        expected = [series.coeff(eps, q), 0, series.coeff(eps, q + 1)]
        assert list(averaged.exact_F[q - 1]) == expected


@pytest.mark.parametrize("name", ["so3", "se2", "sl2", "su2", "h3", "aff1", "engel"])
def test_the_rates_are_the_logarithm_of_an_independent_monodromy(name: str) -> None:
    group = lc.group(name)
    u = lc.PeriodicInput([*MIXED, "cos(2*t) - 1/5"][: group.dim], "2*pi")
    averaged = lc.average(group, u, order=8)
    eps = 0.05
    expected = group.project(logm(monodromy(group, u, eps))) / u.T
    np.testing.assert_allclose(averaged.rate(eps), expected, atol=2e-10)


def test_irrational_structure_constants_stay_exact() -> None:
    group = lc.group("su3")
    u = lc.PeriodicInput(["cos(t)", "0", "0", "sin(t)", "1/2*cos(2*t)", "0", "0", "1/3*sin(t)"], "2*pi")
    averaged = lc.average(group, u, order=4)
    assert averaged.u.exact
    eps = 0.02
    expected = group.project(logm(monodromy(group, u, eps))) / u.T
    np.testing.assert_allclose(averaged.rate(eps), expected, atol=3e-9)
    assert any(value.has(sp.sqrt(3)) for f in averaged.exact_F for value in f)


def test_a_period_other_than_two_pi_scales() -> None:
    group = lc.group("so3")
    slow = lc.average(group, lc.PeriodicInput(MIXED, "2*pi"), order=4)
    quicker = ["1/2 + cos(5*t)", "-3/10 + sin(5*t) + 3/10*cos(10*t)", "4/10 + 1/2*cos(5*t + 1)"]
    fast = lc.average(group, lc.PeriodicInput(quicker), order=4)
    for q in range(4):
        assert sp.expand(slow.exact_F[q] - fast.exact_F[q] * 5**q) == sp.zeros(3, 1)


def test_areas_and_moments_by_quadrature_with_and_without_a_mean() -> None:
    for texts in (MIXED, ZERO_MEAN):
        u = lc.PeriodicInput(texts, "2*pi")
        averaged = lc.average(lc.group("so3"), u, order=1)

        def wedge(t: float, i: int, j: int, u: lc.PeriodicInput = u) -> float:
            v, w = u(t), u.integral(t)
            return w[i] * v[j] - w[j] * v[i]

        area = [[quad(wedge, 0, u.T, args=(i, j))[0] / 2 for j in range(3)] for i in range(3)]
        np.testing.assert_allclose(averaged.areas, area, atol=1e-11)
        moment = [[[quad(lambda t, i, j, k, u=u: wedge(t, i, j) * u.integral(t)[k], 0, u.T, args=(i, j, k))[0] / 3
                    for k in range(3)] for j in range(3)] for i in range(3)]  # fmt: skip
        np.testing.assert_allclose(averaged.moments, moment, atol=1e-10)


@pytest.mark.parametrize("name", ["so3", "se2", "sl2", "h3", "su2"])
def test_the_second_and_third_rates_are_areas_and_moments(name: str) -> None:
    group = lc.group(name)
    u = lc.PeriodicInput(ZERO_MEAN, "2*pi")
    averaged = lc.average(group, u, order=3)
    assert averaged.exact_F[1] == area_rate(group.algebra, averaged.exact_areas, u.period)
    assert averaged.exact_F[2] == moment_rate(group.algebra, averaged.exact_moments, u.period)


def test_lambda_is_periodic_vanishes_at_zero_and_is_evaluated_as_written() -> None:
    averaged = lc.average(lc.group("so3"), lc.PeriodicInput(MIXED, "2*pi"), order=4)
    assert len(averaged.Lambda) == 3
    t = sp.Symbol("t", real=True)
    for wave, exact in zip(averaged.Lambda, averaged.exact_Lambda, strict=True):
        np.testing.assert_allclose(wave(0.0), 0.0, atol=1e-15)
        np.testing.assert_allclose(wave(1.7), wave(1.7 + 2 * np.pi), atol=1e-13)
        np.testing.assert_allclose(wave(1.7), [float(value) for value in exact.subs(t, 1.7)], atol=1e-13)


def test_sampled_and_exact_inputs_give_one_average() -> None:
    group, exact = lc.group("so3"), lc.PeriodicInput(MIXED, "2*pi")
    sampled = lc.PeriodicInput.from_callable(exact, "2*pi")
    a, b = lc.average(group, exact, order=5), lc.average(group, sampled, order=5)
    for x, y in zip(a.F, b.F, strict=True):
        np.testing.assert_allclose(x, y, atol=1e-14)
    np.testing.assert_allclose(a.state(0.1, [3.0, 40.0]), b.state(0.1, [3.0, 40.0]), atol=1e-13)
    np.testing.assert_allclose(a.moments, b.moments, atol=1e-12)


def test_symbolic_amplitudes_and_phases_then_numbers() -> None:
    group = lc.group("so3")
    u = lc.PeriodicInput(["A*cos(t)", "B*sin(t + phi)", "A*cos(2*t)"], "2*pi", ("A", "B", "phi"))
    averaged = lc.average(group, u, order=4)
    A, B, phi = u.symbols
    assert sp.simplify(averaged.exact_F[1][2] - A * B * sp.cos(phi) / 2) == 0
    values = {"A": Fraction(1, 2), "B": 0.3, "phi": 0.7}
    numeric = averaged.at(**values)
    for symbolic, number in zip(averaged.exact_F, numeric.F, strict=True):
        substituted = [float(entry.subs({A: 0.5, B: 0.3, phi: 0.7})) for entry in symbolic]
        np.testing.assert_allclose(substituted, number, atol=1e-16)
    with pytest.raises(InputError, match="have no values"):
        averaged.state(0.1, 1.0)


def test_states_of_every_form_against_scipy() -> None:
    group, u = lc.group("se2"), lc.PeriodicInput(ZERO_MEAN, "2*pi")
    eps, t = 0.13, 7.7
    floquet = lc.average(group, u, 3)
    mean = sum(eps**q * f for q, f in enumerate(floquet.F, start=1))
    wave = sum(eps**q * f(t) for q, f in enumerate(floquet.Lambda, start=1))
    np.testing.assert_allclose(floquet.state(eps, t), expm(t * group.hat(mean)) @ expm(group.hat(wave)), atol=1e-14)
    g = eps**2 * t * floquet.F[1] + eps * u.integral(t)
    product = np.linalg.multi_dot([expm(x * A) for x, A in zip(g, group.basis, strict=True)])
    np.testing.assert_allclose(lc.average(group, u, 2, "product").state(eps, t), product, atol=1e-14)
    np.testing.assert_allclose(lc.average(group, u, 2, "single").state(eps, t), expm(group.hat(g)), atol=1e-14)
    first = lc.average(group, lc.PeriodicInput(MIXED, "2*pi"), 1)
    np.testing.assert_allclose(first.state(eps, t), expm(group.hat(eps * t * first.F[0])), atol=1e-14)
    times = np.array([[0.0, 1.0], [2.0, 7.7]])
    assert floquet.state(eps, times).shape == (2, 2, 3, 3)
    np.testing.assert_allclose(floquet.state(eps, times)[1, 1], floquet.state(eps, t), atol=1e-15)


def test_an_initial_element_multiplies_from_the_left() -> None:
    group, u = lc.group("so3"), lc.PeriodicInput(ZERO_MEAN, "2*pi")
    start = expm(group.hat([0.3, 2.0, -1.0]))
    for form in ("floquet", "product", "single"):
        moved = lc.average(group, u, 2, form, X0=start)
        np.testing.assert_allclose(
            moved.state(0.1, 3.0), start @ lc.average(group, u, 2, form).state(0.1, 3.0), atol=1e-15
        )


def test_refusals_name_theorem_and_condition() -> None:
    group = lc.group("so3")
    with pytest.raises(AssumptionError, match=r"Theorem 3.*u_av = 0.*1/2"):
        lc.average(group, lc.PeriodicInput(MIXED, "2*pi"), 2, "product")
    with pytest.raises(AssumptionError, match="Theorem 4"):
        lc.average(group, lc.PeriodicInput(MIXED, "2*pi"), 3, "single")
    with pytest.raises(ShapeError, match="2 components, so3 has 3"):
        lc.average(group, lc.PeriodicInput(["cos(t)", "0"]), 2)
    with pytest.raises(InputError, match="orders 1, 2"):
        lc.average(group, lc.PeriodicInput(ZERO_MEAN, "2*pi"), 3, "product")
    with pytest.raises(InputError, match="no form"):
        lc.average(group, lc.PeriodicInput(ZERO_MEAN, "2*pi"), 2, "triple")
    with pytest.raises(InputError, match="order must be"):
        lc.average(group, lc.PeriodicInput(ZERO_MEAN, "2*pi"), 0)
    square = lc.PeriodicInput.from_pieces([(1, ["1", "0", "0"]), (2, ["-1", "0", "0"])])
    with pytest.warns(AssumptionWarning, match=r"Theorem 3.*t = 0, 1"):
        lc.average(group, square, 2, "product")


def test_lemma_3_brackets_of_the_columns_of_m_are_the_structure_constants() -> None:
    """(30): [f_i, f_j](0) = Gamma_ij for the columns of M(g), with [F, G] = DG F - DF G."""
    for name in ("so3", "sl2", "se2"):
        group = lc.group(name)
        wn = lc.wei_norman(group)
        zero = dict.fromkeys(wn.g, 0)
        columns = [sp.Matrix(wn.M[:, j]) for j in range(group.dim)]
        slopes = [column.jacobian(wn.g).subs(zero) for column in columns]
        for i in range(group.dim):
            for j in range(group.dim):
                bracket = slopes[j] * columns[i].subs(zero) - slopes[i] * columns[j].subs(zero)
                expected = [float(value) for value in group.algebra.structure_constants[i, j]]
                np.testing.assert_allclose(np.array(bracket, dtype=float).ravel(), expected, atol=1e-14)


def test_a_jump_at_whole_periods_is_flagged_too() -> None:
    saw = lc.PeriodicInput.from_callable(lambda t: np.stack([t - 1, 0 * t, 0 * t], axis=-1), 2)
    assert saw.jumps == (0.0,)
    with pytest.warns(AssumptionWarning, match="t = 0"):
        lc.average(lc.group("so3"), saw, 2)


@pytest.mark.parametrize(
    ("name", "step"), [("h3", 2), ("engel", 3), ("so3", None), ("se2", None), ("r3", 1), ("aff1", None)]
)
def test_nilpotency(name: str, step: int | None) -> None:
    assert nilpotency_step(lc.group(name).algebra) == step


def test_exact_averages_are_fast() -> None:
    """Best of three in processor time, to be fair to a busy machine."""

    def best(job: object) -> float:
        seconds = []
        for _ in range(3):
            start = time.process_time()
            job()  # type: ignore[operator]
            seconds.append(time.process_time() - start)
        return min(seconds)

    so3, se3 = lc.group("so3"), lc.group("se3")
    full = lc.PeriodicInput(MIXED, "2*pi")
    assert best(lambda: lc.average(so3, full, 6)) < 0.1
    four = lc.PeriodicInput(["cos(t) + 1/10", "sin(t)", "cos(2*t)", "sin(2*t) + 1/3", "0", "0"], "2*pi")
    assert best(lambda: lc.average(se3, four, 5)) < 1
    symbolic = lc.PeriodicInput(["A*cos(t)", "B*sin(t) + C*cos(2*t)", "D*cos(t)"], "2*pi", ("A", "B", "C", "D"))
    assert best(lambda: lc.average(so3, symbolic, 4)) < 2


def test_batched_exponential_and_logarithm_against_scipy() -> None:
    rng = np.random.default_rng(3)
    A = 0.6 * rng.normal(size=(20, 4, 4))
    X = batched_expm(A)
    np.testing.assert_allclose(X, [expm(a) for a in A], atol=5e-14)
    np.testing.assert_allclose(batched_logm(X), [logm(x) for x in X], atol=2e-13)
    np.testing.assert_allclose(batched_expm(40 * A[:1]), expm(40 * A[0])[None], rtol=1e-10)
    assert np.all(np.isnan(batched_logm(np.diag([-1.0, -1.0, 1.0]))))
