"""The circle law: closed form, exact endpoint, and exactly the optimum where its costate is conserved."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.errors import SteeringInputError, UncontrollableError
from lie_codegen.steering.closed_form.circle import circle_law, turns_extremals

Array = NDArray[np.float64]

GROUPS = {"h3": (0, 1), "so3": (0, 1), "su2": (0, 1), "se2": (0, 1), "sl2": (1, 2)}
EXTREMAL = ("h3", "so3", "su2")
#: so(3) in a mixed basis b1 = w1, b2 = w2, b3 = w3 + w1 / 2 + w2 / 3: [b1, b2] is no basis element.
TILTED = {
    ("b1", "b2"): {"b3": 1, "b1": "-1/2", "b2": "-1/3"},
    ("b2", "b3"): {"b1": "5/4", "b3": "-1/2", "b2": "1/6"},
    ("b1", "b3"): {"b2": "-10/9", "b3": "1/3", "b1": "-1/6"},
}


def end_by_exponentials(group: Any, u: Any, duration: float, steps: int = 3000) -> Array:
    """The endpoint by Magnus steps of order four with scipy's expm; shares no code with the package's integrators."""
    h = duration / steps
    s = h * np.arange(steps)
    first, second = (group.hat(u(s + h * (0.5 + sign * np.sqrt(3) / 6))) for sign in (-1, 1))
    X = np.eye(group.degree)
    for a, b in zip(first, second, strict=True):
        X = X @ expm(h / 2 * (a + b) + np.sqrt(3) / 12 * h * h * (a @ b - b @ a))
    return X


def targets(group: Any, count: int, size: float, seed: int) -> list[Array]:
    directions = np.random.default_rng(seed).normal(size=(count, group.dim))
    return [expm(group.hat(size * x / np.linalg.norm(x))) for x in directions]


@pytest.mark.parametrize("area", [-2.0, -0.3, -1e-7, 0.0, 1e-9, 0.05, 0.4, 3.0, 1e5])
@pytest.mark.parametrize("chord", [(1.0, 0.0), (-0.3, 0.8), (1e-4, 2e-4)])
def test_the_arc_has_its_chord_and_area(chord: tuple[float, float], area: float) -> None:
    """Against quadrature of the curve."""
    a, b, theta = circle_law(np.array(chord), area)
    t = np.linspace(0, 1, 20001)
    u = np.stack([a * np.cos(theta * t) - b * np.sin(theta * t), a * np.sin(theta * t) + b * np.cos(theta * t)], -1)
    curve = np.vstack([[0, 0], np.cumsum((u[1:] + u[:-1]) / 2 * np.diff(t)[:, None], axis=0)])
    swept = np.trapezoid(curve[:, 0] * u[:, 1] - curve[:, 1] * u[:, 0], t) / 2
    size = np.hypot(a, b)
    np.testing.assert_allclose(curve[-1], chord, atol=3e-8 * size)
    assert swept == pytest.approx(area, abs=1e-8 * size**2)
    assert abs(theta) <= 2 * np.pi


def test_a_target_without_a_chord_takes_the_full_circle() -> None:
    a, b, theta = circle_law(np.zeros(2), -0.7)
    assert np.hypot(a, b) ** 2 == pytest.approx(4 * np.pi * 0.7, rel=1e-14)
    assert theta == pytest.approx(-2 * np.pi, rel=1e-14)


@pytest.mark.parametrize("name", GROUPS)
def test_the_retuned_circle_ends_at_the_target(name: str) -> None:
    group = lc.group(name)
    for target in targets(group, 4, 1.5, seed=4):
        plan = lc.steer(group, target, GROUPS[name], 3.0, method="circle")
        assert plan.error < 1e-12
        np.testing.assert_allclose(end_by_exponentials(group, plan.u, 3.0), target, atol=2e-11)


@pytest.mark.parametrize("name", EXTREMAL)
@pytest.mark.parametrize("size", [0.5, 1.5, 3.0])
def test_where_the_circle_is_an_extremal_it_is_the_optimum(name: str, size: float) -> None:
    """Energy and costate against shooting on the Lie-Poisson equations, which knows nothing of circles."""
    group = lc.group(name)
    for target in targets(group, 6, size, seed=11):
        mine = lc.steer(group, target, (0, 1), 2.0, method="circle")
        other = lc.steer(group, target, (0, 1), 2.0, method="optimal")
        assert mine.details["extremal"]
        assert mine.cost == pytest.approx(other.cost, rel=1e-10)
        np.testing.assert_allclose(mine.details["costate"], other.details["costate"], atol=1e-6)


def test_published_energies() -> None:
    """Heisenberg (0, 0, 1): 4 pi; SO(3), exp(phi A3): phi (4 pi - phi): conjugate points, the phase is free."""
    h3, so3 = lc.group("h3"), lc.group("so3")
    loop = lc.steer(h3, expm(h3.hat([0, 0, 1.0])), (0, 1), 1.0, method="circle")
    assert loop.cost == pytest.approx(4 * np.pi, rel=1e-13)
    for phi in (0.3, -0.8, 2.0, 3.1):
        plan = lc.steer(so3, expm(so3.hat([0, 0, phi])), (0, 1), 1.0, method="circle")
        assert plan.cost == pytest.approx(abs(phi) * (4 * np.pi - abs(phi)), rel=1e-10)
        assert plan.error < 1e-12


@pytest.mark.parametrize("name", ["se2", "sl2"])
def test_elsewhere_it_costs_more_by_a_power_of_the_size(name: str) -> None:
    """The averaged model is what it is optimal for: the excess falls with the target."""
    group = lc.group(name)
    assert not turns_extremals(group.algebra, GROUPS[name])
    excess = []
    for size in (0.8, 0.2):
        pairs = [
            [lc.steer(group, target, GROUPS[name], 1.0, method=method).cost for method in ("circle", "optimal")]
            for target in targets(group, 3, size, seed=2)
        ]
        excess.append(max(mine / best - 1 for mine, best in pairs))
        assert min(mine / best - 1 for mine, best in pairs) > 0
    assert excess[1] < 0.3 * excess[0] < 0.03


def test_the_averaged_circle_errs_by_the_area_rules_order() -> None:
    group = lc.group("so3")
    errors = [
        lc.steer(
            group, expm(group.hat([0.3 * e, 0.2 * e, 0.5 * e * e])), (0, 1), 1.0, method="circle", exact=False
        ).error
        for e in (0.4, 0.2, 0.1)
    ]
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(slopes, 3, atol=0.3)


def test_a_bracket_that_is_no_basis_element() -> None:
    group = lc.from_brackets("tilted", ("b1", "b2", "b3"), TILTED)
    assert turns_extremals(group.algebra, (0, 1))
    for target in targets(group, 3, 1.0, seed=6):
        plan = lc.steer(group, target, ("b1", "b2"), 1.0, method="circle")
        best = lc.steer(group, target, ("b1", "b2"), 1.0, method="optimal")
        assert plan.error < 1e-12
        assert plan.cost == pytest.approx(best.cost, rel=1e-9)


def test_staying_costs_nothing() -> None:
    plan = lc.steer(lc.group("so3"), np.eye(3), (0, 1), 1.0, method="circle")
    assert plan.cost == 0
    assert plan.error == 0


def test_refusals() -> None:
    for name, controls, g in (("se3", (0, 1, 2, 3), 6), ("engel", (0, 1), 4), ("so3", (0, 1, 2), 3)):
        with pytest.raises(SteeringInputError, match="growth vector"):
            lc.steer(lc.group(name), (0.1,) * g, controls, 1.0, method="circle")
    with pytest.raises(SteeringInputError, match="starts"):
        lc.steer(lc.group("so3"), (0.1, 0.1, 0.1), (0, 1), 1.0, method="circle", starts=0)
    with pytest.raises(UncontrollableError):
        lc.steer(lc.group("se3"), (0.1,) * 6, (0, 1), 1.0, method="circle")
