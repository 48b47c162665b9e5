"""A plan in another time: the same path, from rest to rest, with its derivatives."""

from __future__ import annotations

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.control.reference_kernels import reference_kernel
from lie_codegen.errors import InputError


def test_a_plan_is_flown_from_rest_to_rest() -> None:
    target = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    plan = lc.steer("so3", target, ["w1", "w2"], 10, method="optimal")
    made = lc.reference("so3", plan=plan, duration=12.0)
    assert made.smoothing_error == 0
    assert made.error < 1e-7
    at = lc.build(reference_kernel(made)).reference
    so3 = lc.group("so3")
    for t in (0.0, 12.0):
        _, xi, rate = at(t)
        assert np.max(np.abs(xi)) < 1e-9
        assert np.max(np.abs(rate)) < 1e-7
    assert at(12.0).X_d == pytest.approx(plan.X_final, abs=1e-9)
    h = 1e-4
    for t in (2.0, 7.3):
        X, xi, rate = at(t)
        turn = X.T @ (at(t + h).X_d - at(t - h).X_d) / (2 * h)
        assert so3.vee((turn - turn.T) / 2) == pytest.approx(xi, abs=1e-6)
        assert (at(t + h).xi_d - at(t - h).xi_d) / (2 * h) == pytest.approx(rate, abs=1e-5)
        x = t / 12
        place = 10 * x**3 * (10 - 15 * x + 6 * x**2)  # the path is that of the plan
        assert pytest.approx(plan.X(np.array([place]))[0], abs=1e-7) == X


def test_what_cannot_be_retimed_is_refused() -> None:
    plan = lc.steer("so3", np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), ["w1", "w2"], 10, method="optimal")
    with pytest.raises(InputError, match="must be positive"):
        lc.reference("so3", plan=plan, duration=-1.0)
    with pytest.raises(InputError, match="goes with a plan"):
        lc.reference("so3", ["t", "0", "0"], duration=3.0)

    class Drifting:
        X, u, duration = plan.X, plan.u, plan.duration
        details = {"drift": [0.1, 0, 0]}  # noqa: RUF012

    with pytest.raises(InputError, match="has a drift"):
        lc.reference("so3", plan=Drifting(), duration=3.0)
