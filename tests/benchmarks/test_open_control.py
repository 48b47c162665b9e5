"""The program that CasADi's solvers get is the problem that lc.ocp solves: the same cost, the same motion, the same cylinders."""

from __future__ import annotations

import sys

import casadi as ca
import numpy as np
import pytest

from lie_codegen.benchmarks.open_control import _rotor_rows, table
from lie_codegen.benchmarks.open_crocoddyl import HOVER, TARGET, rotors
from lie_codegen.benchmarks.open_quadrotor import HIGH, LOW, program, quadrotor, tasks


def test_our_optimum_is_a_point_of_the_peers_program_with_our_cost() -> None:
    task = tasks(1, 0)[0]
    plan = quadrotor().solve(target=task[:3], cyl=task[3:])
    nlp, lower, upper, limits, equalities = program()
    states = np.hstack([plan.X[:, :3, :3].reshape(-1, 9), plan.X[:, :3, 3], plan.z])
    x = np.concatenate([np.hstack([states[:-1], plan.u]).ravel(), states[-1]])
    f, g = ca.Function("program", [nlp["x"], nlp["p"]], [nlp["f"], nlp["g"]])(x, task)
    assert float(f) == pytest.approx(plan.cost, rel=1e-12)
    g = np.array(g).ravel()
    assert np.all(g >= limits[0] - 1e-9)
    assert np.all(g <= limits[1] + 1e-8)
    assert np.all(x >= lower)
    assert np.all(x <= upper)
    assert len(equalities) == len(g)
    assert np.max(np.abs(g[np.array(equalities)])) < 1e-10
    assert np.all(plan.u >= LOW)
    assert np.all(plan.u <= HIGH)


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
