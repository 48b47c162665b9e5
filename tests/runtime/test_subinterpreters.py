"""Another interpreter of the process is refused by an error of ours, whether NumPy is loaded already or not."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import lie_codegen as lc
from lie_codegen.door import is_subinterpreter

CODE = """
FIRST
try:
    import _interpreters as interpreters
except ImportError:
    import _xxsubinterpreters as interpreters
run = getattr(interpreters, "exec", None) or interpreters.run_string
run(interpreters.create(), '''
import lie_codegen as lc
for name in ("build", "group", "steer"):
    try:
        getattr(lc, name)("so3")
    except Exception as error:
        print(type(error).__name__, "processes" in str(error), flush=True)
''')
"""


def test_this_is_the_first() -> None:
    assert not is_subinterpreter()


@pytest.mark.parametrize("first", ["", "import lie_codegen as lc; lc.group('so3')"], ids=["cold", "after numpy"])
def test_a_subinterpreter_is_refused(first: str) -> None:
    code = CODE.replace("FIRST", first)
    environment = {**os.environ, "PYTHONPATH": str(Path(lc.__file__).parent.parent)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    if "No module named" in done.stderr:
        pytest.skip("this Python has no interpreters beside the first")
    assert done.stdout.split() == ["SubinterpreterError", "True"] * 3, done.stderr
