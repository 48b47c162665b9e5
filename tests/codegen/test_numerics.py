"""Bits of generated code do not change between two releases without a new numerics version, and the number is seen."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command_line import run
from tools.numerics import RECORD, arithmetic, digests, verdict

import lie_codegen as lc
from lie_codegen.codegen.numerics import NUMERICS_VERSION


def test_the_version_is_that_of_the_arithmetic() -> None:
    now = digests()
    assert {*lc.group_names(), "lanes"} == set(now)
    assert not verdict(json.loads(RECORD.read_text(encoding="utf-8")), now, NUMERICS_VERSION)


def test_a_change_asks_for_a_new_version_once() -> None:
    now = digests()
    released = {"version": 4, "digests": dict(now)}
    assert not verdict(released, now, 4)
    changed = {**now, "se3": "0" * 64}
    assert "se3" in verdict(released, changed, 4)
    assert "= 5" in verdict(released, changed, 4)
    assert not verdict(released, changed, 5)
    assert verdict(released, changed, 6)
    assert verdict(released, now, 3)
    assert not verdict(released, {**now, "new": "1"}, 4)


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("double f(double x) { /* said */\n  return x + 1.0; }", True),
        ("double f(double x) { return x+ 1.0; }", False),
        ("double f(double x) { return 1.0 + x; }", False),
    ],
)
def test_comments_and_lines_are_no_arithmetic(text: str, same: bool) -> None:
    assert (arithmetic(text) == "double f(double x) { return x + 1.0; }") == same


def test_where_it_is_seen(tmp_path: Path) -> None:
    folder = lc.generate("r3", tmp_path / "r3")
    said = f"Numerics version {NUMERICS_VERSION}"
    assert said in (folder / "include" / "r3.h").read_text(encoding="utf-8")
    assert said in (folder / "README.md").read_text(encoding="utf-8")
    assert json.loads((folder / "manifest.json").read_text(encoding="utf-8"))["numerics"] == NUMERICS_VERSION
    assert f"numerics {NUMERICS_VERSION}" in run("--version", cwd=tmp_path).stdout
