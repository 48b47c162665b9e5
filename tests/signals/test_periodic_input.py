"""PeriodicInput: exact trigonometric polynomials, samples, refusals."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import quad
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.averaging.areas import areas
from lie_codegen.errors import AssumptionWarning, ExpressionError, InputError, NotFiniteError, PeriodError, ShapeError
from lie_codegen.exact.expression import time_symbol
from lie_codegen.flow.reference_flow import reference_flow
from lie_codegen.signals.coefficients import CoefficientRing
from lie_codegen.signals.periodic_input import PeriodicInput

TEXTS = ["cos(t)^3*sin(2*t) + 1/7", "sqrt(2)*cos(2*t + pi/4)^2", "cos(t + 1)*sin(t - 3/10)", "0", "pi*sin(3*t) - 1/2"]


def plain(t: float) -> np.ndarray:
    """TEXTS by hand."""
    return np.array(
        [
            np.cos(t) ** 3 * np.sin(2 * t) + 1 / 7,
            np.sqrt(2) * np.cos(2 * t + np.pi / 4) ** 2,
            np.cos(t + 1) * np.sin(t - 0.3),
            0.0,
            np.pi * np.sin(3 * t) - 0.5,
        ]
    )


def test_values_means_and_primitives_agree_with_quadrature() -> None:
    u = PeriodicInput(TEXTS, "2*pi")
    assert u.exact
    for t in (0.0, 0.7, 5.9, -3.3, 40.0):
        np.testing.assert_allclose(u(t), plain(t), atol=1e-14)
    for i in range(u.dim):
        mean = quad(lambda t, i=i: plain(t)[i], 0, 2 * np.pi, epsabs=1e-13)[0] / (2 * np.pi)
        assert u.mean[i] == pytest.approx(mean, abs=1e-13)
        assert u.integral(2.3)[i] == pytest.approx(quad(lambda t, i=i: plain(t)[i], 0, 2.3, epsabs=1e-13)[0], abs=1e-12)


def test_the_normal_form_is_canonical() -> None:
    u = PeriodicInput(
        ["sin(t)^2 + cos(t)^2 - 1", "(cos(t) + sin(t))^2 - 1 - sin(2*t)", "sqrt(2)*sqrt(3)*cos(t) - sqrt(6)*cos(t)"]
    )
    assert list(u.expressions) == [0, 0, 0]
    assert list(PeriodicInput(["4*cos(t)^3 - 3*cos(t)"]).expressions) == [sp.cos(3 * time_symbol())]


def test_floats_are_taken_at_their_binary_value() -> None:
    t = sp.Symbol("t")
    u = PeriodicInput([0.1, 0.3 * sp.cos(t + 0.7)], "2*pi")
    assert u.exact_mean[0] == sp.Rational(*(0.1).as_integer_ratio())
    assert u(1.1)[1] == pytest.approx(0.3 * np.cos(1.8), abs=1e-16)


def test_shapes_and_equal_bits_for_scalars_and_arrays() -> None:
    u = PeriodicInput(["cos(t)", "sin(3*t)"])
    times = np.linspace(0, 9, 12).reshape(3, 4)
    assert u(0.3).shape == (2,)
    assert u(times).shape == (3, 4, 2)
    assert np.array_equal(u(times)[1, 2], u(float(times[1, 2])))


def test_the_smallest_common_period_is_found() -> None:
    assert PeriodicInput(["cos(2*t/3)", "sin(t/2)"]).period == 12 * sp.pi
    assert PeriodicInput(["cos(2*t)", "sin(4*t)"]).period == sp.pi
    assert PeriodicInput(["cos(2*pi*t)"]).period == 1
    assert PeriodicInput(["cos(t)"], 2 * np.pi).period == 2 * sp.pi
    assert PeriodicInput(["cos(t)"], 4 * np.pi).period == 4 * sp.pi
    assert PeriodicInput(["cos(w*t)", "sin(3*w*t)"], parameters=("w",)).period == 2 * sp.pi / sp.Symbol("w", real=True)


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"components": ["cos(t)", "cos(sqrt(2)*t)"]}, PeriodError, "no common period"),
        ({"components": ["cos(2*t/3)"], "period": "2*pi"}, PeriodError, "common period 3\\*pi"),
        ({"components": ["cos(t)", "t"], "period": "2*pi"}, PeriodError, "component 2, t, is not periodic"),
        ({"components": ["exp(cos(t))"]}, PeriodError, "give its period"),
        ({"components": ["tan(t)"], "period": "pi"}, InputError, "singularity"),
        ({"components": ["cos(t)"], "period": 6.2831853}, PeriodError, "common period 2\\*pi"),
        ({"components": ["cos(t)"], "period": -1}, PeriodError, "not positive"),
        ({"components": ["a*cos(t)"]}, ExpressionError, "no name 'a'"),
        ({"components": [sp.Symbol("a") * sp.cos(sp.Symbol("t"))]}, InputError, "not declared"),
        ({"components": ["a*exp(cos(t))"], "period": "2*pi", "parameters": ("a",)}, InputError, "have none"),
        ({"components": ["__import__('os')"]}, ExpressionError, "column"),
        ({"components": "cos(t)"}, InputError, "list of formulas"),
        ({"components": []}, InputError, "no component"),
    ],
)
def test_refusals_name_the_culprit(arguments: dict, error: type, words: str) -> None:
    with pytest.raises(error, match=words):
        PeriodicInput(**arguments)


def test_parameters_may_be_amplitudes_phases_and_frequencies() -> None:
    u = PeriodicInput(["A*cos(w*t + phi) + B", "A^2*sin(w*t + phi/2)*cos(phi)"], parameters=("A", "B", "phi", "w"))
    assert [str(s) for s in u.symbols] == ["A", "B", "phi", "w"]
    with pytest.raises(InputError, match="have no values"):
        u(0.0)
    v = u.at(A=0.7, B=0.2, phi=0.3, w=2.0)
    assert v.symbols == ()
    t = 1.234
    expected = [0.7 * np.cos(2 * t + 0.3) + 0.2, 0.49 * np.sin(2 * t + 0.15) * np.cos(0.3)]
    np.testing.assert_allclose(v(t), expected, atol=1e-15)
    with pytest.raises(InputError, match="not a parameter"):
        u.at(C=1)


def test_other_formulas_are_sampled_with_the_same_interface() -> None:
    u = PeriodicInput(["exp(cos(t))", "abs(sin(t))", "1"], period="2*pi", breakpoints=(np.pi,))
    assert not u.exact
    assert u.mean[0] == pytest.approx(1.2660658777520084, abs=1e-14)
    assert u.mean[1] == pytest.approx(2 / np.pi, abs=1e-13)
    assert u.integral(7.5)[2] == pytest.approx(7.5, abs=1e-13)
    assert u.integral(4.0)[1] == pytest.approx(3 + np.cos(4.0), abs=1e-12)


def test_fourier_coefficients_and_samples() -> None:
    rng = np.random.default_rng(1)
    a, b, m = rng.normal(size=(3, 2)), rng.normal(size=(3, 2)), rng.normal(size=2)
    u = PeriodicInput.from_fourier(a, b, mean=m, period=3)
    k = np.arange(1, 4)
    angle = 2 * np.pi * k * 0.41 / 3
    np.testing.assert_allclose(u(0.41), m + np.cos(angle) @ a + np.sin(angle) @ b, atol=1e-14)
    rate = (2 * np.pi * k / 3)[:, None]
    primitive = 0.41 * m + np.sin(angle) @ (a / rate) + (1 - np.cos(angle)) @ (b / rate)
    np.testing.assert_allclose(u.integral(0.41), primitive, atol=1e-14)
    for count in (5, 6):
        samples = rng.normal(size=(count, 2))
        through = PeriodicInput.from_samples(samples, "2*pi")
        np.testing.assert_allclose(through(2 * np.pi * np.arange(count) / count), samples, atol=1e-13)
    with pytest.raises(ShapeError):
        PeriodicInput.from_fourier([[1, 2]], [[1]])
    with pytest.raises(NotFiniteError):
        PeriodicInput.from_samples([[np.nan], [0.0]], 1)


def test_pieces_start_anew_and_repeat_and_stay_exact() -> None:
    square = PeriodicInput.from_pieces([(1, ["1", "0"]), (2, ["0", "t"]), (4, ["-1/2", "-3/4"])])
    assert square.exact
    assert square.zero_mean
    np.testing.assert_allclose(square([0.5, 1.5, 3.0, 4.5]), [[1, 0], [0, 1.5], [-0.5, -0.75], [1, 0]])
    assert square.breakpoints == (1.0, 2.0)
    assert square.integral(1.5)[1] == pytest.approx((1.5**2 - 1) / 2, abs=1e-14)
    mixed = PeriodicInput.from_pieces([("pi", ["t*cos(2*t)", "A*t^2"]), ("2*pi", ["sin(t)", "-A"])], parameters=("A",))
    A = sp.Symbol("A", real=True)
    assert list(mixed.exact_mean) == [-1 / sp.pi, sp.expand(A * sp.pi**2 / 6 - A / 2)]
    assert not PeriodicInput.from_pieces([(1, ["exp(t)"]), (2, ["0"])]).exact
    with pytest.raises(InputError, match="must increase"):
        PeriodicInput.from_pieces([(1, ["1"]), (1, ["0"])])
    with pytest.raises(InputError, match="commensurate"):
        PeriodicInput.from_pieces([(1, ["a*exp(t)"]), (2, ["0"])], parameters=("a",))


def manoeuvre() -> PeriodicInput:
    """(62)-(63) of TR 93-59 with the numbers of section 5.2, as eps u."""
    half = "pi/2"
    return PeriodicInput.from_pieces(
        [
            (1, [f"1/10*{half}*sin({half}*t)", f"1/20*{half}*sin({half}*t)", "0"]),
            (21, [f"1/10*{half}*cos({half}*(t - 1))", f"1/20*sqrt(2)*{half}*cos({half}*(t - 1) - pi/4)", "0"]),
            (22, [f"1/10*{half}*cos({half}*(t - 21))", f"1/20*{half}*cos({half}*(t - 21))", "0"]),
            (24, [f"-1/20*{half}*sin({half}*(t - 22))", f"-1/40*{half}*sin({half}*(t - 22))", "0"]),
        ]
    )


def test_the_manoeuvre_of_section_5_2_exactly() -> None:
    u = manoeuvre()
    assert u.exact
    assert list(24 * u.exact_mean) == [sp.Rational(1, 10), sp.Rational(1, 20), 0]
    np.testing.assert_allclose(u.integral([1.0, 21.0, 22.0, 24.0])[:, 0], [0.1, 0.1, 0.2, 0.1], atol=1e-14)
    assert areas(u)[0, 1] == sp.pi / 40
    flow = reference_flow(lc.group("so3"), u, 1.0, 24.0)
    final = flow.X[int(np.argmax(flow.t))]
    g = [0.1039897509848151, 0.0500527635748268, 0.0755999303251700]
    expected = np.linalg.multi_dot([expm(x * A) for x, A in zip(g, lc.group("so3").basis, strict=True)])
    np.testing.assert_allclose(final, expected, atol=1e-12)


def test_pieces_and_quadrature_give_the_same_averages() -> None:
    group = lc.group("sl2")
    pieces = [("pi", ["t/3", "t*cos(2*t)", "1/2"]), ("2*pi", ["(2*pi - t)/3", "-cos(2*t + 1)", "-1/2"])]
    exact = PeriodicInput.from_pieces(pieces)
    sampled = PeriodicInput.from_callable(exact, exact.period, breakpoints=exact.breakpoints)
    with pytest.warns(AssumptionWarning):
        a, b = lc.average(group, exact, 4), lc.average(group, sampled, 4)
    for x, y in zip(a.F, b.F, strict=True):
        np.testing.assert_allclose(x, y, atol=1e-13)
    np.testing.assert_allclose(a.areas, b.areas, atol=1e-13)
    np.testing.assert_allclose(a.moments, b.moments, atol=1e-12)
    np.testing.assert_allclose(a.state(0.1, [2.0, 9.0]), b.state(0.1, [2.0, 9.0]), atol=1e-13)
    with pytest.warns(AssumptionWarning):
        assert lc.order_check(group, exact, 3, horizon=1.5).passed


def test_simulation_takes_periodic_inputs_and_their_repeated_jumps() -> None:
    so3 = lc.group("so3")
    square = PeriodicInput.from_pieces(
        [(1, ["1", "0", "0"]), (2, ["0", "1", "0"]), (3, ["-1", "0", "0"]), (4, ["0", "-1", "0"])]
    )
    np.testing.assert_allclose(square.breakpoints_between(2.5, 8.5), [3, 4, 5, 6, 7, 8])
    smooth = PeriodicInput(["cos(t) + 1/5", "sin(t)", "0"], "2*pi")
    for u in (square, smooth):
        flow = reference_flow(so3, u, 0.3, 20.0)
        run = lc.simulate(so3, u, eps=0.3, t=flow.t)
        np.testing.assert_allclose(run.X, flow.X, atol=2e-10)
        assert run.steps < 100_000


def test_linear_images_are_exact() -> None:
    u = PeriodicInput(["cos(t)", "A*sin(2*t) + 1"], parameters=("A",))
    v = u.linear([["1/2", "-1"], [0, "sqrt(3)"], [1, 1]])
    A = sp.Symbol("A", real=True)
    expected = [
        sp.cos(time_symbol()) / 2 - A * sp.sin(2 * time_symbol()) - 1,
        sp.sqrt(3) * (A * sp.sin(2 * time_symbol()) + 1),
    ]
    assert all(sp.expand(x - y) == 0 for x, y in zip(v.expressions, expected, strict=False))
    with pytest.raises(ShapeError):
        u.linear([[1, 2, 3]])


def test_the_coefficient_ring_reduces_square_roots() -> None:
    ring = CoefficientRing.holding([sp.sqrt(6) / 2, sp.sqrt(2), sp.pi])
    a, d = ring.element(sp.sqrt(6) / 2)
    b, e = ring.element(sp.sqrt(2) * sp.pi)
    assert sp.expand(ring.expression(ring.multiply(a, b), d * e) - sp.sqrt(3) * sp.pi) == 0
    with pytest.raises(InputError):
        ring.element(sp.sqrt(5))


def test_a_replaced_formula_is_the_one_that_is_evaluated() -> None:
    u = PeriodicInput(["sin(t)", "1"])
    moved = replace(u, components=("cos(t)", "2"))
    np.testing.assert_array_equal(moved(0.3), [np.cos(0.3), 2.0])
    slower = replace(PeriodicInput.from_fourier([[1.0, 0.0]]), period="4*pi")
    np.testing.assert_array_equal(slower(0.3), [np.cos(0.3), 0.0])
    assert 4 * np.pi == slower.T


@pytest.mark.parametrize(
    "make",
    [
        lambda: PeriodicInput(["sin(t) + 1/3", "cos(2*t + 1)"]),
        lambda: PeriodicInput(["exp(sin(t))", "cos(t)"], "2*pi"),
        lambda: PeriodicInput.from_fourier([[0.1, 2]], [[0, 3]], mean=["1/3", 0], period="sqrt(2)"),
        lambda: PeriodicInput.from_pieces([("1/2", ["t", "sin(t)"]), ("2", ["1 - t^2", "0"])]),
    ],
)
def test_an_input_found_by_its_record_is_the_one_that_was_derived(
    make: Callable[[], PeriodicInput], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LIE_CODEGEN_CACHE", str(tmp_path))
    derived, found = make(), make()
    t = np.linspace(-3, 7, 101)
    np.testing.assert_array_equal(found(t), derived(t))
    np.testing.assert_array_equal(found.mean, derived.mean)
    assert (found.T, found.dim, found.exact, found.zero_mean, found.jumps) == (
        derived.T, derived.dim, derived.exact, derived.zero_mean, derived.jumps,
    )  # fmt: skip
    assert found == derived == pickle.loads(pickle.dumps(found))
    np.testing.assert_allclose(found.integral(t), derived.integral(t), rtol=0, atol=1e-15)
