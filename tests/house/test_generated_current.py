"""generated/ is what the generator writes today, byte for byte."""

from __future__ import annotations

from pathlib import Path

import pytest

import lie_codegen as lc

GROUPS = ("se2", "se3", "so3")


@pytest.mark.parametrize("name", GROUPS)
def test_the_committed_tree_is_current(name: str, tmp_path: Path, repository: Path) -> None:
    fresh = lc.generate(lc.group(name), tmp_path / name)
    committed = repository / "generated" / name
    want = {path.relative_to(fresh): path.read_bytes() for path in fresh.rglob("*") if path.is_file()}
    have = {path.relative_to(committed): path.read_bytes() for path in committed.rglob("*") if path.is_file()}
    stale = sorted(str(path) for path in want.keys() | have.keys() if want.get(path) != have.get(path))
    assert not stale, f"run: lie-codegen generate {name} --out generated/{name}"


def test_nothing_else_is_committed_there(repository: Path) -> None:
    assert sorted(path.name for path in (repository / "generated").iterdir()) == list(GROUPS)
