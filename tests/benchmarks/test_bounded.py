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
