"""Limit cycles and equilibria of averaged flows: exact derivatives of the loops, a cycle known in closed form, the true system."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lie_codegen as lc
from lie_codegen.averaging.orbit_kernels import kernel_orbit_kernels
from lie_codegen.averaging.vector_field import along
from lie_codegen.errors import InputError
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.kernel.numpy_arithmetic import evaluate

F = ["a*cos(2*pi*p)^2 - 0.3*b*sin(2*pi*p)", "0.5*a*b*sin(2*pi*p) + 0.2*cos(2*pi*p) - 0.1*a"]
RATES = [
    "b*cos(t) + a^2*sin(t) - 0.3*a*(1 + cos(2*t)) + eps*a*b*cos(t)",
    "sin(a)*sin(t) + cos(t)/5 - b/5 + a*b*cos(t)/2",
]


def phase_system():
    return lc.phase_average(
        F, G="0.4*a*cos(2*pi*p) + b*sin(2*pi*p)^2", rate="1 + a^2/2 + a*b^3/5", variables=("a", "b"), phase="p"
    )


def differences(function, x, h=1e-5):
    """Central differences of order 4, column by column."""
    columns = [
        (8 * (function(x + h * e) - function(x - h * e)) - function(x + 2 * h * e) + function(x - 2 * h * e)) / (12 * h)
        for e in np.eye(len(x))
    ]
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize(
    ("average", "numbers"),
    [
        (phase_system, {"eps": 0.3, "order": 2}),
        (phase_system, {"eps": 0.3, "order": 1}),
        (lambda: lc.time_average(RATES, variables=("a", "b"), order=3), {"eps": 0.6}),
    ],
)
def test_derivatives_of_slow_fields(average, numbers):
    kernels, x = kernel_orbit_kernels(average().slow_field(), numbers), np.array([0.7, -0.4])
    library = lc.build(kernels)
    exact = library["jacobian"](x, 0.0)
    np.testing.assert_allclose(exact, differences(lambda y: np.array(library["rate"](y, 0.0)), x), atol=3e-11)
    np.testing.assert_allclose(evaluate(kernels[1], x, 0.0)[0], exact, atol=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2, 4])
def test_derivatives_of_the_changes_of_variables(order):
    """W, V and u_q along the slow variables and along the phase or the time, by their twins."""
    ops = FloatArithmetic()
    kernels = (
        phase_system().kernels() if order == 2 else lc.time_average(RATES, variables=("a", "b"), order=order).kernels()
    )
    near = next((k for k in kernels if k.name == ("near_identity" if order > 1 else "terms")), None)

    def flat(ops, values):
        outputs = near.evaluate(ops, *((list(values[:2]), values[2]) if order > 1 else (list(values),)))
        rows = [row for out in outputs for row in (out if isinstance(out, list) else [out])]
        return [e for row in rows for e in (row if isinstance(row, list) else [row])]

    x = np.array([0.7, -0.4, 0.37] if order > 1 else [0.7, -0.4])
    exact = np.array([along(lambda o, y, _: flat(o, y), ops, x.tolist(), [], e.tolist()) for e in np.eye(len(x))]).T
    found = differences(lambda y: np.array(flat(ops, y.tolist()), dtype=float), x, 1e-4)
    np.testing.assert_allclose(exact, found, atol=1e-9)


def test_a_limit_cycle_known_in_closed_form():
    """The normal form of a Hopf bifurcation below fast terms of zero mean: radius 1, period 2 pi / eps, exponents 0 and -2 eps."""
    slow = ["b + a*(1 - a^2 - b^2) + a*b*cos(p)", "-a + b*(1 - a^2 - b^2) + a*sin(p)"]
    two = lc.phase_average(slow, G="0.3*cos(p)", rate="2 + a", variables=("a", "b"), phase="p", period="2*pi")
    eps = 0.02
    first = lc.floquet(two, guess=(0.5, 0.8), parameters={"eps": eps, "order": 1})
    assert np.linalg.norm(first.start) == pytest.approx(1, abs=1e-12)
    assert first.period == pytest.approx(2 * np.pi / eps, rel=1e-12)
    np.testing.assert_allclose(sorted(first.exponents.real), [-2 * eps, 0], atol=1e-11)
    assert first.stable
    assert first.trivial_error < 1e-10
    second = lc.floquet(two, guess=first.start, parameters={"eps": eps})

    def rate(_, y):
        terms = two.terms(y.reshape(-1, 2))
        return (eps * terms.F1 + eps**2 * terms.F2).ravel()

    h = 1e-4 * np.eye(2)
    starts = second.start + np.array([[0, 0], *h, *-h])
    run = solve_ivp(rate, (0, second.period), starts.ravel(), method="DOP853", rtol=1e-11, atol=1e-13)
    end, *moved = run.y[:, -1].reshape(-1, 2)
    np.testing.assert_allclose(end, second.start, atol=1e-9)
    slopes = (np.array(moved[:2]) - moved[2:]).T / 2e-4
    np.testing.assert_allclose(second.monodromy, slopes, atol=1e-5)
    assert abs(second.period - first.period) > 0.01


def test_slow_equilibria_have_exact_eigenvalues():
    flow = lc.euler_average(lc.free_rigid_body((3, 4, 5)), ["-0.3*w1 + 0.2", "0.25*w2 + 0.3*w1 - 0.2", "0.4 - 0.3*w3"])
    (found,) = lc.slow_equilibria(flow, (0.1, 3))
    x = np.array([found.Omega, found.k])

    def field(y):
        return np.array(flow.averaged(*y)[:2])  # Table 3, which the search does not use

    np.testing.assert_allclose(field(x), 0, atol=1e-14)
    expected = np.linalg.eigvals(differences(field, x))
    np.testing.assert_allclose(sorted(found.eigenvalues, key=abs), sorted(expected, key=abs), atol=1e-10)
    (moved,) = lc.slow_equilibria(flow, (0.1, 3), eps=0.05)
    y = np.array([moved.Omega, moved.k])
    second = flow.second_order(*y)
    np.testing.assert_allclose(field(y) + 0.05 * np.array([second.F2_Omega, second.F2_k]), 0, atol=1e-13)


@pytest.mark.slow
def test_a_limit_cycle_of_a_tumbling_body():
    """Spin and coning that chase each other: the averaged cycle, and the full equations after a period."""
    n = "(w1^2 + w2^2 + w3^2)"
    a, b = f"(0.3*(w1^2/{n} - 0.08) + 0.1*({n} - 1) - 1.5*({n} - 1)^3)", f"0.3*(1 - {n})"
    flow = lc.euler_average(lc.free_rigid_body((3, 4, 5)), [f"({a} + {b})*w1", f"({a} + {b})*w2", f"{a}*w3"])
    (centre,) = lc.slow_equilibria(flow, (0.3, 2.5))
    assert not centre.stable
    assert abs(centre.eigenvalues[0].imag) > 0.1
    eps = 0.01
    orbit = lc.floquet(flow, guess=(centre.Omega * 1.1, centre.k), parameters={"eps": eps, "order": 1})
    assert orbit.stable
    assert orbit.trivial_error < 1e-9
    assert orbit.liouville < 1e-9
    omega = flow.body.from_slow(*orbit.start, 0.1)
    end = flow.body.to_slow(lc.solve_actual(flow, omega, [0, orbit.period], eps)[-1])
    # the osculating variables come back to O(eps), which is far less than the cycle is wide
    assert np.hypot(end.Omega - orbit.start[0], end.k - orbit.start[1]) < 3 * eps
    assert np.ptp(orbit.at(np.linspace(0, orbit.period, 50))[:, 1]) > 0.1


def test_what_a_slow_flow_needs():
    with pytest.raises(InputError, match="'eps'"):
        lc.floquet(phase_system(), guess=(0.7, -0.4))
