"""Orbits and multipliers against published numbers, SciPy's flow and differences of it, and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from mechanical_systems import pendulum
from scipy.integrate import solve_ivp

import lie_codegen as lc
from lie_codegen.errors import ComputationError, InputError, PeriodError

PENDULUM = ["v", "-x + mu*(1 - x^2)*v"]


def by_differences(f, start, period, step=1e-5):
    """The monodromy matrix from SciPy's flow alone."""

    def flow(y):
        return solve_ivp(f, (0, period), y, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]

    units = step * np.eye(len(start))
    return np.stack([(flow(start + u) - flow(start - u)) / (2 * step) for u in units], axis=1)


def test_van_der_pol_published():
    orbit = lc.floquet(PENDULUM, variables=("x", "v"), guess=(2, 0), parameters={"mu": 0.5})
    np.testing.assert_allclose(orbit.start, [2.002487930447, 0], atol=1e-11)
    assert orbit.period == pytest.approx(6.380675801774, abs=1e-11)
    np.testing.assert_allclose(orbit.multipliers, [1, 0.0391769202], atol=1e-10)
    assert orbit.stable
    assert orbit.trivial_error < 1e-11
    assert orbit.liouville < 1e-11
    np.testing.assert_allclose(orbit.at([0, orbit.period]), [orbit.start] * 2, atol=1e-11)


@pytest.mark.parametrize("mu", [0.1, 1.3, 3.0])
def test_the_second_multiplier_is_liouvilles(mu):
    """One multiplier is 1, so the other is exp int tr Df = exp int mu (1 - x^2), by SciPy along SciPy's orbit."""
    orbit = lc.floquet(PENDULUM, variables=("x", "v"), guess=(2, 6.28), parameters={"mu": mu})

    def f(t, y):
        return [y[1], -y[0] + mu * (1 - y[0] ** 2) * y[1], mu * (1 - y[0] ** 2)]

    end = solve_ivp(f, (0, orbit.period), [*orbit.start, 0], method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    np.testing.assert_allclose(end[:2], orbit.start, atol=1e-10)
    np.testing.assert_allclose(orbit.multipliers[1].real, np.exp(end[2]), rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("mu", [5.0, 20.0])
def test_a_multiplier_far_below_rounding_is_known(mu):
    """1e-37 and, at mu = 20, below every double: exp int tr Df by SciPy again, where the monodromy matrix holds rounding alone."""
    orbit = lc.floquet(PENDULUM, variables=("x", "v"), guess=(2, 0), parameters={"mu": mu})

    def f(t, y):
        return [y[1], -y[0] + mu * (1 - y[0] ** 2) * y[1], mu * (1 - y[0] ** 2)]

    end = solve_ivp(f, (0, orbit.period), [*orbit.start, 0], method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    assert orbit.exponents[1] == pytest.approx(end[2] / orbit.period, rel=1e-7)
    assert orbit.multipliers[1] == pytest.approx(np.exp(end[2]), rel=1e-6, abs=0)
    assert orbit.trivial_error < 1e-10
    assert orbit.liouville < 1e-8


def test_a_contraction_of_everything_is_known():
    """x' = -300 x + cos t: one multiplier, exp(-600 pi) = 1e-819, which no double holds."""
    orbit = lc.floquet(["-300*x + cos(t)"], ("x",), (0.0,), period="2*pi")
    assert orbit.exponents[0] == pytest.approx(-300, rel=1e-11)
    assert orbit.liouville < 1e-8


@pytest.mark.filterwarnings("error")
def test_a_motion_that_leaves_is_refused_by_name():
    with pytest.raises(ComputationError, match="does not return"):
        lc.floquet(["x", "y"], ("x", "y"), (1.0, 1.0))


def test_a_relaxation_oscillation_is_found_from_a_rough_guess():
    """The first return from (2, 0) at mu = 50 takes 82.29 instead of 82.51; the components differ by a factor of 33 in size."""
    orbit = lc.floquet(PENDULUM, variables=("x", "v"), guess=(2, 0), parameters={"mu": 50.0})

    def f(t, y):
        return [y[1], -y[0] + 50 * (1 - y[0] ** 2) * y[1]]

    end = solve_ivp(f, (0, orbit.period), orbit.start, method="Radau", rtol=1e-10, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(end, orbit.start, atol=1e-6)
    assert orbit.residual < 1e-10
    assert orbit.stable


@pytest.mark.parametrize("rates", [(0.1, -1, -1.1, -5), (0.05, -30, -60), (-0.1, -0.2, -8, -8.05, -8.1, -20)])
def test_exponents_of_any_spread_come_back(rates):
    """A linear system with these exponents in skew directions, driven so that its orbit is not at rest; and with turning pairs."""
    n = len(rates)
    skew = np.random.default_rng(0).integers(-3, 4, size=(n, n)) + 4 * np.eye(n)
    turning = np.diag(np.array(rates, dtype=float))
    turning[-2:, -2:] = [[rates[-1], 0.3], [-0.3, rates[-1]]]
    for core, expected in (
        (np.diag(rates), np.array(rates, dtype=complex)),
        (turning, np.array([*rates[:-2], rates[-1] + 0.3j, rates[-1] - 0.3j])),
    ):
        whole = skew @ core @ np.linalg.inv(skew)
        names = [f"y{i}" for i in range(n)]
        formulas = [
            " + ".join(f"({a:.17g})*{name}" for a, name in zip(row, names, strict=True)) + " + sin(t)" for row in whole
        ]
        orbit = lc.floquet(formulas, names, np.zeros(n), period="2*pi")
        np.testing.assert_allclose(orbit.exponents, expected, atol=1e-9)


def test_duffing_published_and_by_differences():
    rates = ["v", "-0.2*v - x - x^3 + 0.5*cos(1.4*t)"]
    orbit = lc.floquet(rates, variables=("x", "v"), guess=(0.8, 1.3), period="2*pi/1.4")
    np.testing.assert_allclose(orbit.start, [0.861287429, 1.368699925], atol=1e-9)
    np.testing.assert_allclose(orbit.multipliers, 0.2506784066 + np.array([1, -1]) * 0.5871182084j, atol=1e-10)

    def f(t, y):
        return [y[1], -0.2 * y[1] - y[0] - y[0] ** 3 + 0.5 * np.cos(1.4 * t)]

    np.testing.assert_allclose(orbit.monodromy, by_differences(f, orbit.start, orbit.period), atol=1e-8)
    assert orbit.trivial is None
    assert np.isnan(orbit.trivial_error)


def magnetic_regulator():
    field = ["cos(t)*sin(i)", "(-cos(i))", "2*sin(t)*sin(i)"]
    square = "(cos(i)^2 + sin(i)^2*(cos(t)^2 + 4*sin(t)^2))"
    command = [f"(9*p{n} + 9*n{n})" for n in (1, 2, 3)]
    along = "(" + " + ".join(f"{b}*{c}" for b, c in zip(field, command, strict=True)) + ")"
    rates = [f"eps*n{n}" for n in (1, 2, 3)]
    return rates + [
        f"-eps/{J}*({c} - {b}*{along}/{square})" for J, c, b in zip((10, 12, 8), command, field, strict=True)
    ]


def test_magnetic_regulator_published():
    names = ("p1", "p2", "p3", "n1", "n2", "n3")
    orbit = lc.floquet(magnetic_regulator(), names, np.zeros(6), period="2*pi", parameters={"eps": 0.2, "i": 1.2})
    assert orbit.exponents.real.max() == pytest.approx(-0.0417938438, abs=1e-10)
    assert orbit.averaged_exponents.real.max() == pytest.approx(
        -0.0414901509, abs=1e-10
    )  # the eigenvalue of <Df> by 40 digits
    np.testing.assert_allclose(abs(orbit.multipliers)[::2], [0.76905064, 0.67404944, 0.64511282], atol=1e-8)
    assert orbit.stable


def test_exponents_tend_to_those_of_the_averaged_system():
    names = ("p1", "p2", "p3", "n1", "n2", "n3")
    gaps = []
    for eps in (0.1, 0.05):
        found = lc.floquet(magnetic_regulator(), names, np.zeros(6), period="2*pi", parameters={"eps": eps, "i": 1.2})
        gaps.append(abs(found.exponents.real.max() - found.averaged_exponents.real.max()) / eps)
    assert gaps[1] < 0.6 * gaps[0] < 0.01


def test_a_repelling_orbit_backwards_in_time():
    forward = lc.floquet(PENDULUM, ("x", "v"), (2, 0), parameters={"mu": 0.5})
    backward = lc.floquet(["-v", "x - mu*(1 - x^2)*v"], ("x", "v"), (2, 0.1), parameters={"mu": 0.5}, transient=False)
    assert not backward.stable
    assert backward.period == pytest.approx(forward.period, abs=1e-10)
    assert backward.multipliers[0].real == pytest.approx(1 / forward.multipliers[1].real, rel=1e-8)


def test_a_rotation_has_the_multipliers_of_its_angle():
    """A harmonic oscillator of frequency w watched over another period T: exp(+- i w T)."""
    orbit = lc.floquet(["v", "-4*x + cos(t)"], ("x", "v"), (0, 0), period="2*pi/1")
    np.testing.assert_allclose(orbit.monodromy, np.eye(2), atol=1e-11)
    other = lc.floquet(["v", "-2*x + cos(t)"], ("x", "v"), (0, 0), period="2*pi")
    np.testing.assert_allclose(
        sorted(other.multipliers.imag), np.array([-1, 1]) * abs(np.sin(2 * np.pi * 2**0.5)), atol=1e-11
    )


def test_a_kernel_with_parameters():
    def rate(ops, y, t, a):
        return ([y[1], -a * y[1] - y[0] + ops.cos(t)],)

    kernel = lc.Kernel(
        "rate", "forced", (lc.Port("y", (2,)), lc.Port("t", ()), lc.Port("a", ())), (lc.Port("y_dot", (2,)),), rate
    )
    orbit = lc.floquet(kernel, guess=(0, 0), period="2*pi", parameters={"a": 0.5})
    np.testing.assert_allclose(orbit.start, [0, 2], atol=1e-12)  # x = 2 sin t
    assert orbit.multipliers.prod().real == pytest.approx(np.exp(-np.pi), rel=1e-10)


def test_a_vibrated_loop_is_its_true_system():
    """Kapitza's pendulum upright, th'' = 9.81 sin th - 0.2 th' + sin th u(t/eps)/eps: SciPy's flow, and the average's spring."""
    u = lc.PeriodicInput(["beta*cos(t) + 2*sin(2*t)"], period="2*pi", parameters=("beta",))
    design = lc.vibrational_average(pendulum(), u)
    errors = []
    for eps in (0.05, 0.0125):
        orbit = lc.floquet(design, guess=(0.05, 0.0), parameters={"eps": eps, "beta": 6})
        assert orbit.period == pytest.approx(2 * np.pi * eps)

        def f(t, y, eps=eps):
            drive = (6 * np.cos(t / eps) + 2 * np.sin(2 * t / eps)) / eps
            return [y[1], 9.81 * np.sin(y[0]) - 0.2 * y[1] + np.sin(y[0]) * drive]

        np.testing.assert_allclose(orbit.monodromy, by_differences(f, orbit.start, orbit.period), atol=1e-7)
        # the mean square of the primitive of u is 6^2/2 + 1^2/2: V'' = 18.5 - 9.81, damped by c / 2
        frequency = np.sqrt(18.5 - 9.81 - 0.01)
        np.testing.assert_allclose(orbit.exponents.real, -0.1, atol=1e-9)
        errors.append(abs(abs(orbit.exponents[0].imag) - frequency))
        assert orbit.stable
    assert errors[1] < errors[0] / 3.5  # O(eps), eps a quarter
    assert not lc.floquet(design, guess=(0.0, 0.0), parameters={"eps": 0.0125, "beta": 2}).stable
    with pytest.raises(InputError, match="eps"):
        lc.floquet(design, guess=(0.0, 0.0))


def test_refusals():
    with pytest.raises(InputError, match="is an equilibrium"):
        lc.floquet(PENDULUM, ("x", "v"), (0, 0), parameters={"mu": 1})
    with pytest.raises(ComputationError, match="equilibrium"):
        lc.floquet(["v", "-x - 0.5*v"], ("x", "v"), (1, 0))
    with pytest.raises(PeriodError, match="give its period"):
        lc.floquet(["v", "-x - v + cos(t)"], ("x", "v"), (1, 0))
    with pytest.raises(PeriodError, match="is not f"):
        lc.floquet(["v", "-x - v + cos(t)"], ("x", "v"), (1, 0), period=6)
    with pytest.raises(PeriodError, match="not positive"):
        lc.floquet(["v", "-x - v + cos(t)"], ("x", "v"), (1, 0), period=-1)
    with pytest.raises(InputError, match="has no value"):
        lc.floquet(PENDULUM, ("x", "v"), (1, 0), parameters={"mu": None})
    with pytest.raises(ComputationError):
        lc.floquet(["x^2 + 1"], ("x",), (1,))


def test_an_orbit_is_a_value(tmp_path):
    orbit = lc.floquet(PENDULUM, ("x", "v"), (2, 0), parameters={"mu": 0.5})
    assert lc.load(orbit.save(tmp_path / "orbit.npz")) == orbit


def test_an_orbit_that_doubles_cannot_hold_is_said_to_be_one() -> None:
    """x' = 12 x + cos t multiplies errors by e^75 in a period: no guess helps, and backward in time the orbit is found."""
    with pytest.raises(ComputationError, match="backward in time"):
        lc.floquet(["12*x + cos(t)"], ("x",), (0.0,), period="2*pi")
    back = lc.floquet(["-12*x - cos(t)"], ("x",), (0.0,), period="2*pi")
    np.testing.assert_allclose(back.exponents, [-12], rtol=1e-10)
