"""lie-codegen bench propagate: tools that are absent are named, what errs is no result, missed ratios are said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lie_codegen.benchmarks import propagate
from lie_codegen.benchmarks.propagate import PropagateRow, bench_propagate, missed, table
from lie_codegen.benchmarks.propagate_cases import chain_case
from lie_codegen.benchmarks.propagate_peers import ours, scipy


@pytest.mark.parametrize("qubits", [1, 2, 3])
def test_ours_and_scipy_meet_the_stored_row(qubits: int) -> None:
    case = chain_case(qubits)
    assert np.linalg.norm(case.row) == pytest.approx(1, abs=1e-14)
    np.testing.assert_allclose(ours(case, 1e-12)()[0][0], case.row, rtol=0, atol=2e-12)
    if qubits == 1:
        np.testing.assert_allclose(scipy(case, 1e-10)()[0][0], case.row, rtol=0, atol=3e-9)


def test_a_case_runs_with_the_tools_at_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(propagate, "_ROUNDS", 2)
    rows, _ = bench_propagate(cases=((1, 1, (1e-6,)),), tools=("lie_codegen", "scipy DOP853", "heyoka"), own=False)
    assert [row.who for row in rows] == ["lie_codegen", "scipy DOP853", "heyoka"]
    assert rows[0].error < 1e-6
    assert rows[1].ratio > 5
    assert rows[2].note or rows[2].seconds > 0
    assert "qubit" in table(rows, [])


def test_what_is_missed_is_said_and_no_more() -> None:
    mine = PropagateRow("qubit", "lie_codegen", 1e-12, 3e-5, 1e-13, 0.0)
    slow = PropagateRow("qubit", "scipy DOP853", 1e-12, 1e-3, 1e-12, 0.0, ratio=33.0)
    assert missed([mine, replace(slow, ratio=300.0)]) == []
    assert "wanted 200" in missed([mine, slow])[0]
    assert missed([mine, replace(slow, ratio=float("nan"))]) == []
    assert "the error is" in missed([replace(mine, error=1e-6)])[0]
    assert "ms, wanted 0.05" in missed([replace(mine, seconds=1e-3)])[0]
