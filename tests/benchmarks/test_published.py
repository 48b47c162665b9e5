"""lie-codegen bench published: ours is as good as what is known, and what is not is said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from command_line import run

from lie_codegen.benchmarks.published import bench_published, table


def test_a_line_of_sight_and_a_place_cost_what_is_known() -> None:
    rows, missed = bench_published("to the place")
    assert len(rows) == 3
    assert not missed
    worse = replace(rows[0], ours=1.001 * rows[0].known)
    assert not worse.good
    assert not replace(rows[0], ours=float("nan")).good
    assert replace(rows[0], kind="count", ours=rows[0].known + 1).good
    assert "SE(2), to the place (0, 1)" in table(rows, ["a task: 2, known 1"])


def test_the_command_prints_the_table(tmp_path: Path) -> None:
    assert "5.161601" in run("bench", "published", "--only", "place (0, 1)", cwd=tmp_path).stdout


@pytest.mark.slow
def test_every_published_value_is_matched_or_beaten() -> None:
    _, missed = bench_published()
    assert not missed
