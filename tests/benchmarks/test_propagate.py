"""lie-codegen bench propagate: tools that are absent are named, what errs is no result, missed ratios are said."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from lie_codegen.benchmarks import loop_peers, turns
from lie_codegen.benchmarks.loop_cases import START, loop_case, loop_error, rate_of, states_of
from lie_codegen.benchmarks.propagate import PropagateRow, bench_propagate, missed, table, with_ratios
from lie_codegen.benchmarks.propagate_cases import chain_case
from lie_codegen.benchmarks.propagate_ours import precision_rows
from lie_codegen.benchmarks.propagate_peers import ours, scipy
from lie_codegen.errors import InputError


@pytest.mark.parametrize("qubits", [1, 2, 3])
def test_ours_and_scipy_meet_the_stored_row(qubits: int) -> None:
    case = chain_case(qubits)
    assert np.linalg.norm(case.row) == pytest.approx(1, abs=1e-14)
    np.testing.assert_allclose(ours(case, 1e-12)()[0][0], case.row, rtol=0, atol=2e-12)
    if qubits == 1:
        np.testing.assert_allclose(scipy(case, 1e-10)()[0][0], case.row, rtol=0, atol=3e-9)


def test_the_attitude_loop_of_the_peers_is_ours_and_the_formula() -> None:
    """Rotation vectors by scipy, the torque written out: neither our log nor the peers' quaternions."""
    case = loop_case(3)

    def rate(t: float, y: np.ndarray, member: int) -> np.ndarray:
        X, w = y[:9].reshape(3, 3), y[9:]
        turn = Rotation.from_matrix(X).as_rotvec()
        spin = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        force = -case.k_p[member] * turn - case.k_d[member] * w
        return np.append((X @ spin).ravel(), force / case.inertia[member])

    call, read = loop_peers.ours(case, 1e-10)
    found = read(call())
    assert found.shape == (6, 3, 12)
    assert case.error(found, found) < 1e-9
    for member in range(3):
        end = solve_ivp(rate, (0, 2), found[0, member], args=(member,), rtol=1e-10, atol=1e-10).y[:, -1]
        np.testing.assert_allclose(found[1, member], end, rtol=0, atol=2e-8)
    one = loop_case()
    call, read = loop_peers.scipy(one, 1e-11)
    assert loop_error(read(call())[20, 0]) < 1e-8
    assert one.error(found, found[:2]) == np.inf


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
def test_our_attitude_loop_is_the_stored_one_to_its_tolerance(rtol: float) -> None:
    """At the stored times, and at all 101 of them as DOP853 of scipy has it."""
    case = loop_case()
    call, read = loop_peers.ours(case, rtol)
    found, estimate = read(call()), call().error_estimate
    assert case.error(found, np.zeros_like(found)) <= rtol
    rate = rate_of(math.sqrt, math.atan2)
    start = np.append(START, case.xi0[0])  # short steps, so that scipy's interpolant is as good as they are
    run = solve_ivp(
        lambda t, y: rate(*y, 1, 2, 3, 4, 6), (0, 10), start, "DOP853", case.t, rtol=3e-14, atol=1e-15, max_step=0.02
    )
    off = np.max(np.abs(found[:, 0] - states_of(run.y[:4].T, run.y[4:].T)))
    assert off <= rtol
    assert off <= max(estimate, 1e-13)


def test_a_case_runs_with_the_tools_at_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lie_codegen.benchmarks.propagate.ROUNDS", 2)
    tools = ("lie_codegen", "scipy DOP853", "heyoka")
    rows, _ = bench_propagate(contests=((chain_case(1), tools, (1e-6,)),), own=False)
    assert [row.who for row in rows] == list(tools)
    assert rows[0].error < 1e-6
    assert rows[1].ratio > 5
    assert rows[2].note or rows[2].seconds > 0
    assert "qubit" in table(rows, [])
    with pytest.raises(InputError, match="no system has 'so99' in its name; they are qubit"):
        bench_propagate(only="so99")


def test_both_precisions_err_as_much_as_they_may() -> None:
    double, single = precision_rows(2, 20)
    assert [row[0] for row in (double, single)] == ["20 x SU(4), double", "20 x SU(4), single"]
    assert double[4] < 1e-5
    assert 1e-8 < single[4] < 1e-4  # floats know 6e-8 of a unit
    assert min(double[3], single[3]) > 0


def test_a_tool_that_is_absent_or_raises_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    def broken() -> Any:
        raise ValueError("first\nsecond")

    turns.answer(lambda: turns.imported("no_such_tool"))
    turns.answer(broken)
    said = [json.loads(line)["absent"] for line in capsys.readouterr().out.splitlines()]
    assert said == ["not installed", "ValueError: first"]


def test_a_ratio_is_given_where_nobody_bought_time_with_error() -> None:
    mine = PropagateRow("qubit", "lie_codegen", 1e-9, 1.0, 1e-10, 0.0)
    others = {(3.0, 2e-5): 3.0, (3.0, 1e-11): None, (0.5, 2e-10): 0.5, (0.5, 1e-12): 0.5, (0.5, 1e-8): None}
    rows = with_ratios([mine, *(replace(mine, who="x", seconds=s, error=e) for s, e in others)])
    assert [None if np.isnan(row.ratio) else row.ratio for row in rows[1:]] == list(others.values())
    # errors of rounding are alike
    [_, row] = with_ratios([replace(mine, error=2e-13), replace(mine, who="x", seconds=2.0, error=1e-15)])
    assert row.ratio == 2.0


def test_what_is_missed_is_said_and_no_more() -> None:
    mine = PropagateRow("qubit", "lie_codegen", 1e-12, 3e-5, 1e-13, 0.0)
    slow = PropagateRow("qubit", "scipy DOP853", 1e-12, 1e-3, 1e-12, 0.0, ratio=33.0)
    assert missed([mine, replace(slow, ratio=300.0)]) == []
    assert "wanted 200" in missed([mine, slow])[0]
    assert missed([mine, replace(slow, ratio=float("nan"))]) == []
    assert "the error is" in missed([replace(mine, error=1e-6)])[0]
    assert "ms, wanted 0.05" in missed([replace(mine, seconds=1e-3)])[0]


def test_the_tables_and_the_picture_show_the_results_that_are_kept(repository: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    from lie_codegen.gallery.propagation_speed import PANELS, RECORD, propagation_speed

    place = spec_from_file_location("benchmark_tables", repository / "docs" / "benchmarks.py")
    assert place is not None
    assert place.loader is not None
    tables: Any = module_from_spec(place)
    place.loader.exec_module(tables)
    record = json.loads(RECORD.read_text(encoding="utf-8"))
    page = tables.PAGE.read_text(encoding="utf-8")
    assert page.split(tables.BEGIN)[1].split(tables.END)[0] == tables.tables(record)

    figure = propagation_speed(tmp_path).figure
    drawn = 0
    for axes, system in zip(figure.axes, PANELS.values(), strict=True):
        for line in axes.lines:
            who = {
                "QuTiP": "qutip vern9",
                "SciPy": "scipy DOP853",
                "diffrax": "diffrax Dopri8",
                "dynamiqs": "dynamiqs Dopri8",
            }
            name = who.get(line.get_label(), line.get_label())
            kept = [row for row in record["rows"] if (row["what"], row["who"]) == (system, name)]
            np.testing.assert_allclose(line.get_xdata(), [1e3 * row["seconds"] for row in kept], rtol=1e-12)
            np.testing.assert_allclose(line.get_ydata(), [row["error"] for row in kept], rtol=1e-12)
            drawn += len(kept)
    assert drawn >= 60
    shown = json.loads((repository / "docs" / "gallery" / "propagation_speed.json").read_text(encoding="utf-8"))
    assert shown == json.loads((tmp_path / "propagation_speed.json").read_text(encoding="utf-8"))
