"""What steering by shooting imports once its solver is in the cache."""

from __future__ import annotations

import subprocess
import sys

import pytest

from lie_codegen.runtime.compiler import find_compilers

CODE = (
    "import sys, numpy as np, lie_codegen as lc; target = lc.build('so3').exp([0.1, 0.2, 0.3]); "
    "plan = lc.steer('so3', target, controls=[0, 1], duration=1.0); print(plan.method, 'casadi' in sys.modules)"
)


@pytest.mark.skipif(not find_compilers(), reason="no C compiler")
def test_a_warm_steer_by_shooting_needs_no_casadi() -> None:
    for _ in range(2):
        done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["optimal", "False"]
