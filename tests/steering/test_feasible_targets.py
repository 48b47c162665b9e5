"""Targets that are feasible by construction, all of them reached: ends of random bounded controls on seven systems, three-qubit gates."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.steering.direct.assemble import constant_pieces
from lie_codegen.steering.direct.compiled import machine
from lie_codegen.steering.direct.method import manoeuvre
from lie_codegen.steering.direct.programme import Settings
from lie_codegen.steering.direct.starts import starts

SYSTEMS = {
    "so3": (("w1",), {"w3": 1.0}),
    "se2": (("omega",), {"vx": 1.0}),
    "su2": (("sx",), {"sz": 1.0}),
    "sl2": (("h",), {"e": 1.0, "f": -1.0}),
    "su3": (("l1", "l3", "l7"), {}),
    "se3": (("w1", "w2", "w3"), {"v1": 1.0}),
    "pauli2": (("XI", "YI", "IX", "IY"), {"ZZ": 1.0}),
}
THREE = ("XII", "YII", "IXI", "IYI", "IIX", "IIY")


def _reached(name: str, count: int, seed: int) -> int:
    controls, drift = SYSTEMS[name]
    group = lc.pauli(2) if name == "pauli2" else lc.group(name)
    rng, rows = np.random.default_rng(seed), [group.labels.index(label) for label in controls]
    base = np.array([drift.get(label, 0.0) for label in group.labels])
    options: dict[str, Any] = {"method": "direct", "drift": drift or None, "bounds": 1, "objective": "none"}
    reached = 0
    for _ in range(count):
        u = np.tile(base, (37, 1))
        u[:, rows] += rng.uniform(-1, 1, (37, len(rows)))
        X = np.eye(group.degree)
        for row in u:
            X = X @ expm(5.0 / 37 * group.hat(row))
        plan = lc.steer(group, X, controls, 5.0, **options)
        reached += plan.error < 1e-8 and np.max(np.abs(plan.details["pieces"].first)) <= 1
    return reached


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_few_feasible_targets_are_reached(name: str) -> None:
    assert _reached(name, 3, 31) == 3


@pytest.mark.slow
@pytest.mark.parametrize("name", SYSTEMS)
def test_every_feasible_target_is_reached(name: str) -> None:
    assert _reached(name, 236, 29) == 236


@pytest.mark.slow
@pytest.mark.parametrize("order", [(0, 1, 2, 3, 4, 5, 7, 6), (0, 1, 2, 3, 4, 6, 5, 7)])
def test_every_start_that_moves_arrives_at_toffolis_and_fredkins_gates(order: tuple[int, ...]) -> None:
    group = lc.pauli(3)
    controls = [np.eye(63)[group.labels.index(label)] for label in THREE]
    drift = np.sum([np.eye(63)[group.labels.index(label)] for label in ("ZZI", "IZZ")], axis=0)
    gate = lc.UpToPhase(np.eye(8)[list(order)])
    task = manoeuvre(group, gate, controls, 12.0, drift, 4, None, None, "left")
    goal = replace(task.goal(np.zeros(32, int)), free_phase=True)
    found = machine(group, 6).reach(constant_pieces(task, 60), goal, starts(task, 60, 32, 0, 0), Settings())
    # all but the first, no controls at all, which a symmetry holds where it is
    assert np.all(found.size[1:] < 1e-10)
