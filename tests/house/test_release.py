"""One version, wherever it is written."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import lie_codegen as lc


def test_the_version_is_the_same_everywhere(repository: Path) -> None:
    project = tomllib.loads((repository / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["project"]["dynamic"] == ["version"]
    assert project["tool"]["hatch"]["version"]["path"] == "lie_codegen/__init__.py"
    for name, pattern in (("CITATION.cff", r"^version: (\S+)$"), ("recipe/meta.yaml", r'set version = "([^"]+)"')):
        found = re.search(pattern, (repository / name).read_text(encoding="utf-8"), re.MULTILINE)
        assert found is not None, name
        assert found[1] == lc.__version__, name


def test_the_recipe_asks_for_what_the_project_asks(repository: Path) -> None:
    project = tomllib.loads((repository / "pyproject.toml").read_text(encoding="utf-8"))
    recipe = (repository / "recipe" / "meta.yaml").read_text(encoding="utf-8")
    for requirement in project["project"]["dependencies"]:
        name = re.split(r"[<>=]", requirement)[0]
        assert re.search(rf"^    - {name}\b", recipe, re.MULTILINE), name
