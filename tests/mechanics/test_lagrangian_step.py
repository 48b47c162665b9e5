"""The variational step of Lagrangian systems against scipy, its order, what it keeps; the best waveform."""

from __future__ import annotations

import numpy as np
import pytest
from mechanical_systems import dumbbell, pendulum, spherical
from scipy.integrate import solve_ivp

import lie_codegen as lc
from lie_codegen.errors import InputError


def test_second_order_under_force_and_drag():
    step = lc.build([lc.lagrangian_variational_step(pendulum())]).variational_step

    def rate(t, y):
        return [y[1], 9.81 * np.sin(y[0]) - 0.2 * y[1] + np.sin(y[0]) * 3 * np.cos(5 * t)]

    exact = solve_ivp(rate, (0, 1), [0.4, 0.1], rtol=1e-12, atol=1e-12).y[:, -1]
    errors = []
    for n in (100, 200, 400):
        h = 1 / n
        u = 3 * np.cos(5 * (np.arange(n) + 0.5) * h)[:, None]
        errors.append(np.abs(step.scan((0.4, 0.1), n=n, every=n, u=u, h=h)[-1] - exact).max())
    assert errors[-1] < 1e-4
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.1)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2, abs=0.1)


def test_cyclic_momentum_is_kept_and_energy_does_not_drift():
    step = lc.build([lc.lagrangian_variational_step(spherical())]).variational_step
    run = step.scan((1.9, 0.0, 0.2, 0.6), n=20000, every=100, u=(0.0,), h=0.01)
    np.testing.assert_allclose(run[:, 3], 0.6, atol=1e-11)
    swings = []
    for h, n in ((0.01, 4000), (0.005, 8000)):
        run = step.scan((1.9, 0.0, 0.2, 0.6), n=n, u=(0.0,), h=h)
        q, p = run[:, 0], run[:, 2:]
        energies = p[:, 0] ** 2 / 2 + p[:, 1] ** 2 / (2 * np.sin(q) ** 2) + 9.81 * np.cos(q)
        quarter = len(energies) // 4
        swings.append(np.ptp(energies))
        # it swings by O(h^2) and comes back
        assert abs(np.ptp(energies[:quarter]) - np.ptp(energies[-quarter:])) < 0.2 * swings[-1]
    assert swings[0] / swings[1] == pytest.approx(4, abs=0.3)


def test_the_reduced_dumbbell_of_figure_three_with_its_gyroscopic_terms():
    """Against the symbolic equations of motion by scipy; momenta of the Routhian are M v + b(q)."""
    reduced = dumbbell("2.00102").system
    step = lc.build([lc.lagrangian_variational_step(reduced)]).variational_step
    motion = lc.build(lc.lagrangian_kernels(reduced)).rate

    def momenta(q, v):
        values = dict(zip(reduced.q, q, strict=True))
        M, b = (np.array(m.subs(values).tolist(), dtype=float) for m in (reduced.mass, reduced.gyroscopic))
        return M @ v + b[:, 0]

    q, v = np.array([1.00027, 1.6008]), np.array([0.001555, 0.0])
    exact = solve_ivp(lambda t, y: motion(y, (0.0,)), (0, 5), [*q, *v], method="DOP853", rtol=1e-12, atol=1e-12).y[
        :, -1
    ]
    errors = []
    for n in (500, 1000):
        end = step.scan((*q, *momenta(q, v)), n=n, every=n, u=(0.0,), h=5 / n)[-1]
        errors.append(np.abs(end - [*exact[:2], *momenta(exact[:2], exact[2:])]).max())
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(4, abs=0.3)


def test_waveforms_stiffen_more_within_the_same_peak():
    tau = np.linspace(0, 2 * np.pi, 20001)
    sizes = []
    for harmonics in (1, 3, 5, 21):
        u = lc.vibration_waveform(harmonics, peak=2.0)
        assert np.abs(u(tau)).max() <= 2 + 1e-9
        U = np.concatenate([[0], np.cumsum((u(tau)[1:, 0] + u(tau)[:-1, 0]) / 2 * np.diff(tau))])
        U -= np.trapezoid(U, tau) / (2 * np.pi)
        sizes.append(np.trapezoid(U**2, tau) / (2 * np.pi) / 4)
    assert sizes[0] == pytest.approx(0.5, abs=1e-6)
    # cos t - cos(3 t)/6 has the peak sqrt(3)/2: the known best of two odd harmonics
    assert sizes[1] == pytest.approx((1 + 1 / 36 / 9) / 2 * 4 / 3, rel=2e-3)
    assert sizes[0] < sizes[1] < sizes[2] < sizes[3] < np.pi**2 / 12
    assert sizes[3] > 0.78


def test_refusals():
    with pytest.raises(InputError, match="Lagrangian system"):
        lc.lagrangian_variational_step("pendulum")
    with pytest.raises(InputError, match="harmonics"):
        lc.vibration_waveform(0)
    with pytest.raises(InputError, match="peak"):
        lc.vibration_waveform(3, peak=-1)
