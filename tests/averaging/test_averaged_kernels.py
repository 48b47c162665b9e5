"""Averaged rates, states and feedback as kernels: compiled C against numpy and against the paper."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import lie_codegen as lc
from lie_codegen.averaging.feedback import feedback_average
from lie_codegen.averaging.kernels import averaged_kernels, averaged_rate, averaged_wei_norman
from lie_codegen.errors import InputError, ShapeError

PARAMETERS = ("A", "B", "phi")
VALUES = {"A": 0.7, "B": 0.4, "phi": 0.3}


def loop(dim: int, mean: bool) -> lc.PeriodicInput:
    texts = ["A*cos(t)", "B*sin(t + phi) + 1/5*cos(2*t)", "1/2*sin(2*t)", "A*cos(3*t)", "0", "B*cos(t)"]
    return lc.PeriodicInput([text + (" + 1/4" if mean else "") for text in texts[:dim]], "2*pi", PARAMETERS)


@pytest.mark.parametrize(
    ("name", "form", "order"),
    [
        ("so3", "floquet", 3),
        ("so3", "product", 2),
        ("se3", "single", 3),
        ("su2", "floquet", 2),
        ("se2", "single", 2),
        ("h3", "floquet", 1),
    ],
)
def test_compiled_averages_equal_numpy_in_batches_over_amplitude_phase_and_eps(
    name: str, form: str, order: int
) -> None:
    group = lc.group(name)
    averaged = lc.average(group, loop(group.dim, form == "floquet"), order, form)
    lib = lc.build(averaged_kernels(averaged))
    rng = np.random.default_rng(4)
    eps, t = rng.uniform(0.05, 0.3, 40), rng.uniform(0, 30, 40)
    columns = {key: rng.uniform(0.1, 1.0, 40) for key in [str(s) for s in averaged.parameters]}
    X = lib.averaged_state.batch(eps=eps, t=t, **columns)
    rates = lib.averaged_rate.batch(eps=eps, **columns)
    for k in range(0, 40, 13):
        numeric = averaged.at(**{key: float(column[k]) for key, column in columns.items()})
        np.testing.assert_allclose(X[k], numeric.state(eps[k], t[k]), atol=2e-14)
        np.testing.assert_allclose(rates[k], numeric.rate(eps[k]), atol=1e-15)
        u = lib.periodic_input(t[k], *(column[k] for column in columns.values()))
        np.testing.assert_allclose(u, numeric.u(t[k]), atol=1e-14)


def test_the_generated_header_states_the_measured_order(tmp_path: Path) -> None:
    group = lc.group("so3")
    u = lc.PeriodicInput(["cos(t)", "sin(t)", "0"], "2*pi")
    check = lc.order_check(group, u, 2, eps=(0.1, 0.05))
    folder = lc.generate(averaged_kernels(lc.average(group, u, 2), check.statement), tmp_path / "out")
    header = " ".join("".join(path.read_text() for path in folder.rglob("*.h")).replace("*", " ").split())
    assert f"{check.constant:.4g} eps" in header
    assert "slope" in header


def test_theorem_1_the_averaged_wei_norman_equations_are_the_averaged_group_system() -> None:
    so3 = lc.group("so3")
    averaged = lc.average(so3, lc.PeriodicInput(["1/2 + cos(t)", "1/3 + sin(t)", "-1/4"], "2*pi"), 1)
    g_dot = lc.build(averaged_wei_norman(averaged)).averaged_wei_norman
    g = solve_ivp(lambda t, g: g_dot(0.2, g), (0, 9.0), np.zeros(3), rtol=1e-12, atol=1e-13).y[:, -1]
    np.testing.assert_allclose(lc.build(so3).product_exp(g), averaged.state(0.2, 9.0), atol=1e-10)


def test_sampled_inputs_give_rates_only() -> None:
    group = lc.group("so3")
    averaged = lc.average(group, lc.PeriodicInput(["exp(cos(t)) - 1", "sin(t)", "0"], "2*pi"), 3)
    with pytest.raises(InputError, match="sampled"):
        averaged_kernels(averaged)
    lib = lc.build(averaged_rate(averaged))
    np.testing.assert_allclose(lib.averaged_rate(0.1), averaged.rate(0.1), atol=1e-16)


FEEDBACK = ["-2*k1*g1*sin(t)^2", "-2*k2*g2*sin(t)^2", "-2*k3*g3*sin(t)^2"]


def test_the_feedback_example_of_section_2() -> None:
    """f and its Jacobian as printed, and the exact solution g(t) = gbar(t - sin(2t)/2)."""
    so3 = lc.group("so3")
    system = feedback_average(so3, FEEDBACK, parameters=("k1", "k2", "k3"))
    g1, g2, g3 = system.g
    k1, k2, k3 = system.parameters
    a, b = k1 * g1 * sp.cos(g3), k2 * g2 * sp.sin(g3)
    printed = sp.Matrix(
        [(b - a) / sp.cos(g2), -k1 * g1 * sp.sin(g3) - k2 * g2 * sp.cos(g3), sp.tan(g2) * (a - b) - k3 * g3]
    )
    assert sp.simplify(system.rate - printed) == sp.zeros(3, 1)
    assert sp.simplify(system.jacobian.subs({g1: 0, g2: 0, g3: 0})) == sp.diag(-k1, -k2, -k3)
    gains = {"k1": 1.0, "k2": 0.7, "k3": 1.3}
    stability = system.linearise([0, 0, 0], **gains)
    assert stability.exponentially_stable
    assert stability.of_both
    np.testing.assert_allclose(sorted(stability.eigenvalues.real), [-1.3, -1.0, -0.7], atol=1e-14)
    lib, rate = lc.build(so3), lc.build(system.kernel).averaged_feedback
    eps, start = 0.3, np.array([0.4, -0.3, 0.5])
    numbers = list(gains.values())

    def true(t: float, g: np.ndarray) -> np.ndarray:
        return eps * lib.wei_norman_rate(g, -2 * np.array(numbers) * g * np.sin(t) ** 2)

    exact = solve_ivp(true, (0, 5.1), start, rtol=1e-12, atol=1e-13).y[:, -1]
    end = 5.1 - np.sin(2 * 5.1) / 2
    mean = solve_ivp(lambda t, g: eps * rate(g, *numbers), (0, end), start, rtol=1e-12, atol=1e-13).y[:, -1]
    np.testing.assert_allclose(mean, exact, atol=1e-10)


def test_equilibria_of_the_average_alone_and_unstable_ones() -> None:
    so3 = lc.group("so3")
    pushed = feedback_average(so3, ["-g1 + 1/10 + cos(t)", "-g2", "-g3 + 1/5*sin(t)*sin(t)"])
    g = pushed.equilibrium([0, 0, 0])
    np.testing.assert_allclose(g, [0.1, 0, 0.1], atol=1e-12)
    found = pushed.linearise(g)
    assert found.exponentially_stable
    assert not found.of_both
    assert "periodic solution within O(eps)" in found.statement
    unstable = feedback_average(so3, ["g1", "-g2", "-g3"]).linearise([0, 0, 0])
    assert not unstable.exponentially_stable
    assert "no conclusion" in unstable.statement


def test_feedback_refusals() -> None:
    so3 = lc.group("so3")
    with pytest.raises(ShapeError, match="3 formulas"):
        feedback_average(so3, ["g1"])
    with pytest.raises(InputError, match="not a sum of sines"):
        feedback_average(so3, ["exp(cos(t))*g1", "0", "0"])
    with pytest.raises(InputError, match="not an equilibrium"):
        feedback_average(so3, ["1", "0", "0"]).linearise([0, 0, 0])
    with pytest.raises(InputError, match=r"k1.*no values"):
        feedback_average(so3, FEEDBACK, parameters=("k1", "k2", "k3")).linearise([0, 0, 0])
