"""Chains of straight moves, loops and figures of eight: closed forms, exact endpoints, any target of depth two."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm, logm

import lie_codegen as lc
from lie_codegen.errors import SteeringInputError
from lie_codegen.pictures.steering_loops import combination
from lie_codegen.steering.closed_form.chain import Chain
from lie_codegen.steering.closed_form.segments import FigureEight, Loop, double_bracket

Array = NDArray[np.float64]

#: growth (2, 3), (4, 6), (2, 3, 4), (3, 5, 6), (3, 5, 6)
CASES = {
    "so3": (0, 1),
    "se3 with four": (0, 1, 2, 3),
    "engel": (0, 1),
    "se3 with three": (0, 1, 3),
    "so4": (0, 3, 5),
}


def end_of(group: Any, u: Array, h: float) -> Array:
    """Product of exponentials of controls at the midpoints of steps h."""
    X = np.eye(group.degree)
    for step in expm(h * group.hat(u)):
        X = X @ step
    return X


def full(group: Any, controls: tuple[int, ...], values: Array) -> Array:
    u = np.zeros((len(values), group.dim))
    u[:, list(controls)] = values
    return u


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("name", "controls"), [("engel", (0, 1)), ("se3", (0, 1, 3)), ("so4", (0, 3, 5)), ("su2", (0, 1))]
)
def test_a_figure_of_eight_moves_by_its_moment_times_the_double_bracket(
    name: str, controls: tuple[int, ...], sign: int
) -> None:
    """log X(1) = M [a, [a, b]] + O(M^(4/3)): the relative error falls as the cube root of M, by dense expm products."""
    group = lc.group(name)
    rng = np.random.default_rng(5)
    directions = np.linalg.qr(rng.normal(size=(len(controls), 2)))[0]
    a, b = directions.T
    eight = FigureEight(tuple(a), tuple(b))
    A, B = (group.hat(full(group, controls, v[None])[0]) for v in (a, b))
    bracket = A @ B - B @ A
    expected = A @ bracket - bracket @ A
    s = (np.arange(2000) + 0.5) / 2000
    relative = []
    for moment in (8e-4, 1e-4):
        X = end_of(group, full(group, controls, eight.velocity(np.array([sign * moment]), s)), 1 / 2000)
        relative.append(np.linalg.norm(logm(X) / (sign * moment) - expected) / np.linalg.norm(expected))
    assert relative[1] < 0.12
    assert 1.6 * relative[1] < max(relative[0], 1e-5)  # on the Engel group the formula is exact
    vector = double_bracket(group.algebra, controls, a, b)
    np.testing.assert_allclose(group.hat(vector), expected, atol=1e-12)


def test_the_cheapest_harmonics_of_a_figure_of_eight() -> None:
    """Least 2 pi^2 (alpha^2 + 4 beta^2) at alpha^2 beta (pi / 2) = |M|, on a fine grid."""
    moment = 0.37
    beta = np.linspace(0.05, 2, 200_001)
    alpha_squared = moment / (np.pi / 2 * beta)
    least = np.min(2 * np.pi**2 * (alpha_squared + 4 * beta**2))
    eight = FigureEight((1.0, 0.0), (0.0, 1.0))
    x = np.array([-moment])
    assert eight.energy(x) == pytest.approx(least, rel=1e-9)
    s = np.linspace(0, 1, 2001)
    assert np.trapezoid(np.sum(eight.velocity(x, s) ** 2, axis=1), s) == pytest.approx(eight.energy(x), rel=1e-9)


@pytest.mark.parametrize("size", [0.3, -2.0])
def test_the_slopes_of_segments_are_their_derivatives(size: float) -> None:
    s = np.linspace(0, 1, 7)
    for segment in (Loop(3, (0, 2)), FigureEight((1.0, 0.0, 0.0), (0.0, 0.6, 0.8))):
        x, h = np.array([size]), 1e-6
        difference = (segment.velocity(x + h, s) - segment.velocity(x - h, s)) / (2 * h)
        slopes = segment.slopes(x, s)
        assert slopes is not None
        np.testing.assert_allclose(slopes[:, :, 0], difference, atol=1e-8)


@pytest.mark.parametrize("case", CASES)
def test_the_derivative_of_a_chains_endpoint(case: str) -> None:
    """Also at sizes zero, where controls have no derivative and the endpoint has. Simpson's rule on 32 intervals: to 1e-5."""
    group, controls = lc.group(case.split()[0]), CASES[case]
    x = np.random.default_rng(2).normal(size=group.dim) * 0.5
    chain = Chain.towards(group, controls, x)
    for sizes in (chain.sizes, np.zeros(len(chain.sizes))):
        X, slope = chain._end(sizes, 8)
        h = 1e-5 if np.any(sizes) else 1e-9
        for k, e in enumerate(h * np.eye(len(sizes))):
            difference = (chain._end(sizes + e, 8)[0] - chain._end(sizes - e, 8)[0]) / (2 * h)
            mine = group.hat(slope[:, k])
            np.testing.assert_allclose(np.linalg.solve(X, difference), mine, atol=1e-5 if np.any(sizes) else 5e-3)


@pytest.mark.parametrize("size", [0.3, 1.0, 2.5])
@pytest.mark.parametrize("case", CASES)
def test_any_target_is_reached_exactly(case: str, size: float) -> None:
    group, controls = lc.group(case.split()[0]), CASES[case]
    duration = 5.0
    for x in np.random.default_rng(7).normal(size=(4, group.dim)):
        target = expm(group.hat(size * x / np.linalg.norm(x)))
        plan = lc.steer(group, target, controls, duration, method="loops")
        assert plan.error < 2e-12
        assert plan.cost == pytest.approx(plan.details["chain"].energy / duration, rel=1e-10)


@pytest.mark.parametrize("case", ["engel", "se3 with three"])
def test_the_controls_driven_by_exponentials_end_at_the_target(case: str) -> None:
    group, controls = lc.group(case.split()[0]), CASES[case]
    target = expm(group.hat(np.linspace(0.6, -0.5, group.dim)))
    plan = lc.steer(group, target, controls, 1.0, method="loops")
    edges = np.concatenate([[0.0], plan.u.breakpoints, [1.0]])
    X, ends = np.eye(group.degree), []
    for steps in (400, 800):
        X = np.eye(group.degree)
        for start, stop in pairwise(edges):
            h = (stop - start) / steps
            X = X @ end_of(group, plan.u(start + h * (np.arange(steps) + 0.5)), h)
        ends.append(X)
    np.testing.assert_allclose(ends[1] + (ends[1] - ends[0]) / 3, target, atol=1e-7)


def test_pure_double_brackets() -> None:
    """Engel's deepest direction, and sideways on SE(3) with two turns and a thrust."""
    for name, controls, place in (("engel", (0, 1), 3), ("se3", (0, 1, 3), 4)):
        group = lc.group(name)
        for size in (0.01, 0.5, -2.0):
            plan = lc.steer(group, expm(group.hat(size * np.eye(group.dim)[place])), controls, 1.0, method="loops")
            assert plan.error < 2e-12
    [moment] = plan.details["moments"].values()
    assert moment != 0


def test_without_retuning_the_error_falls_with_the_target() -> None:
    group = lc.group("se3")
    errors = []
    for e in (0.4, 0.2, 0.1):
        x = np.array([0.5 * e, 0.3 * e, 0.4 * e**2, 0.4 * e, 0.5 * e**3, 0.3 * e**2])
        errors.append(lc.steer(group, expm(group.hat(x)), (0, 1, 3), 1.0, method="loops", exact=False).error)
    assert errors[1] < errors[0] / 3
    assert errors[2] < errors[1] / 3


def test_a_chain_has_no_more_segments_than_it_needs() -> None:
    """One loop suffices on H(5); the speed is the same root mean square in every part."""
    group = lc.group("h5")
    plan = lc.steer(group, (0.3, 0.1, -0.2, 0.4, 0.5), (0, 1, 2, 3), 2.0, method="loops")
    assert len(plan.details["areas"]) == 1
    edges = np.concatenate([[0.0], plan.u.breakpoints, [2.0]])
    means = []
    for start, stop in pairwise(edges):
        t = np.linspace(start, stop, 2002)[1:-1]
        means.append(np.mean(np.sum(plan.u(t) ** 2, axis=1)))
    np.testing.assert_allclose(means, means[0], rtol=1e-3)


def test_staying_costs_nothing() -> None:
    plan = lc.steer(lc.group("engel"), np.eye(4), (0, 1), 1.0, method="loops")
    assert plan.cost == 0
    assert plan.error == 0


def test_deeper_brackets_are_refused() -> None:
    filiform = {("x1", f"x{k}"): {f"x{k + 1}": 1} for k in (2, 3, 4)}
    group = lc.from_brackets("filiform", ("x1", "x2", "x3", "x4", "x5"), filiform)
    with pytest.raises(SteeringInputError, match="3 nested"):
        lc.steer(group, (0.1,) * 5, (0, 1), 1.0, method="loops")


def test_directions_are_written_out() -> None:
    assert combination((0.7071067811865475, 0.0, -1.0), ("w1", "w2", "v1")) == "0.707 w1 - v1"
