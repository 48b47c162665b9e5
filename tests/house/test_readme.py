"""The README's code runs as written, and its commands are there for continuous integration."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import lie_codegen


def blocks(repository: Path, language: str) -> list[str]:
    text = (repository / "README.md").read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```$", text, flags=re.DOTALL | re.MULTILINE)


def test_the_python_of_the_readme_runs(repository: Path, tmp_path: Path) -> None:
    code = "\n".join(blocks(repository, "python"))
    assert "lc.steer" in code
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, env=_environment(repository)
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "results" / "so3" / "manifest.json").is_file()
    if shutil.which("cc") is None:
        return
    [program] = blocks(repository, "c")
    (tmp_path / "main.c").write_text(program)
    said = re.search(r"`(cc -std=c99 -Iresults/slew[^`]*)`", (repository / "README.md").read_text(encoding="utf-8"))
    assert said is not None
    printed = subprocess.run(said[1], shell=True, cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    u1, u2 = map(float, printed.split())
    assert 0 < u1**2 + u2**2 <= 2 * 0.4**2


def test_the_group_file_of_the_readme_is_a_group(repository: Path, tmp_path: Path) -> None:
    [text] = blocks(repository, "toml")
    path = tmp_path / "osc4.toml"
    path.write_text(text)
    assert lie_codegen.group(path).dim == 4


def test_both_commands_are_marked_for_continuous_integration(repository: Path) -> None:
    text = (repository / "README.md").read_text(encoding="utf-8")
    for mark, word in (("main-command", "reproduce"), ("test-command", "pytest")):
        assert re.search(rf"<!-- {mark} -->\n```sh\npython3 -m venv .*{word}\n```", text), mark


def test_the_picture_of_the_readme_is_there(repository: Path) -> None:
    text = (repository / "README.md").read_text(encoding="utf-8")
    for path in re.findall(r"!\[.*?\]\((.*?)\)", text):
        assert (repository / path.partition("#")[0]).is_file(), path


def _environment(repository: Path) -> dict[str, str]:
    import os

    return {**os.environ, "PYTHONPATH": str(repository)}


def test_the_table_of_groups_is_current(repository: Path) -> None:
    from lie_codegen.cli.catalogue_table import catalogue_table

    text = (repository / "README.md").read_text(encoding="utf-8")
    shown = re.search(r"<!-- catalogue-table -->\n(.*?)<!-- end of catalogue-table -->", text, flags=re.DOTALL)
    assert shown is not None
    assert shown.group(1) == catalogue_table()
