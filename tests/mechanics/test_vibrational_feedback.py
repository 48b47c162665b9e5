"""Relative equilibria, the rank test, amplitude feedback designed on the average and run in C on the actual system."""

from __future__ import annotations

import numpy as np
import pytest
from mechanical_systems import arm, cart, dumbbell, pendulum, spherical
from scipy.integrate import solve_ivp
from scipy.special import mathieu_a

from lie_codegen.errors import ComputationError, InputError
from lie_codegen.groups.build import build
from lie_codegen.mechanics.lagrangian import lagrangian_system
from lie_codegen.mechanics.relative_equilibria import linear_controllability, relative_equilibria, relative_equilibrium
from lie_codegen.mechanics.routh import routh_reduce
from lie_codegen.mechanics.vibrational_average import vibrational_average
from lie_codegen.mechanics.vibrational_feedback import design_feedback, switch_phase
from lie_codegen.mechanics.vibrational_fields import vibrational_fields
from lie_codegen.mechanics.vibrational_law import closed_loop_start, feedback_kernels
from lie_codegen.signals.periodic_input import PeriodicInput

SHAKEN = PeriodicInput(["(6 + alpha)*cos(t)"], period="2*pi", parameters=("alpha",))


@pytest.fixture(scope="module")
def tilted():
    """The unstable tilted equilibrium of the shaken spherical pendulum, stabilised by its amplitude."""
    fields = vibrational_fields(routh_reduce(spherical(), momentum={"ph": "1/2"}), SHAKEN)
    return design_feedback(
        fields, amplitudes=["alpha"], eps=0.01, guess=[1.0, 0.0], weights=(np.diag([10, 1]), np.eye(1)), limit=2.0
    )


def test_dumbbell_relative_equilibria_and_proposition_3():
    """theta = 0 stable, theta = pi/2 unstable, both controllable by the attitude torque alone; roots of the math page."""
    e2, p = 0.05**2, 2.00102
    cases = [(0.0, 3 * e2, "stable", (1.00603j, 1.76960j)), (np.pi / 2, -1.5 * e2, "unstable", (1.73268, 0.99846j))]
    for theta, shift, verdict, roots in cases:
        found = relative_equilibrium(dumbbell(), [0.99, theta], {"p": p})
        rho = found.q[0]
        # (31), (32): nu'^2 = 1 / rho^3 + shift / rho^5, with p = 2 (rho^2 + eps^2) nu'
        assert p / (2 * (rho**2 + e2)) == pytest.approx(np.sqrt(1 / rho**3 + shift / rho**5), abs=1e-13)
        assert found.verdict == verdict
        for root in roots:
            assert min(abs(found.eigenvalues - root)) < 2e-3
        assert linear_controllability(found).controllable


def test_rank_test_names_the_direction_no_input_moves():
    system = lagrangian_system(coordinates=("x", "z"), lagrangian="dx^2/2 + dz^2/2 - x^2 - 2*z^2", forces={"x": "u"})
    verdict = linear_controllability(relative_equilibrium(system, [0.1, 0.1]))
    assert not verdict.controllable
    assert "no input moves the direction z" in verdict.reason
    coupled = lagrangian_system(
        coordinates=("x", "z"), lagrangian="dx^2/2 + dz^2/2 - x^2 - 2*z^2 - x*z/3", forces={"x": "u"}
    )
    assert linear_controllability(relative_equilibrium(coupled, [0.1, 0.1])).controllable


def test_rank_test_agrees_with_the_kalman_matrix():
    found = relative_equilibrium(arm(), [0.1, 0.1])
    n = 2
    B = np.vstack([np.zeros((n, 1)), np.linalg.solve(found.M, found.B[:, :1])])
    kalman = np.hstack([np.linalg.matrix_power(found.matrix, k) @ B for k in range(2 * n)])
    assert (np.linalg.matrix_rank(kalman) == 2 * n) == linear_controllability(found).controllable


def test_designed_poles_are_placed(tilted):
    assert tilted.open_loop.real.max() > 3
    assert tilted.closed_loop.real.max() < -3
    placed = design_feedback(tilted.fields, amplitudes=["alpha"], eps=0.01, guess=[1.0, 0.0], poles=[-2.0, -5.0])
    np.testing.assert_allclose(np.sort(placed.closed_loop.real), [-5, -2], atol=1e-9)
    # A and b are derivatives of the averaged rate
    average = vibrational_average(routh_reduce(spherical(), momentum={"ph": "1/2"}), SHAKEN)
    z, step = tilted.equilibrium, 1e-6
    np.testing.assert_allclose(average.rate(z, 0.01, {"alpha": 0.0}), 0, atol=1e-12)
    for i, move in enumerate(np.eye(2) * step):
        change = average.rate(z + move, 0.01, {"alpha": 0.0}) - average.rate(z - move, 0.01, {"alpha": 0.0})
        np.testing.assert_allclose(tilted.A[:, i], change / (2 * step), atol=1e-7)
    change = average.rate(z, 0.01, {"alpha": step}) - average.rate(z, 0.01, {"alpha": -step})
    np.testing.assert_allclose(tilted.b[:, 0], change / (2 * step), atol=1e-7)


def test_text_lagrangian_to_a_stabilised_closed_loop_in_c(tilted):
    """Two degrees of freedom, text in; the loop runs in C and decays at the designed rate; without feedback it leaves."""
    steps = 60
    library = build(feedback_kernels(tilted, "tilt", steps=steps))
    start = closed_loop_start(tilted, np.add(tilted.equilibrium, [0.1, 0.0]))
    run = library.loop.scan(start, n=steps * 100, every=steps)
    end = run[-1]
    assert abs(end[0] - tilted.equilibrium[0]) < 0.1  # the rest at the switching phase is within O(eps u) of z_e
    assert abs(end[1]) < 1e-6
    late = np.abs(run[20:60, 0] - end[0])
    period = 2 * np.pi * 0.01
    decay = -np.polyfit(period * np.arange(40), np.log(late), 1)[0]
    assert decay == pytest.approx(-tilted.closed_loop.real.max(), rel=0.05)
    assert np.abs(run[:, 2]).max() <= 2.0
    # the same start, amplitude left at 6: the tilt is unstable
    average = vibrational_average(routh_reduce(spherical(), momentum={"ph": "1/2"}), SHAKEN)
    free = average.solve_actual(start[:2], [0, 3.0], 0.01, {"alpha": 0.0})
    assert abs(free[-1, 0] - tilted.equilibrium[0]) > 0.4


def test_loop_is_the_law_on_an_independently_integrated_plant(tilted):
    steps = 240
    library = build(feedback_kernels(tilted, "tilt", steps=steps))
    y, alpha = np.add(tilted.equilibrium, [0.05, 0.02]), np.zeros(1)
    run = library.loop.scan(closed_loop_start(tilted, y), n=steps * 6, every=steps)
    eps, period = 0.01, 2 * np.pi
    for row in run[1:]:
        alpha = library.command(y, alpha)

        def plant(t, x, alpha=alpha):
            u = float(library.force(t / eps, alpha)[0])
            amended = np.cos(x[0]) * 0.25 / np.sin(x[0]) ** 3
            return [x[1], 9.81 * np.sin(x[0]) + amended + np.sin(x[0]) * u]

        y = solve_ivp(plant, (0, eps * period), y, "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
        np.testing.assert_allclose(row[:2], y, atol=2e-8)
        np.testing.assert_allclose(row[2:3], alpha, atol=1e-6)


def test_kapitza_threshold_is_within_1e_3_of_the_exact_mathieu_value():
    """At eps = 0.01: averaged sqrt(2 g l) against a_0(q), a = -4 eps^2 g / l, q = 2 eps beta / l."""
    eps = 0.01

    def margin(beta):
        return mathieu_a(0, 2 * eps * beta) + 4 * eps**2 * 9.81

    low, high = 4.0, 5.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if margin(middle) > 0 else (low, middle)
    exact = (low + high) / 2
    averaged = np.sqrt(2 * 9.81)
    assert abs(averaged / exact - 1) < 1e-3
    # and the actual system crosses there: trace of the monodromy matrix is 2
    u = PeriodicInput(["beta*cos(t)"], period="2*pi", parameters=("beta",))
    average = vibrational_average(pendulum(c=0), u)

    def trace(beta):
        t, small = [0, 2 * np.pi * eps], 1e-7
        ends = [average.solve_actual(small * e, t, eps, {"beta": beta}, 1e-13)[-1] / small for e in np.eye(2)]
        return ends[0][0] + ends[1][1] - 2

    assert trace(exact * 1.001) < 0 < trace(exact * 0.999)


def test_refusals_say_why():
    upright = vibrational_fields(pendulum(c=0), SHAKEN)
    two = PeriodicInput(["(1 + alpha)*cos(t)", "sin(t)"], period="2*pi", parameters=("alpha",))
    apart = lagrangian_system(
        coordinates=("x", "z"),
        lagrangian="dx^2*(2 + sin(x))/2 + dz^2/2 + z^2/2 - x^2/2 + x",
        forces={"x": "u"},
    )
    shaken = PeriodicInput(["(1 + alpha)*cos(t)"], period="2*pi", parameters=("alpha",))
    arms = vibrational_fields(arm(), two)
    cases = [
        (lambda: design_feedback(upright, amplitudes=["alpha"], eps=0.01, guess=[0, 0]), "no authority"),
        (lambda: design_feedback(upright, amplitudes=["beta"], eps=0.01, guess=[0, 0]), "parameters of the input"),
        (
            lambda: design_feedback(
                vibrational_fields(apart, shaken), amplitudes=["alpha"], eps=0.01, guess=[0.8, 0, 0, 0]
            ),
            r"too few directions.*\(z, dz\)",
        ),
        (lambda: switch_phase(arms, dict.fromkeys(arms.parameters, 0)), "common zero"),
        (
            lambda: design_feedback(upright, amplitudes=["alpha"], eps=0.01, guess=[1.0, 0], poles=[-1, 1]),
            "negative real part",
        ),
        (lambda: relative_equilibrium(dumbbell(), [1.0, 0.0]), "p stayed symbolic"),
        (lambda: relative_equilibrium(cart(), [0.1]), "needs 2 values"),
    ]
    for call, words in cases:
        with pytest.raises(InputError, match=words):
            call()
    ramp = lagrangian_system(coordinates=("x",), lagrangian="dx^2/2 - x")
    with pytest.raises(ComputationError, match="no equilibrium found"):
        relative_equilibrium(ramp, [0.0])


def test_every_root_around_a_guess_is_given_nearest_first_with_its_stability() -> None:
    """V = cos q + q^2/10: zeros of sin q - q/5, found by a fine scan; a guess near the top of the hill gets the hill's own root."""
    system = lagrangian_system(coordinates=("q",), lagrangian="dq^2/2 - cos(q) - q^2/10")
    q = np.linspace(-3.6, 4.6, 400001)
    force = np.sin(q) - q / 5
    roots = q[:-1][np.sign(force[:-1]) * np.sign(force[1:]) <= 0]
    for guess in (
        0.5,
        1.45,
    ):  # from 1.45 Newton's method alone runs far away: the slope of the force is almost zero there
        found = relative_equilibria(system, [guess], reach=3.1)
        known = sorted(roots, key=lambda root: abs(root - guess))
        inside = [root for root in known if abs(root - guess) < 3.0]
        ours = [float(each.q[0]) for each in found]
        for root in inside:
            assert min(abs(root - each) for each in ours) < 1e-4
        assert ours == sorted(ours, key=lambda each: abs(each - guess))
        assert abs(relative_equilibrium(system, [guess]).q[0] - known[0]) < 1e-4
        for each in found:
            stable = -np.cos(each.q[0]) + 1 / 5 > 0
            assert each.verdict == ("stable" if stable else "unstable")
