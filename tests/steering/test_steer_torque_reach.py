"""Whether torques reach everything is judged with the inertia, not by the growth of brackets of velocities."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from numpy.typing import NDArray
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.errors import UncontrollableError
from lie_codegen.mechanics.accessibility import second_order_controllability
from lie_codegen.steering.torque_reach import require_torques_reach, torque_growth

TILTED = np.array([[1.5, 0.25, 0.125], [0.25, 2.0, 0.5], [0.125, 0.5, 3.0]])
CASES = [
    ("so3", (0, 1), np.diag([1.0, 2.0, 3.0])),
    ("so3", (0, 1), np.diag([2.0, 2.0, 3.0])),
    ("so3", (0,), np.diag([1.0, 2.0, 3.0])),
    ("so3", (0,), TILTED),
    ("se2", (0, 1), np.diag([1.0, 2.0, 2.0])),
    ("se2", (1,), np.diag([1.0, 2.0, 3.0])),
]


@pytest.mark.parametrize(("name", "controls", "inertia"), CASES)
def test_floating_point_agrees_with_the_exact_symmetric_products(
    name: str, controls: tuple[int, ...], inertia: NDArray[np.float64]
) -> None:
    group = lc.group(name)
    symmetric, reached = torque_growth(group, controls, inertia)
    forces = [[int(k == i) for k in range(group.dim)] for i in controls]
    exact = second_order_controllability(group.algebra, sp.Matrix(inertia).applyfunc(sp.nsimplify), forces)
    assert (len(symmetric) == group.dim) == exact.state_accessible
    assert (len(reached) == group.dim) == exact.configuration_accessible


def test_one_torque_is_refused_or_not_by_the_inertia() -> None:
    so3 = lc.group("so3")
    with pytest.raises(UncontrollableError, match=r"torques on w1: .* 1 of 3 dimensions; .* w2, w3"):
        require_torques_reach(so3, (0,), np.diag([1.0, 2.0, 3.0]))
    require_torques_reach(so3, (0,), TILTED)


def test_the_front_door_asks_with_the_inertia() -> None:
    so3 = lc.group("so3")
    target = expm(so3.hat([0.1, 0.2, 0.1]))
    with pytest.raises(UncontrollableError, match="with this inertia"):
        lc.steer(so3, target, ("w1",), 2.0, dynamics="second_order", inertia=(1.0, 2.0, 3.0))
    with pytest.raises(UncontrollableError, match="growth vector"):
        lc.steer(so3, target, ("w1",), 2.0)
