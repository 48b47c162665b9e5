"""Steering: refusals, exactness of the seed, optimality against published minima."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.errors import (
    NotFiniteError,
    NotOnGroupError,
    ShapeError,
    SteeringInputError,
    UncontrollableError,
)


def integral_of_square(plan: lc.steer) -> float:
    """int |u|^2 by the trapezoid rule on a fine grid, away from the plan's own quadrature."""
    t = np.linspace(0, plan.duration, 400_001)
    return float(np.trapezoid(np.sum(plan.u(t) ** 2, axis=1), t))


@pytest.mark.parametrize(
    ("name", "target", "controls", "minimum"),
    [
        ("h3", (0, 0, 1), ("x", "y"), 4 * np.pi),
        ("so3", (0, 0, 0.8), ("w1", "w2"), 0.8 * (4 * np.pi - 0.8)),
        ("so3", (0, 0, 2.0), ("w1", "w2"), 2.0 * (4 * np.pi - 2.0)),
    ],
)
def test_minimum_energy_matches_the_closed_forms(
    name: str, target: tuple[float, ...], controls: tuple[str, str], minimum: float
) -> None:
    plan = lc.steer(lc.group(name), target, controls, 1.0, method="optimal")
    assert plan.cost == pytest.approx(minimum, abs=1e-4)
    assert plan.error < 1e-6
    assert integral_of_square(plan) == pytest.approx(plan.cost, rel=1e-6)


def test_minimum_energy_of_the_unicycle_and_of_a_body_with_four_controls() -> None:
    se2 = lc.group("se2")
    goal = np.array([[0.0, -1.0, 1.0], [1.0, 0.0, 1.0], [0.0, 0.0, 1.0]])
    plan = lc.steer(se2, goal, ("omega", "vx"), 1.0, method="optimal")
    assert plan.cost == pytest.approx(4.891645516826, rel=1e-5)
    se3 = lc.group("se3")
    target = expm(0.3 * se3.basis[0]) @ expm(-0.2 * se3.basis[1]) @ expm(0.4 * se3.basis[2])
    target[:3, 3] = (0.5, 0.3, -0.2)
    plan = lc.steer(se3, target, ("w1", "w2", "w3", "v1"), 1.0, method="optimal")
    assert plan.cost == pytest.approx(2.831793229318, rel=1e-5)
    assert plan.error < 1e-6


def test_energy_scales_with_the_inverse_of_the_duration() -> None:
    so3 = lc.group("so3")
    short, long = (lc.steer(so3, (0.3, 0.2, 0.1), ("w1", "w2"), T, method="optimal") for T in (1.0, 24.0))
    assert long.cost * 24 == pytest.approx(short.cost, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "signs"), [("so3", (1, 1, -1)), ("so3", (-1, 1, 1)), ("su2", (1, -1, -1)), ("h3", (-1, -1, -1))]
)
def test_four_phase_reaches_targets_of_every_sign_to_second_order(name: str, signs: tuple[int, int, int]) -> None:
    group = lc.group(name)
    controls = group.labels[:2]
    errors = []
    for size in (0.2, 0.1):
        g = np.array([1.0, 0.8, 1.1]) * signs * size
        g[2] *= size
        plan = lc.steer(group, g, controls, 10.0, method="four_phase", q=2)
        assert np.sign(np.tan(plan.details["psi"])) == np.sign(g.prod())
        errors.append(plan.error)
    assert 3.5 < errors[0] / errors[1] < 4.5, "the error is of second order in the size of the manoeuvre"


def test_more_periods_are_more_accurate_and_cost_more() -> None:
    so3 = lc.group("so3")
    few, many = (lc.steer(so3, (0.1, 0.05, 0.1), ("w1", "w2"), 24.0, method="four_phase", q=q) for q in (2, 20))
    assert many.error < few.error
    assert many.cost > few.cost


@pytest.mark.parametrize(
    ("target", "controls", "options", "error"),
    [
        (np.diag([1.0, 1.0, -1.0]), ("w1", "w2"), {}, NotOnGroupError),
        (np.eye(3) + 1e-3, ("w1", "w2"), {}, NotOnGroupError),
        (np.zeros((3, 3)), ("w1", "w2"), {}, NotOnGroupError),
        (np.full((3, 3), np.nan), ("w1", "w2"), {}, NotFiniteError),
        (np.eye(4), ("w1", "w2"), {}, ShapeError),
        (1j * np.eye(3), ("w1", "w2"), {}, ShapeError),
        ((0.1, 0.1, 0.1), ("w3",), {}, UncontrollableError),
        ((0.1, 0.1, 0.1), ("w1", "w2"), {"duration": -1.0}, SteeringInputError),
        ((0.1, 0.1, 0.1), ("w1", "w2"), {"duration": np.inf}, SteeringInputError),
        ((0.1, 0.1, 0.1), ("w1", "w2"), {"method": "four_phase", "q": 0}, SteeringInputError),
        ((0.1, 0.1, 0.1), ("w1", "w2"), {"method": "four_phase", "q": 1.5}, SteeringInputError),
        ((0.1, 0.1, 0.1), ("w1", "w2", "w3"), {"method": "four_phase"}, SteeringInputError),
        ((0.1, 0.1, 0.1), ("w1", "w2"), {"method": "optimal", "intervalls": 9}, SteeringInputError),
    ],
)  # fmt: skip
def test_bad_tasks_are_refused_by_name(
    target: object, controls: tuple[str, ...], options: dict[str, object], error: type[Exception]
) -> None:
    arguments: dict[str, object] = {"duration": 1.0, "method": "optimal", **options}
    with pytest.raises(error):
        lc.steer(lc.group("so3"), target, controls, **arguments)


def test_the_refusal_of_uncontrollable_controls_carries_the_growth_vector() -> None:
    with pytest.raises(UncontrollableError, match=r"growth vector \(2\)"):
        lc.steer(lc.group("se3"), np.zeros(6), ("v1", "v2"), 1.0)
