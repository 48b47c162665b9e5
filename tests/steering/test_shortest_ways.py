"""Certificates by the length of ways of two controls: exact for turns by brackets, never above the exact optimum, never against what was flown."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.steering.direct.shortest import least_length

GROUPS = ("so3", "su2", "h3")


@pytest.mark.parametrize("name", GROUPS)
def test_no_random_way_is_shorter_than_the_bound(name: str) -> None:
    group, rng = lc.group(name), np.random.default_rng(0)
    controls = np.eye(3)[:2]
    sharpest = 0.0
    for number in range(300):
        X, length = np.eye(group.degree), 0.0
        turning = rng.uniform(-4, 4)
        for k in range(rng.integers(2, 40)):
            # half of the ways are random, half turn at a constant rate: near to the shortest loops
            u = rng.normal(size=2) if number % 2 else np.array([np.cos(turning * 0.2 * k), np.sin(turning * 0.2 * k)])
            X = X @ expm(0.2 * group.hat([*u, 0]))
            length += 0.2 * float(np.linalg.norm(u))
        bound = least_length(group, controls, X)
        assert bound is not None
        assert bound <= length * (1 + 1e-9) + 1e-9
        sharpest = max(sharpest, bound / length)
    assert sharpest > 0.9


@pytest.mark.parametrize(("name", "turn"), [("so3", 1.0), ("so3", -3.0), ("su2", 2.0), ("su2", 5.0), ("h3", 0.5)])
def test_turns_by_brackets_have_the_length_of_the_exact_optimum(name: str, turn: float) -> None:
    group = lc.group(name)
    target = expm(group.hat([0, 0, turn]))
    plan = lc.steer(group, target, group.labels[:2], 1.0)
    bound = least_length(group, np.eye(3)[:2], target)
    assert bound == pytest.approx(np.sqrt(plan.cost), rel=1e-6)  # at constant speed cost = length^2 / T


def test_bounds_below_the_shortest_way_are_proved_too_small_at_once() -> None:
    for name, turn, bound in (("so3", 1.0, 0.4), ("su2", 2.0, 0.5), ("h3", 0.5, 0.3)):
        group = lc.group(name)
        with pytest.raises(lc.errors.InfeasibleError, match="along these controls") as error:
            lc.steer(group, expm(group.hat([0, 0, turn])), group.labels[:2], 5.0, bounds=bound)
        assert error.value.certificate.kind == "length"
        assert error.value.certificate.need > error.value.certificate.most


def test_other_algebras_and_more_controls_have_no_such_bound() -> None:
    se2, so3 = lc.group("se2"), lc.group("so3")
    assert least_length(se2, np.eye(3)[:2], np.eye(3)) is None
    assert least_length(so3, np.eye(3), np.eye(3)) is None
    assert least_length(so3, np.array([[1.0, 0, 0], [0, 2.0, 0]]), np.eye(3)) is None
