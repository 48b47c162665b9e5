"""The benchmark compares like with like; nothing here is about how long anything takes."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm, logm

import lie_codegen as lc
from lie_codegen.benchmarks import cold as bench_cold
from lie_codegen.benchmarks import commits
from lie_codegen.benchmarks import group_loops as bench_group_loops
from lie_codegen.benchmarks import kernels as bench_kernels
from lie_codegen.benchmarks import laws as bench_laws
from lie_codegen.benchmarks import loops as bench_loops
from lie_codegen.benchmarks import peers as bench_peers
from lie_codegen.benchmarks import run as bench
from lie_codegen.benchmarks.commits import CommitRow
from lie_codegen.benchmarks.rows import AbsentError, Entrant, Row, compare, compete, flat
from lie_codegen.benchmarks.timing import timings_of
from lie_codegen.codegen.templates import template_folder
from lie_codegen.errors import ComputationError, InputError
from lie_codegen.groups.kernels import group_kernel
from lie_codegen.runtime.build import build_kernels
from lie_codegen.runtime.compiler import find_compilers

needs_compiler = pytest.mark.skipif(not find_compilers(), reason="needs a C compiler")
#: What takes part wherever the package itself is installed.
HOME = {"CasADi", "hand-written", "lie_codegen", "numpy", "scipy"}


def test_ratios_are_taken_within_a_round_and_over_the_work_that_was_done() -> None:
    timings = timings_of({"ours": [1.0, 2.0, 4.0], "theirs": [3.0, 8.0, 8.0]})
    assert (timings["theirs"].ratio.low, timings["theirs"].ratio.middle, timings["theirs"].ratio.high) == (2, 3, 4)
    assert timings["ours"].ratio.high == 1.0


def test_who_computes_something_else_is_not_timed_and_who_is_absent_is_named() -> None:
    def absent() -> Any:
        raise AbsentError("not installed")

    def broken() -> Any:
        raise RuntimeError("first line\nsecond")

    row = compete(
        "call", "x", "ns", 1, 3,
        [
            Entrant("ours", lambda: lambda: (np.arange(3.0), 4.0)),
            Entrant("same", lambda: lambda: [np.arange(3), np.array([[4.0]])]),
            Entrant("some", lambda: lambda: np.arange(2.0)),
            Entrant("last", lambda: lambda: 4.0, part=slice(-1, None)),
            Entrant("off", lambda: lambda: np.arange(4.0) + 1e-6),
            Entrant("nan", lambda: lambda: np.full(4, np.nan)),
            Entrant("more", lambda: lambda: np.arange(5.0)),
            Entrant("absent", absent),
            Entrant("broken", broken),
        ],
    )  # fmt: skip
    assert list(row.timings) == ["ours", "same", "some", "last"]
    assert row.skipped["absent"] == "not installed"
    assert row.skipped["broken"] == "RuntimeError: first line"
    assert {"off", "nan", "more"} < set(row.skipped)
    np.testing.assert_array_equal(flat(np.array([1 + 2j])), [1, 2])
    with pytest.raises(ComputationError, match="0 numbers"):
        compare(np.ones(2), np.empty(0), 1e-9)


def _agree(row: Row) -> None:
    """Everyone who needs nothing installed took part."""
    for name, reason in row.skipped.items():
        assert "something else" not in reason, (name, reason)
        assert name.split()[0] not in HOME, (name, reason)


@needs_compiler
def test_loops_agree_with_the_peers_at_hand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (bench_loops, bench_group_loops):
        monkeypatch.setattr(module, "STEPS", 200)
    monkeypatch.setattr(bench_loops, "COUNT", 9)
    monkeypatch.setattr(bench_loops, "SHORT", 20)
    monkeypatch.setattr(bench_loops, "_PART", 0.1)
    monkeypatch.setattr(bench_group_loops, "_LONG", 1000)
    hand = bench_peers.hand_written(tmp_path)
    for row in (
        bench_loops.trajectory_row(tmp_path, hand, 1),
        bench_loops.monte_carlo_row(tmp_path, hand, 1),
        bench_group_loops.group_row(tmp_path, 1),
    ):
        _agree(row)


@needs_compiler
def test_calls_and_batches_agree_with_the_peers_at_hand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_kernels, "LARGE", 100)
    kernel = group_kernel(lc.group("se2"), "wei_norman_rate")
    rows = bench_kernels.kernel_rows(kernel, tmp_path, 1, bench_peers.hand_written(tmp_path))
    assert [row.area for row in rows] == ["call", "batch", "batch"]
    for row in rows:
        _agree(row)
    assert "of the roof, as many operations" in rows[1].note
    assert "of the roof, as many " in rows[2].note


@needs_compiler
def test_the_tracker_with_a_logarithm_is_its_formula() -> None:
    se3 = lc.group("se3")
    f = build_kernels(lambda: [bench_laws.log_tracker()]).log_tracker
    rng = np.random.default_rng(0)
    X, X_d = (expm(se3.hat(rng.uniform(-1, 1, 6))) for _ in range(2))
    xi, xi_d, rate, K_p, K_d, J = rng.uniform(0.5, 2, (6, 6))
    E = np.linalg.inv(X_d) @ X
    nu, moved = (se3.vee(np.linalg.inv(E) @ se3.hat(v) @ E) for v in (xi_d, rate))

    def ad(v: np.ndarray) -> np.ndarray:
        return np.stack([se3.vee(se3.hat(v) @ b - b @ se3.hat(v)) for b in se3.basis], axis=-1)

    wanted = -K_p * se3.vee(logm(E).real) - K_d * (xi - nu) + J * (moved + ad(nu) @ xi) - ad(xi).T @ (J * xi)
    np.testing.assert_allclose(f(X, xi, X_d, xi_d, rate, K_p, K_d, J), wanted, rtol=0, atol=1e-12)


def test_every_kernel_section_has_a_kernel_and_no_other_title_is_taken() -> None:
    for title, make in bench.KERNELS.items():
        assert make().symbol.split("_")[0] in title.replace("se_2_3", "se"), title
    with pytest.raises(InputError, match="no section has 'so99'"):
        bench.bench(only="so99")


def test_the_cold_programs_are_python() -> None:
    for _, code in bench_cold._PEERS.values():
        ast.parse(code)
    ast.parse((template_folder() / "bench_cold_numba.py").read_text(encoding="utf-8"))


def test_a_commit_is_slower_where_every_pair_of_processes_says_so() -> None:
    rows = [
        CommitRow("noise", 1.2, 1.0, (1.2, 0.99, 1.3)),
        CommitRow("slow", 1.2, 1.0, (1.2, 1.06, 1.3)),
        CommitRow("plan", 1.0, 1.0, (1.0,), 2.0, 2.001),
        CommitRow("dear plan", 1.0, 1.0, (1.0,), 2.1, 2.0),
        CommitRow("new", note="the other: AttributeError"),
    ]
    found = commits.worse(rows)
    assert [text.split(":")[0] for text in found] == ["slow", "dear plan"]
    text = commits.table(rows, found)
    assert "worse: slow: 1.060 to 1.300" in text
    assert "new                                          -  the other: AttributeError" in text
    joined = commits._joined([CommitRow("x", 3.0, 4.0, (0.75,), 1.0, 1.0), CommitRow("x", 2.0, 5.0, (0.4,), 1.0, 1.0)])
    assert (joined.ours, joined.theirs, joined.ratios) == (2.0, 4.0, (0.75, 0.4))


@needs_compiler
def test_two_checkouts_run_in_turn_and_what_one_lacks_is_named(repository: Path, tmp_path: Path) -> None:
    other = tmp_path / "lie_codegen"
    other.mkdir()
    for name, text in {"__init__.py": "from lie_codegen.all import *", "all.py": _OTHER}.items():
        (other / name).write_text(text)
    [row] = commits.bench_commits(str(tmp_path), 1, "so3 exp, call", pairs=1)
    assert row.ratios[0] < 1
    [row] = commits.bench_commits(str(tmp_path), 1, "propagator", pairs=1)
    assert row.note.startswith("the other: AttributeError")
    with pytest.raises(InputError, match="neither a checkout of lie_codegen nor a commit"):
        commits.bench_commits("no-such-commit", 1)
    with pytest.raises(InputError, match="no row has 'so99'"):
        commits.bench_commits(str(tmp_path), 1, "so99")


#: A package that can do one kernel, slowly.
_OTHER = """
from types import SimpleNamespace
def group_kernels(group):
    return [SimpleNamespace(name="exp", inputs=[SimpleNamespace(shape=(3,))], sampler=lambda rng: ([0.0] * 3,))]
def build(kernels):
    return {"exp": lambda x: sum(range(100_000))}
"""


@needs_compiler
@pytest.mark.slow
def test_a_section_in_a_process_of_its_own() -> None:
    found = bench.bench(rounds=3, only="Monte Carlo")
    assert not found.failed
    assert [row.area for row in found.rows] == ["Monte Carlo"]
