"""The tolerance loop in C: the same runs as the one that Python leads, honest refusals, calls that keep nothing of each other."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.errors import ComputationError, NotFiniteError
from lie_codegen.flow.inputs import as_drive, as_signal
from lie_codegen.flow.magnus import run as running
from lie_codegen.runtime.formula_input import fourier_input

SWITCHED = lc.PeriodicInput.from_pieces([("1", ["1", "0", "-1"]), ("1.5", ["0", "t", "1/2"])])


def bump(t: np.ndarray) -> np.ndarray:
    t = np.asarray(t)
    return np.stack([np.exp(-((t - 2.0) ** 2)), np.cos(t), np.abs(t - 3.3)], axis=-1)


@pytest.mark.parametrize("name", ["so3", "su2", "sl2", "se2", "h3"])
@pytest.mark.parametrize("what", ["waves", "pieces", "function", "samples"])
@pytest.mark.parametrize("rtol", [1e-6, 1e-11])
def test_compiled_loop_and_python_loop_take_the_same_steps(
    name: str, what: str, rtol: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    group, rng = lc.group(name), np.random.default_rng(4)
    times = np.array([0.3, 0.9, 2.0, 4.1, 7.7])
    u = {
        "waves": fourier_input([0.0, 1.7, 2.9], *rng.normal(size=(2, 3, 3))),
        "pieces": SWITCHED,
        "function": bump,
        "samples": rng.normal(size=(5, 3)),
    }[what]
    start = group.hat(np.zeros(3)) + np.eye(group.degree)
    drive = as_drive(group, as_signal(group, u, times), np.array(0.8), times, rtol=rtol, resolution=None)
    order = running.order_for("auto", rtol)
    by_c = running.magnus_run(group, drive, times, start, order=order, rtol=rtol)
    monkeypatch.setattr(running, "solver_of", lambda group: None)
    by_python = running.magnus_run(group, drive, times, start, order=order, rtol=rtol)
    assert (by_c.steps, by_c.multiple) == (by_python.steps, by_python.multiple)
    assert by_c.longest == pytest.approx(by_python.longest, rel=1e-14)
    assert by_c.shortest == pytest.approx(by_python.shortest, rel=1e-14)
    assert by_c.error_estimate == pytest.approx(by_python.error_estimate, rel=1e-2, abs=1e-15)
    np.testing.assert_allclose(by_c.X, by_python.X, rtol=0, atol=1e-14 * np.max(np.abs(by_python.X)))


def test_a_tolerance_out_of_reach_is_refused_with_the_steps_that_were_taken() -> None:
    so3 = lc.group("so3")
    u = fourier_input([1.0], [[0.3, 0, 0]], [[0, 0.3, 0]])
    times = np.array([0.0, 50.0])
    drive = as_drive(so3, as_signal(so3, u, times), np.array(1.0), times, rtol=1e-12, resolution=None)
    with pytest.raises(ComputationError, match="do not reach the tolerance"):
        running.magnus_run(so3, drive, times, np.eye(3), order=8, rtol=1e-12, most=150)
    with pytest.raises(ComputationError, match="more than the 10 steps"):
        running.magnus_run(so3, drive, times, np.eye(3), order=8, rtol=1e-12, most=10)


def test_a_solution_beyond_doubles_is_refused() -> None:
    with pytest.raises(ComputationError, match="range of double precision"):
        lc.simulate("gl2", [1.0, 0.0, 0.0, 1.0], t=[0.0, 1e4])


def test_runs_of_many_threads_do_not_share_memory() -> None:
    u = lc.ParametricInput(["-2*a*cos(w*t)", "0", "-1"], parameters=("a", "w"))
    U = lc.propagator("su2", u, duration=50.0, rtol=1e-11)
    amplitudes = np.linspace(0.1, 1.0, 64)
    alone = [U(a=a, w=1.1).X for a in amplitudes]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda a: U(a=a, w=1.1).X, amplitudes))
    np.testing.assert_array_equal(together, alone)


def test_a_parameter_where_a_formula_has_no_value_is_refused() -> None:
    u = lc.ParametricInput(["cos(t)/a", "sqrt(a)", "0"], parameters=("a",))
    U = lc.propagator("so3", u, duration=1.0)
    for a in (0.0, -1.0):
        with pytest.raises(NotFiniteError, match="a formula of the input"):
            U(a=a)
