"""Closed forms that are exact, or exact on H(3): swing and circle, four phases with a free amplitude; own product integrals as oracle."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.stats import special_ortho_group, unitary_group

import lie_codegen as lc


def swung_and_circled(group: Any, controls: tuple[str, str], plan: Any) -> np.ndarray:
    """The end of the two phases by exponentials: the circle's in the frame that turns with it."""
    i, j = (group.labels.index(label) for label in controls)
    k = 3 - i - j
    sign = group.algebra.structure_constants[i, j, k]
    d = plan.details
    swing, first, second = np.zeros((3, 3))
    swing[[i, j]] = d["swing"]
    first[i], first[k] = d["radius"], sign * d["turn"]
    second[k] = -sign * d["turn"]
    return expm(group.hat(swing)) @ expm(group.hat(first)) @ expm(group.hat(second))


@pytest.mark.parametrize("controls", [("w1", "w2"), ("w2", "w1"), ("w2", "w3"), ("w1", "w3")])
def test_every_attitude_is_reached_by_a_swing_and_a_circle(controls: tuple[str, str]) -> None:
    so3, rng = lc.group("so3"), np.random.default_rng(1)
    special = [np.eye(3), np.diag([-1.0, -1, 1]), np.diag([1.0, -1, -1]), expm(so3.hat([0, 0, 1.0]))]
    for X in [*special, *special_ortho_group.rvs(3, size=12, random_state=rng)]:
        plan = lc.steer(so3, X, controls, 2.0, method="swing_twist")
        assert plan.status.name == "SOLVED"
        np.testing.assert_allclose(plan.X_final, X, atol=1e-12)
        np.testing.assert_allclose(swung_and_circled(so3, controls, plan), X, atol=5e-14)
        length = np.hypot(*plan.details["swing"]) + plan.details["radius"]
        assert plan.cost == pytest.approx(length**2 / 2, abs=1e-9)
        assert abs(plan.details["twist"]) <= np.pi


@pytest.mark.parametrize("controls", [("sx", "sy"), ("sy", "sx"), ("sz", "sx")])
def test_every_gate_of_a_qubit_is_reached_by_a_swing_and_a_circle(controls: tuple[str, str]) -> None:
    su2, rng = lc.group("su2"), np.random.default_rng(2)
    random = unitary_group.rvs(2, size=8, random_state=rng)
    for X in [-np.eye(2), np.eye(2), *(U / np.sqrt(np.linalg.det(U)) for U in random)]:
        plan = lc.steer(su2, X, controls, 1.0, method="swing_twist")
        np.testing.assert_allclose(plan.X_final, X, atol=1e-12)
        np.testing.assert_allclose(swung_and_circled(su2, controls, plan), X, atol=5e-14)


def test_swing_twist_refuses_other_groups_by_name() -> None:
    with pytest.raises(lc.errors.SteeringInputError, match="swing_twist"):
        lc.steer(lc.group("se2"), (0.1, 0.2, 0.3), ("omega", "vx"), 1.0, method="swing_twist")


@pytest.mark.parametrize("form", ["product", "single"])
@pytest.mark.parametrize("q", [1, 4])
def test_four_phases_with_a_free_amplitude_are_exact_on_heisenbergs_group(form: str, q: int) -> None:
    h3 = lc.group("h3")
    for goal in ((0.4, -0.7, 0.5), (0, 0, 0.3), (0, 0.5, -0.2), (0.6, 0, 0.1), (-0.3, 0.2, 0), (0.5, 0, 0)):
        plan = lc.steer(h3, goal, ("x", "y"), 3.0, method="four_phase", amplitude="free", q=q, form=form)
        assert plan.error < 1e-9
        t = np.linspace(0.01, 2.99, 50)
        speed = np.linalg.norm(plan.u(t), axis=1)
        np.testing.assert_allclose(speed, speed[0], rtol=1e-9)


def test_free_amplitude_errors_on_rotations_fall_as_the_page_says() -> None:
    so3 = lc.group("so3")
    errors = [
        lc.steer(so3, (0, 0, 0.3), ("w1", "w2"), 1.0, method="four_phase", amplitude="free", q=q).error for q in (1, 4)
    ]
    assert errors == pytest.approx([0.0074, 0.0018], abs=1e-4)


def test_nearly_vanishing_coordinates_do_not_make_four_phases_race() -> None:
    plan = lc.steer(lc.group("so3"), (0.1, 1e-4, np.pi / 40), ("w1", "w2"), 24.0, method="four_phase")
    assert np.max(np.abs(plan.u(np.linspace(0, 24, 4001)))) < 0.2
    assert plan.error < 1e-3


@pytest.mark.parametrize("goal", [(0, 0, 0.5), (0.3, 0, -0.5), (0, -0.2, 0.4), (0.3, 0, 0), (0, 0, 0)])
def test_four_phases_reach_targets_whose_own_loops_enclose_nothing(goal: tuple[float, ...]) -> None:
    plan = lc.steer("h3", goal, ("x", "y"), 2.0, method="four_phase")
    assert plan.error < 1e-9
    assert plan.details["winner"] == "four phases with free amplitude"
    with pytest.raises(lc.errors.SteeringInputError, match="non-zero"):
        lc.steer("h3", goal, ("x", "y"), 2.0, method="four_phase", amplitude="tied")
