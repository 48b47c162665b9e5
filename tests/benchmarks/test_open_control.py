"""The program that CasADi's solvers get is the problem that lc.ocp solves: the same cost, the same motion, the same cylinders."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

from lie_codegen.benchmarks.open_claims import (
    BOX_FDDP,
    FATROP,
    FATROP_COMPILED,
    ITERATION,
    OURS,
    ROTORS,
    SAMPLE,
    ControlRow,
    disagreement,
    missed,
    table,
)
from lie_codegen.benchmarks.open_control import _rotor_rows
from lie_codegen.benchmarks.open_crocoddyl import HOVER, TARGET, rotors
from lie_codegen.benchmarks.open_quadrotor import HIGH, LOW, program, quadrotor, tasks


def test_our_optimum_is_a_point_of_the_peers_program_with_our_cost() -> None:
    task = tasks(1, 0)[0]
    plan = quadrotor().solve(target=task[:3], cyl=task[3:])
    nlp, lower, upper, limits, equalities = program()
    assert disagreement(plan, task, nlp, limits) == ""
    assert "cost" in disagreement(plan, task, {**nlp, "f": 1.01 * nlp["f"]}, limits)
    assert "misses" in disagreement(plan, task, {**nlp, "g": nlp["g"] + 1e-5}, limits)
    assert len(equalities) == len(limits[0]) == nlp["g"].numel()
    assert len(lower) == len(upper) == nlp["x"].numel()
    assert np.all(plan.u >= LOW)
    assert np.all(plan.u <= HIGH)


def test_what_is_stated_and_does_not_hold_is_said() -> None:
    rows = [
        ControlRow(OURS, 20, 20, 20, 4.0, 5.0, 1.0, 20.0),
        ControlRow(FATROP, 20, 20, 20, 140.0, 150.0, 35.0, 30.0),
        ControlRow(FATROP_COMPILED, note="no C compiler"),
        ControlRow(SAMPLE, 9, 9, 9, 0.1, 0.2),
        ControlRow(ROTORS, 1, 1, 1, 8.0, 9.0, 1.0, 20.0, 3.024),
        ControlRow(BOX_FDDP, 1, 1, 1, 80.0, 90.0, 10.0, 20.0, 3.026),
        ControlRow(ITERATION, 1, 1, 1, 4.0, 4.0, 10.0, 1.0),
    ]
    assert missed(rows) == []
    worse = [
        replace(rows[0], solved=19, median_ms=6.0),
        replace(rows[1], over_ours=29.0),
        rows[2],
        replace(rows[3], median_ms=0.4),
        rows[4],
        replace(rows[5], cost=3.05),
        replace(rows[6], over_ours=4.0),
    ]
    said = missed(worse)
    assert len(said) == 6
    assert all("missed: " + each in table(worse, said) for each in said)


def test_tasks_are_seeded_and_clear_of_their_cylinders() -> None:
    given = tasks(5, 3)
    np.testing.assert_array_equal(given, tasks(5, 3))
    for task in given:
        for x, y, r in task[3:].reshape(-1, 3):
            assert np.hypot(x, y) > r + 0.2
            assert np.hypot(x - task[0], y - task[1]) > r + 0.2


def test_the_body_on_rotors_hovers_for_nothing_and_flies_to_its_target() -> None:
    problem = rotors()
    plan = problem.solve(guess=np.full(4, HOVER))
    assert plan.cost == pytest.approx(3.02417, abs=2e-5)  # crocoddyl, whose steps are in another chart: 3.02635
    assert np.all((plan.u >= 0.5) & (plan.u <= 8))
    np.testing.assert_allclose(plan.X[-1, :3, 3], TARGET, atol=0.01)
    x0, rows = problem.start(None, {}, "")
    machine = problem.machine()
    still = machine.advance(x0, np.full(4, HOVER), rows[0], 0.0, 1.0, 10)
    np.testing.assert_allclose(still, x0, atol=1e-12)


def test_a_peer_that_is_not_installed_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "crocoddyl", None)
    rows = _rotor_rows(lambda line: None)
    assert [row.solver for row in rows] == ["lie_codegen, rotors", "crocoddyl box-FDDP, rotors"]
    assert "crocoddyl" in rows[1].note
    assert "crocoddyl" in table(rows)
