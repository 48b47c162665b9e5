"""Table 2 against differences of the coordinates, Table 3 against quadrature, and the paper's figures."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from lie_codegen.errors import ComputationError, ExpressionError, InputError
from lie_codegen.groups.build import build
from lie_codegen.kernel.numpy_arithmetic import evaluate
from lie_codegen.rigid_body.elliptic_kernels import elliptic_kernels
from lie_codegen.rigid_body.euler_average import euler_average
from lie_codegen.rigid_body.euler_equilibria import (
    limit_cycle_gains,
    limit_cycles,
    momentum_directions,
    slow_equilibria,
)
from lie_codegen.rigid_body.euler_solutions import explicit_inertia_change, solve_actual, solve_averaged
from lie_codegen.rigid_body.euler_variational import moving_parts
from lie_codegen.rigid_body.free_rigid_body import free_rigid_body
from lie_codegen.rigid_body.phase_quadrature import nodes_for
from lie_codegen.rigid_body.principal_body import TAU

SIGNS = [s for s in itertools.product((1, -1), repeat=3) if s[0] * s[1] * s[2] == -1]
RATES = ("0.1", "-0.2", "0.3")
CUBIC = ["0.1*w1^3 - 0.2*w2*w3 + 0.3*dw2*w3", "w1*w2 - 0.4*dw1 + sin(tau)", "0.2*w3^2 + w1*dw1 - 0.3*w2"]
DRAG = [f"-c*sqrt(w1^2 + w2^2 + w3^2)*{w}" for w in ("w1", "w2", "w3")]


def rigid_feedback():
    return euler_average(free_rigid_body((3, 4, 5)), ["-1.35614*w1", "1.26209*w2", "-0.187738*w3"])


def test_published_point_of_table_2():
    flow = euler_average(free_rigid_body((3, 4, 5), rates=RATES), ["0.2", "-0.3", "0.5"])
    exact = (0.4675517990819715, -0.2240909768136224, 0.02375149569950488, -0.07578489572879149)
    np.testing.assert_allclose(flow.variational(1.3, 0.6, 0.123), exact, rtol=1e-14)


@pytest.mark.parametrize("axis", ["max", "min"])
@pytest.mark.parametrize("signs", SIGNS)
def test_table_2_is_the_rate_of_the_coordinates_along_the_full_equations(signs, axis):
    """to_slow differenced along (3) with slowly varying inertia; Table 2 is not used."""
    body = free_rigid_body((4, 5, 3), axis=axis, signs=signs, rates=RATES)
    flow = euler_average(body, CUBIC)
    rng = np.random.default_rng(7)
    spin, k, phi = rng.uniform(0.5, 2, 20), rng.uniform(0.1, 0.95, 20), rng.uniform(-0.5, 0.5, 20)
    eps, tau, step = 0.3, 0.2, 1e-3
    omega = body.from_slow(spin, k, phi, tau)

    def rate(w, slow):
        return flow.rate(w, eps, slow)

    def moved(h):  # one RK4 step of length h
        a = rate(omega, tau)
        b = rate(omega + h / 2 * a, tau + eps * h / 2)
        c = rate(omega + h / 2 * b, tau + eps * h / 2)
        d = rate(omega + h * c, tau + eps * h)
        end = body.to_slow(omega + h / 6 * (a + 2 * b + 2 * c + d), tau + eps * h)
        turn = np.round(end.phi - phi)
        return np.stack([end.Omega, end.k, end.phi - turn])

    difference = (moved(-2 * step) - 8 * moved(-step) + 8 * moved(step) - moved(2 * step)) / (12 * step)
    by_omega, by_k, by_phi, frequency = flow.variational(spin, k, phi, tau)
    np.testing.assert_allclose(difference, [eps * by_omega, eps * by_k, frequency + eps * by_phi], atol=2e-9)


@pytest.mark.parametrize("axis", ["max", "min"])
def test_table_3_is_the_quadrature_with_all_parameters_of_25(axis):
    body = free_rigid_body((3, 4, 5), axis=axis, rates=RATES)
    rng = np.random.default_rng(8)
    draw = [[str(round(x, 6)) for x in row] for row in rng.normal(size=(3, 3))]
    torque, products = (
        [str(round(x, 6)) for x in rng.normal(size=3)],
        [str(round(x, 6)) for x in rng.normal(size=3)],
    )
    affine = euler_average(body, moving_parts(body.model, torques=torque, gains=draw))
    full = euler_average(body, moving_parts(body.model, torques=torque, gains=draw, products=products))
    assert affine.is_closed
    assert not full.is_closed
    spin, k = np.array([0.7, 1.3, 2.0, 1.0]), np.array([1e-3, 0.3, 0.9, 0.99])
    closed = affine.averaged(spin, k, 0.1)
    np.testing.assert_allclose(affine.quadrature(spin, k, 0.1), closed, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(full.averaged(spin, k, 0.1), closed, rtol=1e-11, atol=1e-11)


def test_closed_form_is_regular_where_the_printed_one_cancels():
    """At k = 1e-6 Table 3 as printed has lost every digit of (1 - k^2 - E/K) / k."""
    flow = euler_average(free_rigid_body((3, 4, 5)), ["0.3*w1 + 0.2*w2", "-0.7*w2 + 0.5*w1", "0.11*w3"])
    tiny, zero = flow.averaged(1.0, 1e-6), flow.averaged(1.0, 0.0)
    assert tiny.F_k == pytest.approx(1e-6 * ((0.3 - 0.7) / 2 - 0.11), rel=1e-11)
    np.testing.assert_allclose(tiny, zero, atol=1e-6)


def test_compiled_averages_are_the_quadrature():
    flow = euler_average(free_rigid_body((3, 4, 5)), DRAG, {"c": "0.3"})
    library = build(flow.kernels(largest_k=0.9))
    for spin, k in ((1.0, 0.2), (1.7, 0.9)):
        np.testing.assert_allclose(library.averaged(spin, k), flow.averaged(spin, k), rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(
        library.variational(1.3, 0.6, 0.2), flow.variational(1.3, 0.6, 0.2), rtol=1e-15, atol=1e-16
    )
    # |omega| is a function of the phase: the averaged spin decays, and k (a ratio) does not drift for pure drag
    assert flow.averaged(1.0, 0.5).F_Omega < 0
    assert abs(flow.averaged(1.0, 0.5).F_k) < 1e-15


def test_nodes_by_the_nome_reach_rounding():
    flow = euler_average(free_rigid_body((3, 4, 5), rates=RATES), CUBIC)
    for k in (0.3, 0.9, 0.99, 0.9999):
        reference = np.array(flow.quadrature(1.0, k, nodes=1024))
        got = np.array(flow.quadrature(1.0, k, nodes=nodes_for(k)))
        scale = np.abs(np.array(flow.variational(1.0, k, np.linspace(0, 1, 101))[:3])).max(axis=1)
        assert np.all(np.abs(got - reference) <= 2e-14 * scale)
    assert nodes_for(0.9) <= 64
    assert nodes_for(0.9999) <= 128


def boom():
    body = free_rigid_body(("10 + 0.04*(2.5*tau)^2", "11 + 0.04*(2.5*tau)^2", "20"))
    gamma = float(body.model.small_gamma(1, 3).subs(TAU, 0))
    return body, euler_average(body, moving_parts(body.model)), 2 / np.sqrt(1 + gamma**2 / 4)


def test_figure_1_boom_deployment():
    body, flow, spin = boom()
    actual = solve_actual(flow, body.from_slow(spin, 0.5, 0.0), [0, 40], 0.1)[-1]
    slow = solve_averaged(flow, spin, 0.5, [0, 40], 0.1)
    explicit = explicit_inertia_change(body.model, 40, 0.5, 4.0)
    energy, momentum = body.energy_and_momentum(actual, 4.0)
    mean, _ = body.energy_and_momentum(body.from_slow(slow.Omega[-1], slow.k[-1], 0.0, 4.0), 4.0)
    assert momentum == pytest.approx(40, rel=1e-9)
    got = [body.to_slow(actual, 4.0).k ** 2, slow.k[-1] ** 2, explicit.k**2]
    np.testing.assert_allclose(got, [0.3040518299, 0.3041710001, 0.3048172434], atol=2e-10)
    np.testing.assert_allclose([energy, mean, explicit.T], [48.8379392199, 48.8396170015, 48.8487035839], atol=2e-9)
    # (28) is the paper's form of the same flow: momentum is conserved by the averaged system too
    assert body.energy_and_momentum(body.from_slow(slow.Omega, slow.k, 0.0, 0.1 * slow.t), 0.1 * slow.t)[1] == (
        pytest.approx([40, 40], rel=1e-9)
    )


def test_explicit_solution_does_not_converge_with_eps_but_does_with_k():
    """(32) is a small-k model: halving eps at the same tau leaves its error, halving k shrinks it."""
    body, flow, _ = boom()

    def errors(k0):
        gamma = float(body.model.small_gamma(1, 3).subs(TAU, 0))
        spin = 40 / (20 * np.sqrt(1 + gamma**2 * k0**2))
        slow = solve_averaged(flow, spin, k0, [0, 40], 0.1)
        return abs(explicit_inertia_change(body.model, 40, k0, 4.0).k ** 2 - slow.k[-1] ** 2) / k0**2

    assert errors(0.5) > 2e-3
    assert errors(0.05) < errors(0.5) / 50


def test_figure_2_thruster():
    body = free_rigid_body((3, 4, 5))
    flow = euler_average(body, ["0", "0", "0.8"])
    actual = body.to_slow(solve_actual(flow, body.from_slow(1.0, 0.6, 0.0), [0, 10], 0.1)[-1])
    slow = solve_averaged(flow, 1.0, 0.6, [0, 10], 0.1)
    np.testing.assert_allclose(actual[:2], [1.7567495548, 0.3415398617], atol=2e-10)
    np.testing.assert_allclose([slow.Omega[-1], slow.k[-1]], [1.7552369399, 0.3418341913], atol=2e-10)
    # k Omega is an integral of both
    assert actual.k * actual.Omega == pytest.approx(0.6, rel=1e-9)
    assert slow.k[-1] * slow.Omega[-1] == pytest.approx(0.6, rel=1e-10)


def test_figure_3_limit_cycle():
    flow = rigid_feedback()
    start = [0.5, 0.5, 1.0]
    first = flow.body.to_slow(start)
    assert first.k**2 == pytest.approx(5 / 22, rel=1e-14)
    actual = flow.body.to_slow(solve_actual(flow, start, [0, 200], 0.1)[-1])
    slow = solve_averaged(flow, first.Omega, first.k, [0, 200], 0.1)
    assert actual.Omega == pytest.approx(1.3781238629, abs=2e-10)
    assert slow.Omega[-1] == pytest.approx(0.9821647133, abs=2e-10)


def test_limit_cycle_35_36_and_its_stability():
    (cycle,) = limit_cycles(rigid_feedback())
    assert cycle.k == pytest.approx(0.4999999295, abs=2e-10)  # the paper prints khat = 0.25, its square
    assert cycle.slope == pytest.approx(-0.281789375, abs=2e-9)
    assert cycle.stable
    assert abs(cycle.growth) < 1e-6
    np.testing.assert_allclose(limit_cycle_gains(0.5, -1.35614), (1.26209, -0.187738), rtol=0, atol=1.1e-6)
    library = elliptic_kernels()
    K, E = (float(evaluate(kernel, 0.5)[0]) for kernel in library[2:4])
    ratio = 0.25 * E / (E - 0.75 * K)
    assert ratio == pytest.approx(1.805890021, abs=1e-9)  # (35): beta / alpha
    reversed_flow = euler_average(free_rigid_body((3, 4, 5)), ["1.35614*w1", "-1.26209*w2", "0.187738*w3"])
    assert not limit_cycles(reversed_flow)[0].stable
    assert limit_cycles(euler_average(free_rigid_body((3, 4, 5)), ["-w1", "-w2", "-w3"])) == ()
    ring = momentum_directions(rigid_feedback(), 0.5)
    np.testing.assert_allclose((ring**2).sum(1), 1, atol=1e-14)


def test_isolated_equilibria_of_a_spin_regulator():
    """Feedback that vanishes at a set spin: an equilibrium in Omega too, checked by integrating the full equations."""
    hold = "0.1*(1 - w1^2 - w2^2 - w3^2)"
    flow = euler_average(
        free_rigid_body((3, 4, 5)),
        [
            f"({gain} + {hold})*{w}"
            for gain, w in zip(("-1.35614", "1.26209", "-0.187738"), ("w1", "w2", "w3"), strict=True)
        ],
    )
    (found,) = slow_equilibria(flow, (0.3, 2.0))
    assert np.abs(flow.averaged(found.Omega, found.k)[:2]).max() < 1e-10
    assert found.stable
    end = flow.body.to_slow(solve_actual(flow, flow.body.from_slow(0.9, 0.4, 0.0), [0, 4000], 0.02, rtol=1e-9)[-1])
    assert end.Omega == pytest.approx(found.Omega, abs=0.02)
    assert end.k == pytest.approx(found.k, abs=0.02)


def test_slow_variables_converge_with_slope_1_over_times_of_order_1_over_eps():
    body = free_rigid_body((3, 4, 5))
    flow = euler_average(body, ["-0.3*w1 + 0.2*w3", "0.25*w2 - 0.1", "0.15*w3 - 0.2*w1*w2"])
    epsilons = (0.025, 0.0125, 0.00625, 0.003125)
    errors = []
    for eps in epsilons:
        t = np.linspace(0, 1 / eps, 60)
        actual = body.to_slow(solve_actual(flow, body.from_slow(1.0, 0.5, 0.1), t, eps))
        slow = solve_averaged(flow, 1.0, 0.5, t, eps)
        errors.append(max(np.abs(actual.Omega - slow.Omega).max(), np.abs(actual.k - slow.k).max()))
    slopes = np.diff(np.log(errors)) / np.diff(np.log(epsilons))
    assert np.all((slopes > 0.9) & (slopes < 1.2)), slopes


def test_spin_growth_on_the_limit_cycle_is_of_third_order():
    """dOmega/dt = c3 eps^3 / Omega with c3 = 0.7384: the reversing symmetry removes eps^2, the next term is eps^5."""
    flow = rigid_feedback()
    rates, small = [], []
    for eps in (0.05, 0.025):
        t = np.linspace(0, 90 / eps, 6001)
        slow = flow.body.to_slow(solve_actual(flow, flow.body.from_slow(1.0, 0.5, 0.0), t, eps, rtol=1e-12))
        late = t > 40 / eps  # the transient in k has decayed by exp(-11)
        window = np.hanning(late.sum() + 2)[1:-1]  # the oscillation within a period must not enter the fit
        rates.append(np.polyfit(t[late], slow.Omega[late] ** 2, 1, w=window)[0] / 2 / eps**3)
        small.append(np.average((eps / slow.Omega[late]) ** 2, weights=window))
    slope = (rates[0] - rates[1]) / (small[0] - small[1])
    assert rates[1] - slope * small[1] == pytest.approx(0.7384, rel=5e-3), (rates, small)


def test_refusals_say_why():
    body = free_rigid_body((3, 4, 5))
    flow = euler_average(body, ["0", "0", "-0.8"])
    cases = [
        (lambda: euler_average(body, ["0", "0"]), "three perturbing terms"),
        (lambda: euler_average(body, ["0", "0", "w4"]), "g_3: column 1: no name 'w4'"),
        (lambda: euler_average(body, ["0", "0", "c*w3"], {"c": None}), "'c' has no value"),
        (lambda: euler_average(body, ["0", "0", "w3"], {"w3": 1}), "hides a variable"),
        (lambda: euler_average((3, 4, 5), ["0", "0", "0"]), "free_rigid_body"),
        (lambda: flow.averaged(1.0, 0.9999999), "separatrix"),
        (lambda: flow.averaged(0.0, 0.5), "no torque-free motion"),
        (lambda: flow.variational(1.0, 0.0, 0.1), "steady spin"),
        (lambda: solve_averaged(flow, 1.0, 0.5, [1, 0], 0.1), "increasing"),
    ]
    for call, words in cases:
        with pytest.raises(InputError, match=words):
            call()
    with pytest.raises(ExpressionError, match="column"):
        euler_average(body, ["w1 +", "0", "0"])
    part = solve_averaged(flow, 1.0, 0.6, [0, 1, 300], 0.01)  # what was computed before the separatrix is kept
    assert "separatrix" in part.status
    assert len(part.t) == 2
    assert len(part.k) == 2
    with pytest.raises(ComputationError, match="smaller eps"):
        solve_averaged(flow, 1.0, 0.6, [0, 3], 0.1)
    with pytest.raises(ComputationError, match="not smooth"):
        euler_average(body, ["abs(w1 + 0.1)", "0", "0"]).averaged(1.0, 0.5)


@pytest.mark.parametrize("k", [-0.1, 1.0, 1.5])
def test_gains_of_a_limit_cycle_need_a_modulus(k: float) -> None:
    with pytest.raises(InputError, match="modulus"):
        limit_cycle_gains(k, 1.0)
