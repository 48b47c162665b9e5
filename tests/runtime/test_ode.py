"""Steps with error control in C and in numpy: order, events, times between knots, errors of Python functions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ellipj

import lie_codegen as lc
from lie_codegen.errors import InputError
from lie_codegen.runtime import ode
from lie_codegen.runtime.ode import EVENT, REACHED, STUCK, Motion, fixed_steps, integrate
from lie_codegen.runtime.ode_field import Field


def euler_top(ops, y, t):
    return ([y[1] * y[2], -y[2] * y[0], -ops.constant(1) / 4 * y[0] * y[1]],)


def top():
    """sn, cn, dn of modulus 1/2 as a compiled kernel."""
    ports = (lc.Port("y", (3,)), lc.Port("t", ()))
    return Field(lc.build(lc.Kernel("rate", "ode_top", ports, (lc.Port("y_dot", (3,)),), euler_top)).rate, 3)


@pytest.fixture(params=["C", "numpy"])
def loops(request, monkeypatch):
    if request.param == "numpy":
        monkeypatch.setattr(ode, "ode_library", lambda: None)


@pytest.mark.usefixtures("loops")
def test_elliptic_functions_at_any_time():
    motion = integrate(top(), [0, 1, 1], 0.0, 20.0)
    t = np.linspace(0, 20, 61)
    np.testing.assert_allclose(motion.at(t), np.stack(ellipj(t, 0.25)[:3], axis=1), atol=1e-11)
    assert motion.status == REACHED
    back = integrate(top(), motion.y[-1], 20.0, 0.0)
    np.testing.assert_allclose(back.y[-1], [0, 1, 1], atol=1e-11)


@pytest.mark.usefixtures("loops")
def test_a_single_step_is_of_order_eight():
    errors = []
    for h in (0.4, 0.2):
        knots = Motion(np.array([0.0, 1.0]), np.array([[0.0, 1, 1], [0, 1, 1]]), REACHED, -1, 0, np.ones(3), top())
        errors.append(abs(knots.at(h)[0] - ellipj(h, 0.25)[0]))  # one step of length h from the first knot
    assert 8 < np.log2(errors[0] / errors[1]) < 10


def counted(rate, size):
    """A Python function of C's loops, and how often it was called."""
    calls = []

    def call(t, y):
        calls.append(t)
        return rate(t, y)

    return Field(call, size), calls


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
def test_many_times_in_a_step_lie_on_its_polynomial(rtol):
    """A thousand times cost no more than a few steps, are as exact as the steps, and in any order, either way in time."""
    rate = top()
    field, calls = counted(rate, 3)
    for start, t0, t1 in (([0, 1, 1], 0.0, 20.0), (np.stack(ellipj(20.0, 0.25)[:3]), 20.0, 0.0)):
        motion = integrate(field, start, t0, t1, rtol=rtol, atol=rtol)
        knots = len(motion.t)
        calls.clear()
        t = np.random.default_rng(3).permutation(np.linspace(0, 20, 20_001))
        found = motion.at(t)
        assert len(calls) < 80 * knots
        ends = np.abs(motion.y - np.stack(ellipj(motion.t, 0.25)[:3], axis=1)).max()
        assert np.abs(found - np.stack(ellipj(t, 0.25)[:3], axis=1)).max() < 1.5 * ends + 4 * rtol
        np.testing.assert_array_equal(motion.at(motion.t), motion.y)


def test_a_kink_within_a_step_is_no_polynomial():
    """Where the rate has a kink the polynomial is taken on either side of it, or fresh steps are."""
    field, _ = counted(lambda t, y: np.array([abs(np.sin(3 * t))]), 1)
    motion = integrate(field, [0.0], 0.0, 6.0, rtol=1e-10, atol=1e-10)
    t = np.linspace(0, 6, 3001)
    turns = np.floor(3 * t / np.pi)
    exact = (2 * turns + 1 - np.cos(3 * t - turns * np.pi)) / 3
    assert np.abs(motion.at(t)[:, 0] - exact).max() < 1e-8


def test_entries_without_an_error_of_their_own():
    """atol infinite: such an entry shortens no step, and still is given to rtol of its size."""
    field, _ = counted(lambda t, y: np.array([-y[0], 40 * np.cos(40 * t)]), 2)
    motion = integrate(field, [1.0, 0.0], 0.0, 2.0, rtol=1e-6, atol=[1e-6, np.inf])
    free = integrate(field, [1.0, 0.0], 0.0, 2.0, rtol=1e-6, atol=[1e-6, 1e-6])
    assert len(motion.t) < len(free.t)
    t = np.linspace(0, 2, 501)
    np.testing.assert_allclose(motion.at(t)[:, 0], np.exp(-t), atol=3e-6)


@pytest.mark.usefixtures("loops")
def test_events_end_the_run_where_they_happen():
    events = Field(lambda t, y: np.array([y[0] + 0.5, y[1] - 3]), 3)
    motion = integrate(top(), [0, 1, 1], 0.0, 20.0, events=events, directions=[-1, 0])
    assert (motion.status, motion.event) == (EVENT, 0)
    assert motion.y[-1, 0] == pytest.approx(-0.5, abs=1e-12)
    rising = integrate(top(), [0, 1, 1], 0.0, 20.0, events=events, directions=[1, 0])
    assert rising.t[-1] > motion.t[-1]


@pytest.mark.usefixtures("loops")
def test_python_functions_and_their_errors():
    def f(t, y):
        if t > 1:
            raise KeyError("mine")
        return -y

    assert integrate(Field(f, 1), [1.0], 0.0, 1.0).y[-1, 0] == pytest.approx(np.exp(-1), abs=1e-12)
    with pytest.raises(KeyError, match="mine"):
        integrate(Field(f, 1), [1.0], 0.0, 3.0)


@pytest.mark.usefixtures("loops")
def test_a_pole_is_no_number():
    motion = integrate(Field(lambda t, y: y**2, 1), [1.0], 0.0, 2.0)
    assert motion.status == STUCK
    assert motion.t[-1] == pytest.approx(1, abs=1e-6)
    with pytest.raises(InputError, match="is known from"):
        motion.at(1.5)


@pytest.mark.usefixtures("loops")
def test_equal_steps_are_of_order_four():
    exact = np.stack(ellipj(2.0, 0.25)[:3])
    errors = [np.abs(fixed_steps(top(), [0, 1, 1], 0.0, 2 / n, 2, n // 2)[-1] - exact).max() for n in (20, 40)]
    assert 3.7 < np.log2(errors[0] / errors[1]) < 4.4


def test_many_knots_are_kept():
    motion = integrate(Field(lambda t, y: np.array([y[1], -y[0]]), 2), [0, 1], 0.0, 100.0, longest=0.1)
    assert len(motion.t) > 999
    np.testing.assert_allclose(motion.at(77.7), [np.sin(77.7), np.cos(77.7)], atol=1e-11)


@pytest.mark.usefixtures("loops")
def test_the_steps_do_not_depend_on_the_unit_of_time():
    """The same motion told in microseconds, seconds and years: as many evaluations, but for rounding."""
    counts = []
    for unit in (1e-6, 1.0, 3e7):
        motion = integrate(
            Field(lambda t, y, u=unit: np.array([y[1], -y[0]]) / u, 2), [1, 0.5], 0.0, 20 * unit, rtol=1e-9, atol=1e-12
        )
        np.testing.assert_allclose(motion.y[-1, 0], np.cos(20) + 0.5 * np.sin(20), atol=1e-7)
        counts.append(motion.evaluations)
    assert max(counts) - min(counts) <= 12
    still = integrate(Field(lambda t, y: np.zeros(2), 2), [0, 0.0], 0.0, 1e8)
    assert still.status == REACHED
    assert still.evaluations < 100


@pytest.mark.usefixtures("loops")
def test_from_zero_and_from_rest():
    """y = 0 has no size, and y' = 0 at the start says nothing of what comes."""
    motion = integrate(Field(lambda t, y: np.array([np.exp(-t / 1e6), t / 1e6]), 2), [0, 0], 0.0, 5e6)
    np.testing.assert_allclose(motion.y[-1] / 1e6, [1 - np.exp(-5), 12.5], rtol=1e-11)
