"""One version, wherever it is written."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import lie_codegen as lc


def test_the_version_is_the_same_everywhere(repository: Path) -> None:
    project = tomllib.loads((repository / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["project"]["dynamic"] == ["version", "readme"]
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


def test_the_long_description_has_no_picture_and_no_link_that_leads_nowhere(repository: Path) -> None:
    """What an index shows of the README: after the substitutions of pyproject.toml every link is whole or within the page."""
    hook = tomllib.loads((repository / "pyproject.toml").read_text())["tool"]["hatch"]["metadata"]["hooks"]
    text = (repository / "README.md").read_text()
    assert "](docs/" in text
    for each in hook["fancy-pypi-readme"]["substitutions"]:
        text = re.sub(each["pattern"], each["replacement"], text)
    assert "![" not in text
    targets = re.findall(r"\]\(([^)]*)\)", text)
    assert all(target.startswith(("http", "#")) for target in targets), targets
