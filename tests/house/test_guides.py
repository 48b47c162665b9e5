"""The guides of the subjects: every public name has a line, and the code runs as it stands."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from tools import front_door

SUBJECTS = front_door.subjects()


def guide(subject: str) -> str:
    """All guides of a subject: its README.md and those of its own packages."""
    return "\n".join(path.read_text(encoding="utf-8") for path in (front_door.PACKAGE / subject).rglob("README.md"))


@pytest.mark.parametrize("subject", SUBJECTS)
def test_every_public_name_has_a_line_in_the_guide(subject: str) -> None:
    text = guide(subject)
    missing = [name for name in front_door.names(subject) if not re.search(rf"\b{name}\b", text)]
    assert not missing, f"lie_codegen/{subject}/README.md says nothing of {', '.join(missing)}"


@pytest.mark.parametrize("subject", [each for each in SUBJECTS if each not in ("control", "steering")])
def test_the_code_of_a_guide_runs(subject: str, repository: Path, tmp_path: Path) -> None:
    """Blocks of one guide run one after the other; tests/control and tests/steering run those of theirs."""
    text = (front_door.PACKAGE / subject / "README.md").read_text(encoding="utf-8")
    code = "\n".join(re.findall(r"^```python\n(.*?)^```$", text, flags=re.DOTALL | re.MULTILINE))
    environment = {**os.environ, "PYTHONPATH": str(repository)}
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
