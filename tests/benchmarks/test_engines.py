"""The tasks of `lie-codegen bench engines`, and that method="auto" takes the engine that decision 23 says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.benchmarks.engines import AUTO, KINDS, SINGLE, SYSTEMS, EngineRow, missed, table, tasks
from lie_codegen.steering.choice import asks_direct, asks_open
from lie_codegen.steering.methods import OPEN_LOOP, solver_of


@pytest.mark.parametrize("kind", list(KINDS))
def test_auto_takes_what_the_decision_says(kind: str) -> None:
    for name, controls, drift in SINGLE if "one control" in kind else SYSTEMS:
        for target, options in tasks(lc.group(name), controls, drift, kind, 1, 0):
            assert not asks_open("auto", options)
            direct = asks_direct("auto", target, controls, options)
            assert AUTO[kind] == ("direct" if direct else "optimal")
            if not direct:
                assert solver_of(OPEN_LOOP, "auto", options) is solver_of(OPEN_LOOP, "optimal", options)


def test_tasks_are_seeded_and_within_reach() -> None:
    """One of them solved: what random controls reached, controls of the same bounds reach."""
    se2, controls = lc.group("se2"), ("omega", "vx")
    first, second = (tasks(se2, controls, (0, 0, 0.5), "energy, bounds, drift", 2, 3) for _ in range(2))
    np.testing.assert_array_equal([X for X, _ in first], [X for X, _ in second])
    target, options = first[0]
    plan = lc.steer(se2, target, controls, 2.0, **options)
    assert plan.error < 1e-8
    assert np.max(np.abs(plan.u(np.linspace(0, 2, 101))[:, :2])) <= 2 + 1e-12


def test_an_engine_that_solves_more_is_said() -> None:
    row = EngineRow("energy, bounds", "direct", 6, 5, 6, 200.0, 300.0)
    other = replace(row, engine="ocp", good=6, median_ms=20.0)
    assert missed([row, other]) == []
    said = missed([replace(row, solved=5), other])
    assert said == ["energy, bounds: more are solved by ocp than by direct, which auto takes"]
    assert said[0] in table([row, other], said)
