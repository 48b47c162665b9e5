"""lc.steer with costs, constraints and parameters of one's own."""

from __future__ import annotations

import numpy as np
import pytest
from ocp_systems import SE2, SO3, planar, rotation
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.errors import ExpressionError, SteeringError, SteeringInputError


def test_its_own_cost_written_out_is_the_energy_of_the_optimal_method() -> None:
    target = rotation((0.1, 0.05, 0.4))
    best = lc.steer(SO3, target, controls=("w1", "w2"), duration=2.0)
    plan = lc.steer(SO3, target, ("w1", "w2"), 2.0, cost="norm2(u)", intervals=40)
    assert plan.method == "ocp"
    assert plan.error < 1e-6
    assert plan.cost == pytest.approx(best.cost, rel=2e-3)
    assert plan.cost > best.cost  # piecewise constant controls can do no better
    X = np.eye(3)
    for k in range(40):
        X = X @ expm(SO3.hat(0.05 * plan.u(0.05 * (k + 0.5))))
    np.testing.assert_allclose(X, plan.X_final, atol=1e-12)
    np.testing.assert_allclose(plan.inputs(0.3), plan.u(0.3)[:2])


def test_a_constraint_with_a_parameter_is_kept_and_another_value_builds_nothing(compiles: list[str]) -> None:
    options = {"constraints": "norm2(X*e - f) >= r*r", "cost": "norm2(u)", "intervals": 30}
    at = {"e": np.array([0, 0, 1.0]), "f": np.array([2.0, 0.2, 1.0])}
    free = lc.steer(SE2, planar(0, 4, 0), SE2.labels, 2.0, parameters={**at, "r": 0.01}, **options)
    built = compiles.count("se2_steered.c")
    plan = lc.steer(SE2, planar(0, 4, 0), SE2.labels, 2.0, parameters={**at, "r": 0.8}, **options)
    assert compiles.count("se2_steered.c") == built == 1
    assert free.cost == pytest.approx(8, rel=1e-6)
    assert plan.cost > 8.2
    X = plan.details["plan"].X
    assert np.min(np.hypot(X[:, 0, 2] - 2, X[:, 1, 2] - 0.2)) > 0.8 - 1e-6


def test_goals_that_are_sets() -> None:
    plan = lc.steer(SO3, lc.Pointing((1, 0, 0), (0, 3, 0)), SO3.labels, 1.0, cost="norm2(u)", intervals=10)
    assert plan.cost == pytest.approx((np.pi / 2) ** 2, rel=1e-6)
    np.testing.assert_allclose(plan.X_final[:, 0], [0, 1, 0], atol=1e-7)
    plan = lc.steer(SE2, lc.Position((1, 2)), SE2.labels, 1.0, cost="norm2(u)", intervals=10)
    assert plan.cost == pytest.approx(5, rel=1e-6)
    # nothing to do for one of the two phases, a full turn for the other
    plan = lc.steer(lc.group("su2"), lc.UpToPhase(np.eye(2)), (0, 1), 1.0, cost="norm2(u)", intervals=10)
    assert plan.cost == pytest.approx(0, abs=1e-6)


def test_what_is_wrong_is_said() -> None:
    with pytest.raises(ExpressionError, match="foo"):
        lc.steer(SO3, np.eye(3), SO3.labels, 1.0, cost="norm2(u) + foo")
    with pytest.raises(SteeringError, match="not proved"):
        lc.steer(SO3, rotation((0, 0, 2)), ("w3",), 1.0, cost="norm2(u)", bounds={"w3": 0.5}, intervals=5, starts=1)
    with pytest.raises(SteeringInputError, match="no control"):
        lc.steer(SO3, rotation((0, 0, 2)), ("w3",), 1.0, cost="norm2(u)", bounds={"w1": 0.5})
