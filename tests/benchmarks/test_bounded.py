"""The bounded steering benchmark: both of our rows and GRAPE reach the same random gates, and the table says so."""

from __future__ import annotations

import pytest

from lie_codegen.benchmarks import bounded
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
    quick = bounded.missed([*ours, row("GRAPE in forty lines", 10, 20.0)])
    assert quick == ["a task: GRAPE in forty lines takes 4 times our time, goal 5"]
    assert "missed: a task" in bounded.table(ours, quick)
    assert "reaches 10" in bounded.missed([row("ours", 9, 1.0), ours[1], row("CasADi + ipopt", 10, 99.0)])[0]
