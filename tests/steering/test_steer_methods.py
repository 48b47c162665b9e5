"""Area-rule controls, chains of loops, feedback in steps, and the front door."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.errors import (
    InputError,
    NotFiniteError,
    NotOnGroupError,
    ShapeError,
    SteeringInputError,
    UncontrollableError,
)
from lie_codegen.steering.closed_form.averaged_end import averaged_end
from lie_codegen.steering.closed_form.four_phase import average
from lie_codegen.steering.closed_form.fourier import Family

CASES = {
    "so3": ((0, 1), (0.4, -0.3, 0.5)),
    "se2": ((0, 1), (0.5, 0.3, 0.4)),
    "h3": ((0, 1), (0.3, 0.2, 1.0)),
    "se3": ((0, 1, 2, 3), (0.3, -0.2, 0.4, 0.5, 0.3, -0.2)),
}


def averaged_by_quadrature(family: Family, c: NDArray[np.float64]) -> NDArray[np.float64]:
    """int U + 1/2 int [U~, U] on matrices, by the trapezoid rule on a fine grid."""
    t = np.linspace(0, 1, 20001)
    u = np.zeros((len(t), family.group.dim))
    u[:, list(family.controls)] = family.evaluate(c, t)
    U = family.group.hat(u)
    step = (U[1:] + U[:-1]) / 2 * (t[1] - t[0])
    running = np.concatenate([np.zeros((1, *U.shape[1:])), np.cumsum(step, axis=0)])
    commutator = running @ U - U @ running
    return family.group.project(np.trapezoid(U, t, axis=0) + np.trapezoid(commutator, t, axis=0) / 2)


@pytest.mark.parametrize("name", CASES)
def test_the_averaged_endpoint_is_the_area_rule(name: str) -> None:
    family = Family(lc.group(name), CASES[name][0], 2)
    c = np.random.default_rng(3).normal(size=family.energy_weights.shape)
    value, slope = family.averaged(c)
    np.testing.assert_allclose(value, averaged_by_quadrature(family, c), atol=1e-6)
    h = 1e-6
    for k in range(len(c)):
        e = h * np.eye(len(c))[k]
        difference = (family.averaged(c + e)[0] - family.averaged(c - e)[0]) / (2 * h)
        np.testing.assert_allclose(slope[:, k], difference, atol=1e-8)


@pytest.mark.parametrize("name", CASES)
def test_area_rule_retuned_hits_the_target(name: str) -> None:
    controls, g = CASES[name]
    group = lc.group(name)
    optimum = lc.steer(group, g, controls, 2.0)
    plan = lc.steer(group, g, controls, 2.0, method="area_rule")
    assert plan.error < 2e-11
    assert optimum.cost * (1 - 1e-9) <= plan.cost < 1.12 * optimum.cost


def test_the_averaged_plan_errs_by_the_order_it_claims() -> None:
    """Without retuning the error falls as the 3/2 power of a pure bracket's size (areas scale as the square of the controls)."""
    group = lc.group("so3")
    errors = []
    for size in (0.04, 0.01):
        target = expm(group.hat([0, 0, size]))
        errors.append(lc.steer(group, target, (0, 1), 1.0, method="area_rule", exact=False).error)
    assert errors[0] / errors[1] >= 4**1.5 * 0.9


@pytest.mark.parametrize(("name", "controls"), [("so3", (0, 1)), ("se3", (0, 1, 3)), ("su2", (0, 1))])
def test_the_averaged_endpoint_of_any_order(name: str, controls: tuple[int, ...]) -> None:
    """Order 2 is the area rule; halving the controls divides what is left by 2^(p + 1)."""
    family = Family(lc.group(name), controls, 2)
    c = 0.1 * np.random.default_rng(3).normal(size=family.energy_weights.shape)
    for mine, areas in zip(averaged_end(family, c, 2), family.averaged(c), strict=True):
        np.testing.assert_allclose(mine, areas, atol=1e-14)
    for order in (2, 3, 4):
        left = []
        for each in (c, c / 2):
            X = family.exact(each, 8)[0]
            gap = np.linalg.solve(expm(family.group.hat(averaged_end(family, each, order)[0])), X) - np.eye(len(X))
            left.append(np.linalg.norm(gap))
        assert left[0] / left[1] > 0.8 * 2 ** (order + 1)
    for order in (3, 4):
        slope = averaged_end(family, 5 * c, order)[1]
        for k, e in enumerate(1e-6 * np.eye(len(c))):
            ends = [averaged_end(family, 5 * c + sign * e, order)[0] for sign in (1, -1)]
            np.testing.assert_allclose(slope[:, k], (ends[0] - ends[1]) / 2e-6, atol=1e-8)


def test_without_retuning_a_higher_order_ends_nearer() -> None:
    group = lc.group("so3")
    target = expm(group.hat([0.1, -0.1, 0.2]))
    errors = [
        lc.steer(group, target, (0, 1), 1.0, method="area_rule", order=p, exact=False, starts=2).error
        for p in (2, 3, 4)
    ]
    assert errors[1] < 0.4 * errors[0]
    assert errors[2] < 0.4 * errors[1]


def test_on_heisenberg_the_circle_is_optimal() -> None:
    group = lc.group("h3")
    plan = lc.steer(group, expm(group.hat([0, 0, 1.0])), (0, 1), 1.0, method="area_rule", harmonics=1)
    assert plan.cost == pytest.approx(4 * np.pi, rel=1e-9)


def test_bounds_on_fourier_controls() -> None:
    free = lc.steer(lc.group("so3"), CASES["so3"][1], (0, 1), 1.0, method="area_rule")
    peak = float(np.max(np.abs(free.u(np.linspace(0, 1, 65)))))
    plan = lc.steer(lc.group("so3"), CASES["so3"][1], (0, 1), 1.0, method="area_rule", bounds=0.97 * peak)
    assert np.max(np.abs(plan.u(np.linspace(0, 1, 65)))) <= 0.97 * peak + 1e-6
    assert plan.error < 1e-9
    assert plan.cost > free.cost


def test_area_rule_needs_retuning_for_brackets_of_brackets() -> None:
    group = lc.group("se3")
    g = (0.1, -0.1, 0.1, 0.1, 0.1, -0.1)
    with pytest.raises(SteeringInputError, match="growth"):
        lc.steer(group, g, (0, 1, 3), 1.0, method="area_rule", exact=False)
    plan = lc.steer(group, g, (0, 1, 3), 1.0, method="area_rule", harmonics=3)
    assert plan.error < 1e-10


@pytest.mark.parametrize(("name", "controls"), [("engel", (0, 1)), ("se3", (0, 1, 3))])
def test_area_moments_reach_brackets_of_brackets(name: str, controls: tuple[int, ...]) -> None:
    """Order 3 from the closed form: near by averaging, exact and near the optimum when retuned."""
    group = lc.group(name)
    for x in np.random.default_rng(5).normal(size=(3, group.dim)):
        target = expm(group.hat(x / np.linalg.norm(x)))
        averaged = lc.steer(group, target, controls, 1.0, method="area_rule", harmonics=3, order=3, exact=False)
        assert averaged.details["averaged_miss"] < 1e-8
        plan = lc.steer(group, target, controls, 1.0, method="area_rule", harmonics=3, order=3)
        best = lc.steer(group, target, controls, 1.0)
        assert plan.error < 2e-11
        assert best.cost * (1 - 1e-9) < plan.cost < 1.1 * best.cost


@pytest.mark.parametrize(("form", "order"), [("product", 2), ("single", 3)])
@pytest.mark.parametrize("name", ["so3", "se2", "su2"])
def test_the_two_forms_of_the_four_phase_design(name: str, form: str, order: int) -> None:
    """(60) and (66), target sizes (e, e, e^2): on the way both err by e^2; at the end (66), exact in phase 1, by e^3."""
    group = lc.group(name)
    ends, ways = [], []
    t = np.linspace(0, 1, 101)
    for e in (0.2, 0.1, 0.05):
        target = expm(group.hat([0.5 * e, 0.4 * e, 0.6 * e * e]))
        plan = lc.steer(group, target, (0, 1), 1.0, method="four_phase", form=form, q=3)
        ends.append(plan.error)
        z = average(plan, t)
        factors = [z] if form == "single" else [z * np.eye(3)[k] for k in range(3)]
        predicted = np.eye(group.degree)
        for factor in factors:
            predicted = predicted @ expm(group.hat(factor))
        ways.append(np.max(np.abs(lc.simulate(group, plan.u, t=t).X - predicted)))
    np.testing.assert_allclose(np.log2(np.array(ends[:-1]) / ends[1:]), order, atol=0.1)
    np.testing.assert_allclose(np.log2(np.array(ways[:-1]) / ways[1:]), 2, atol=0.15)


def test_forms_of_the_four_phase_design_are_named() -> None:
    with pytest.raises(SteeringInputError, match="product or single"):
        lc.steer(lc.group("so3"), (0.1, 0.1, 0.1), (0, 1), 1.0, method="four_phase", form="double")


@pytest.mark.parametrize("name", CASES)
def test_loops_one_after_the_other(name: str) -> None:
    controls, g = CASES[name]
    plan = lc.steer(lc.group(name), g, controls, 3.0, method="loops")
    assert plan.error < 1e-10


@pytest.mark.parametrize("name", CASES)
def test_feedback_in_steps_converges(name: str) -> None:
    controls, g = CASES[name]
    plan = lc.steer(lc.group(name), g, controls, 8.0, method="feedback", steps=8, gain=1.01)
    assert plan.error < 1e-3
    errors = np.array(plan.details["errors"])
    assert errors[-1] < 1e-2 * errors[0]


def test_feedback_under_noise_ends_within_a_few_standard_deviations() -> None:
    told = {"method": "feedback", "steps": 10, "noise": 1e-4, "disturbance": np.array([1e-4, 0, 0]), "seed": 3}
    plan, again = (lc.steer("so3", CASES["so3"][1], (0, 1), 10.0, **told) for _ in range(2))
    assert 1e-6 < plan.error < 2e-3
    assert again.error == plan.error


def test_first_order_steering_with_every_direction_actuated() -> None:
    plan = lc.steer(lc.group("so3"), (0.3, 0.2, 0.1), (0, 1, 2), 2.0, method="feedback", steps=2)
    assert plan.error < 1e-12


def test_feedback_by_exact_plans() -> None:
    plan = lc.steer(
        lc.group("se2"), CASES["se2"][1], (0, 1), 4.0, method="feedback", steps=4, planner="optimal", gain=1.02
    )
    assert plan.error < 1e-4


def test_refusals_of_the_front_door() -> None:
    so3 = lc.group("so3")
    with pytest.raises(UncontrollableError, match=r"\(1\).*out of reach"):
        lc.steer(so3, (0.1, 0, 0), ("w1",), 1.0)
    with pytest.raises(SteeringInputError, match="no method"):
        lc.steer(so3, (0.1, 0, 0), ("w1", "w2"), 1.0, method="magic")
    for duration in (0.0, -1.0, np.nan, "1"):
        with pytest.raises(SteeringInputError, match="duration"):
            lc.steer(so3, (0.1, 0, 0), ("w1", "w2"), duration)  # type: ignore[arg-type]
    with pytest.raises(NotOnGroupError):
        lc.steer(so3, np.diag([1.0, 1.0, -1.0]), ("w1", "w2"), 1.0)
    with pytest.raises(NotFiniteError):
        lc.steer(so3, (np.nan, 0, 0), ("w1", "w2"), 1.0)
    with pytest.raises(ShapeError):
        lc.steer(so3, (0.1, 0), ("w1", "w2"), 1.0)
    with pytest.raises(InputError, match="weights"):
        lc.steer(so3, (0.1, 0, 0), ("w1", "w2"), 1.0, weights=(1.0, -1.0))
    with pytest.raises(InputError, match="starts"):
        lc.steer(so3, (0.1, 0, 0), ("w1", "w2"), 1.0, starts=0)
