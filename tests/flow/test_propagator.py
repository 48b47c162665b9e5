"""lc.propagator: X(T; p), its exact derivatives, batches and powers."""

from __future__ import annotations

import pickle
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lie_codegen as lc
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.flow.magnus import tangents

QUBIT = lc.ParametricInput(["-2*a*cos(w*t + phi)", "0", "-1"], parameters=("a", "w", "phi"))
AT = {"a": 0.5, "w": 1.1, "phi": 0.3}


def variational(group: lc.MatrixGroup, u: lc.ParametricInput, at: dict[str, float], end: float) -> np.ndarray:
    """X and dX/dp by DOP853 on X' = X A, dX' = dX A + X dA, u and its slopes by central differences of the call alone."""
    d, m = group.degree, len(u.parameters)
    kind = complex if group.is_complex else float
    h = 1e-3

    def slope(t: float, name: str) -> np.ndarray:
        f = [u(t, **{**at, name: at[name] + k * h}) for k in (-2, -1, 1, 2)]
        return (f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * h)

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        X, *dX = y.reshape(m + 1, d, d)
        A = group.hat(u(t, **at))
        rows = [X @ A, *(dY @ A + X @ group.hat(slope(t, name)) for dY, name in zip(dX, u.parameters, strict=True))]
        return np.array(rows).ravel()

    start = np.zeros((m + 1, d, d), kind)
    start[0] = np.eye(d)
    breaks = [0.0, *(b for b in u.breakpoints if b < end), end]
    y = start.ravel()
    for a, b in pairwise(breaks):
        y = solve_ivp(rate, (a, b), y, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return y.reshape(m + 1, d, d)


def test_the_qubit_and_its_derivatives_have_the_stored_digits() -> None:
    U = lc.propagator(lc.group("su2"), QUBIT, duration=50.0, rtol=1e-12)
    p = U(**AT)
    assert p.X[0, 0] == pytest.approx(-0.65103089 + 0.65594865j, abs=1e-8)
    assert p.dX[0, 0, 0] == pytest.approx(-3.62524317 + 6.85994014j, abs=1e-8)
    assert p.dX[1, 0, 0] == pytest.approx(-16.51657424 - 17.54224662j, abs=1e-8)
    assert p.dX.shape == (3, 2, 2)
    assert p.eta.shape == (3, 3)
    for k in range(3):
        np.testing.assert_allclose(p.X @ lc.group("su2").hat(p.eta[k]), p.dX[k], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "texts"),
    [
        ("so3", ["a*cos(w*t)", "b*exp(-(t-1)^2)", "1"]),
        ("se3", ["a*cos(w*t)", "1/2", "b*t", "a^2", "sin(w*t)*cos(t)", "b"]),
        ("so7", [f"a*cos({k}*t/7) + b*w*sin({k + 1}*t/5)/4" for k in range(21)]),
        ("sl2", ["a*b", "cos(w*t)", "a*t"]),
    ],
)
def test_derivatives_are_those_of_the_variational_equation(name: str, texts: list[str]) -> None:
    group = lc.group(name)
    u = lc.ParametricInput(texts, parameters=("a", "b", "w"))
    at = {"a": 0.7, "b": -0.4, "w": 1.9}
    p = lc.propagator(group, u, duration=2.5)(**at)
    X, *dX = variational(group, u, at, 2.5)
    np.testing.assert_allclose(p.X, X, rtol=0, atol=1e-10 * np.max(np.abs(X)))
    np.testing.assert_allclose(p.dX, dX, rtol=0, atol=2e-9 * np.max(np.abs(dX)))


def test_without_a_compiler_the_derivatives_are_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    su2 = lc.group("su2")
    one = tangents.tangents(su2, QUBIT, AT, 3.0, 20)
    monkeypatch.setattr(tangents, "magnus_library", lambda group: None)
    np.testing.assert_allclose(tangents.tangents(su2, QUBIT, AT, 3.0, 20), one, rtol=0, atol=1e-13)


def test_breakpoints_of_a_formula_are_stepped_on() -> None:
    so3 = lc.group("so3")
    u = lc.ParametricInput(["a*abs(t - 0.7)", "b", "0"], parameters=("a", "b"), breakpoints=(0.7,))
    at = {"a": 1.2, "b": 0.3}
    p = lc.propagator(so3, u, duration=2.0)(**at)
    X, *dX = variational(so3, u, at, 2.0)
    np.testing.assert_allclose(p.X, X, rtol=0, atol=1e-10)
    np.testing.assert_allclose(p.dX, dX, rtol=0, atol=1e-9)


def test_newton_on_the_derivative_converges_to_rounding() -> None:
    """Amplitude and phase that bring the qubit to a given state: quadratic convergence needs the exact derivative."""
    su2 = lc.group("su2")
    U = lc.propagator(su2, QUBIT, duration=5.0, rtol=1e-12)
    goal = U(a=0.6, w=1.1, phi=0.5).X
    x = np.array([0.55, 0.4])
    for _ in range(6):
        p = U(a=x[0], w=1.1, phi=x[1])
        residual = su2.project(p.X.conj().T @ goal - np.eye(2))
        x = x + np.linalg.lstsq(p.eta[[0, 2]].T, residual, rcond=None)[0]
    np.testing.assert_allclose(x, [0.6, 0.5], rtol=0, atol=1e-12)


def test_batches_are_the_members_one_by_one() -> None:
    su2 = lc.group("su2")
    U = lc.propagator(su2, QUBIT, duration=20.0)
    a, w = np.linspace(0.1, 1, 37), np.linspace(0.9, 1.4, 37)
    for named in ({"a": a, "w": 1.1, "phi": 0.3}, {"a": a, "w": w, "phi": 0.3}):
        many = U.batch(**named)
        assert many.X.shape == (37, 2, 2)
        for k in (0, 5, 36):
            one = U(**{name: float(np.broadcast_to(value, 37)[k]) for name, value in named.items()})
            np.testing.assert_allclose(many.X[k], one.X, rtol=0, atol=1e-10)
    shaped = lc.propagator("so3", lc.ParametricInput(["a*exp(-t^2)", "0", "1"], parameters="a"), duration=2.0)
    np.testing.assert_allclose(shaped.batch(a=[0.2, 0.4]).X[1], shaped(a=0.4).X, rtol=0, atol=1e-13)


def test_powers_of_a_period_say_their_error() -> None:
    su2 = lc.group("su2")
    u = lc.ParametricInput(["-2*a*cos(w*t)", "0", "-1"], parameters=("a", "w"), period="2*pi/w")
    U = lc.propagator(su2, u, duration="period", rtol=1e-13)
    period = 2 * np.pi / 1.1
    long = lc.simulate(su2, lc.PeriodicInput(["-cos(11*t/10)", "0", "-1"]), t=[0, 1000 * period], rtol=1e-12)
    found = U.power(1000, a=0.5, w=1.1)
    assert np.max(np.abs(found.X - long.X[-1])) <= found.error_estimate + 2 * long.error_estimate
    assert found.error_estimate < 1e-10
    np.testing.assert_array_equal(U(a=0.5, w=1.1).power(1000).X, found.X)
    fixed = lc.propagator(su2, lc.PeriodicInput(["-cos(11*t/10)", "0", "-1"]), duration="period", rtol=1e-13)
    np.testing.assert_allclose(fixed().X, U(a=0.5, w=1.1).X, rtol=0, atol=1e-12)
    h = 1e-3  # the period moves with w: dX/dw holds X hat(u(T)) dT/dw
    f = [U(a=0.5, w=1.1 + k * h).X for k in (-2, -1, 1, 2)]
    slope = (f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * h)
    np.testing.assert_allclose(U(a=0.5, w=1.1).dX[1], slope, rtol=0, atol=1e-8)


def test_an_input_with_parameters_is_a_value() -> None:
    again = pickle.loads(pickle.dumps(QUBIT))
    assert again == QUBIT
    np.testing.assert_array_equal(again(0.7, **AT), QUBIT(0.7, **AT))
    np.testing.assert_allclose(QUBIT(0.7, **AT), [-np.cos(1.1 * 0.7 + 0.3), 0, -1], rtol=1e-15)
    assert lc.ParametricInput(["-a*cos(w*t + phi)", "0", "-1"], parameters=("a", "w", "phi")) != QUBIT
    assert "\n" not in repr(lc.propagator("su2", QUBIT, duration=1.0)(**AT))


def test_bad_input_is_named() -> None:
    U = lc.propagator("su2", QUBIT, duration=1.0)
    for named, words in (
        ({"a": 1.0, "w": 1.0}, "missing: phi"),
        ({**AT, "psi": 1.0}, "no parameter 'psi'.*did you mean phi"),
    ):
        with pytest.raises(InputError, match=words):
            U(**named)
    with pytest.raises(NotFiniteError, match="parameter a"):
        U(**{**AT, "a": float("nan")})
    with pytest.raises(ShapeError, match="parameter a"):
        U(**{**AT, "a": [1.0, 2.0]})
    with pytest.raises(ShapeError, match="lengths 2, 3"):
        U.batch(a=[1.0, 2.0], w=[1.0, 2.0, 3.0], phi=0.0)
    with pytest.raises(InputError, match="no period"):
        lc.propagator("su2", QUBIT, duration="period")
    with pytest.raises(InputError, match="powers are of one period"):
        U.power(3, **AT)
    with pytest.raises(ShapeError, match="3 components; the algebra has 6"):
        lc.propagator("se3", QUBIT, duration=1.0)
    with pytest.raises(InputError, match="duration"):
        lc.propagator("su2", QUBIT, duration=-1.0)
    with pytest.raises(InputError, match="cannot name a parameter"):
        lc.ParametricInput(["t"], parameters=("t",))


def test_a_few_of_many_members_only_guess_the_steps() -> None:
    """The largest u of the first members has one direction, so that their first two runs agree; the others need more steps."""
    u = lc.ParametricInput(["a", "b*cos(t)", "b*sin(3*t/2)"], parameters=("a", "b"))
    U = lc.propagator("so3", u, duration=20.0, rtol=1e-10)
    a, b = np.full(300, 0.4), np.full(300, 0.9)
    a[:40], b[:40] = 2.5, 0.0
    many = U.batch(a=a, b=b)
    np.testing.assert_allclose(many.X[:40], many.X[:1].repeat(40, 0), rtol=0, atol=1e-14)
    hat = lc.group("so3").hat

    def rates(t: float, x: np.ndarray) -> np.ndarray:
        return (x.reshape(3, 3) @ hat([0.4, 0.9 * np.cos(t), 0.9 * np.sin(1.5 * t)])).ravel()

    exact = solve_ivp(rates, (0, 20), np.eye(3).ravel(), method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1].reshape(3, 3)
    np.testing.assert_allclose(many.X[299], exact, rtol=0, atol=3e-10)
    assert many.steps >= U.batch(a=a[40:60], b=b[40:60]).steps
