"""method="sinusoids": exact on chained systems; the end by DOP853 of the system itself, and the published displacement of one loop."""

from __future__ import annotations

from itertools import pairwise
from math import factorial
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lie_codegen as lc


def end_of_flight(plan: Any) -> np.ndarray:
    group, d = plan.group, plan.group.degree
    X = np.eye(d)
    for a, b in pairwise([0.0, *plan.u.breakpoints, plan.duration]):
        hair = 1e-12 * (b - a)

        def rate(t: float, x: np.ndarray, a: float = a, b: float = b, hair: float = hair) -> np.ndarray:
            return (x.reshape(d, d) @ group.hat(plan.u(min(max(t, a + hair), b - hair)))).ravel()

        X = solve_ivp(rate, (a, b), X.ravel(), method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1].reshape(d, d)
    return X


@pytest.mark.parametrize(
    ("name", "controls", "goal"),
    [
        ("h3", ("x", "y"), (0.5, -0.2, 0.1)),
        ("h3", ("y", "x"), (0, 0, 0.3)),
        ("engel", ("x1", "x2"), (0.3, -0.4, 0.5, 0.2)),
        ("engel", ("x2", "x1"), (0, 0, 0, -0.3)),
    ],
)
def test_chained_systems_end_exactly_at_the_target(
    name: str, controls: tuple[str, str], goal: tuple[float, ...]
) -> None:
    plan = lc.steer(lc.group(name), goal, controls, 2.0, method="sinusoids")
    assert plan.status.name == "SOLVED"
    np.testing.assert_allclose(end_of_flight(plan), plan.target, atol=1e-9)


def test_the_third_bracket_moves_as_published() -> None:
    chain = lc.from_brackets(
        "chain5", ("a", "b", "c", "d", "e"), {("a", "b"): {"c": 1}, ("a", "c"): {"d": 1}, ("a", "d"): {"e": 2}}
    )
    plan = lc.steer(chain, (0, 0, 0, 0, 0.4), ("a", "b"), 4.0, method="sinusoids")
    np.testing.assert_allclose(end_of_flight(plan), plan.target, atol=1e-9)
    a, b, k = plan.details["loops"][2]
    w = 2 * np.pi / (4.0 / 4)
    # [a, d] = 2 e: the chain's last element is 2 e
    assert abs((a / (2 * w)) ** k * b / factorial(k) * 2 * np.pi / w) == pytest.approx(0.2, rel=1e-12)
    assert k == 3
    assert a**2 == pytest.approx(k * b**2)


def test_groups_that_are_no_chain_are_refused() -> None:
    with pytest.raises(lc.errors.SteeringInputError, match="sinusoids"):
        lc.steer(lc.group("so3"), (0.1, 0.2, 0.3), ("w1", "w2"), 1.0, method="sinusoids")
