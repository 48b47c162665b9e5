"""The README's pipeline and the examples: run as they stand, and their C against the numbers of the loops, by gcc."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

NAMES = {"quantum": "gate", "underwater": "boat", "planar": "hover"}
# Not optimised: what gcc warns of then is asked of such packages by the tests of plans and of loops; here their programs run.
STRICT = ["gcc", "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O0", "-Iinclude"]
needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")


def python(arguments: list[str], repository: Path, folder: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(repository)}
    done = subprocess.run([sys.executable, *arguments], cwd=folder, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr


def flown(folder: Path, name: str) -> None:
    sources = sorted(str(path.relative_to(folder)) for path in (folder / "src").glob("*.c"))
    subprocess.run([*STRICT, "-c", *sources], cwd=folder, check=True)
    objects = [f"{Path(source).stem}.o" for source in sources]
    for program in (f"{name}_loop", f"{name}_plan_replay", "example"):
        subprocess.run([*STRICT, f"{program}.c", *objects, "-lm", "-o", program], cwd=folder, check=True)
        done = subprocess.run([f"./{program}"], cwd=folder, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout


@needs_gcc
def test_the_pipeline_of_the_readme(repository: Path, tmp_path: Path) -> None:
    text = (repository / "README.md").read_text(encoding="utf-8")
    found = re.search(r"<!-- pipeline -->\n```python\n(.*?)^```$", text, flags=re.DOTALL | re.MULTILINE)
    assert found is not None
    assert len(ast.parse(found.group(1)).body) == 6
    check = "assert loops.error.shape == (101, 1000) and loops.error[-1].max() < 0.01 and loops.error[-1].max() > 1e-4"
    code = "\n".join(["import numpy as np", "import lie_codegen as lc", found.group(1), check])
    python(["-c", code], repository, tmp_path)
    assert (tmp_path / "results" / "band.png").stat().st_size > 10_000
    flown(tmp_path / "results" / "satellite", "satellite")


@needs_gcc
@pytest.mark.parametrize("example", NAMES)
def test_the_examples(example: str, repository: Path, tmp_path: Path) -> None:
    script = repository / "examples" / f"{example}.py"
    lines = [
        line
        for line in script.read_text(encoding="utf-8").splitlines()
        if line and not line.startswith(("import", '"""'))
    ]
    assert len(lines) < 15
    python([str(script), str(tmp_path)], repository, tmp_path)
    assert (tmp_path / f"{example}.png").stat().st_size > 10_000
    flown(tmp_path / example, NAMES[example])
