"""The bounded steering benchmark: both of our rows and GRAPE reach the same random gates, and the table says so."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from lie_codegen.benchmarks import bounded
from lie_codegen.benchmarks.bounded_cases import bounded_cases
from lie_codegen.benchmarks.bounded_crocoddyl import crocoddyl
from lie_codegen.benchmarks.bounded_peers import grape


def test_ours_and_grape_reach_random_gates(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bounded, "PEERS", {"GRAPE in forty lines": grape})
    rows = bounded.bench_bounded(targets=2, only="SU(2)")
    assert [row.solver for row in rows] == [
        "lie_codegen, least energy",
        "lie_codegen, reach only",
        "GRAPE in forty lines",
    ]
    assert all(row.solved == row.targets == 2 for row in rows)
    assert rows[0].cost <= min(row.cost for row in rows) * (1 + 1e-3)
    assert "SU(2), one control and drift" in bounded.table(rows)


def test_a_peer_that_cannot_take_part_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bounded, "PEERS", {"GRAPE in forty lines": grape})
    row = bounded.bench_bounded(targets=1, only="SE(2)")[-1]
    assert row.note == "of gates alone"


def test_what_falls_short_of_the_goal_is_said() -> None:
    def row(solver: str, solved: int, ms: float, note: str = "") -> bounded.BoundedRow:
        return bounded.BoundedRow("a task", solver, solved, 10, 1.0, ms, note=note)

    ours = [row("lie_codegen, least energy", 10, 50.0), row("lie_codegen, reach only", 10, 5.0)]
    slower = [row("GRAPE in forty lines", 10, 26.0), row("qutip-qtrl GRAPE", 9, 1.0), row("CasADi + ipopt", 10, 251.0)]
    assert not bounded.missed([*ours, *slower, row("CasADi + ipopt", 0, 0.0, "not installed: casadi")])
    assert not bounded.missed([ours[0], row("closed form, six words", 10, 0.05)])
    assert bounded.missed([row("lie_codegen, least time", 9, 1.0), row("closed form, six words", 10, 0.05)])
    quick = bounded.missed([*ours, row("GRAPE in forty lines", 10, 20.0)])
    assert quick == ["a task: GRAPE in forty lines takes 4 times our time, goal 5"]
    assert "missed: a task" in bounded.table(ours, quick)
    assert (
        "reaches 10"
        in bounded.missed([row("lie_codegen, least energy", 9, 1.0), ours[1], row("CasADi + ipopt", 10, 99.0)])[0]
    )


def test_a_peer_that_is_outrun_is_asked_for_three_targets(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bounded, "PEERS", {"GRAPE in forty lines": grape})
    monkeypatch.setattr(bounded, "_OUTRUN", 0.0)
    row = bounded.bench_bounded(targets=5, only="SU(2)")[-1]
    assert (row.solved, row.targets) == (3, 3)
    ours = bounded.BoundedRow("a task", "lie_codegen, least energy", 9, 10, 1.0, 1.0)
    peer = bounded.BoundedRow("a task", "CasADi + ipopt", 3, 3, 1.0, 200.0)
    assert "reaches 3 of 3" in bounded.missed([ours, peer])[0]


def test_cars_are_as_short_as_the_closed_form() -> None:
    ours, closed = bounded.bench_bounded(targets=2, only="Dubins")
    assert ours.solved == closed.solved == 2
    assert ours.cost == pytest.approx(closed.cost, rel=1e-6)


def test_box_fddp_reaches_a_gate_within_its_bounds() -> None:
    pytest.importorskip("crocoddyl")
    case = bounded_cases(1, 0)[3]
    u = crocoddyl(case)(case.targets[0], 0)
    assert u is not None
    assert np.max(np.abs(u)) <= case.bound
    X = np.eye(2)
    for row in u:
        X = X @ expm(case.duration / case.pieces * case.group.hat(case.drift + row @ case.directions))
    np.testing.assert_allclose(X, case.targets[0], atol=1e-4)
