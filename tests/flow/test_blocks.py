"""A long run goes block by block, so that Ctrl-C is heard between them; the blocks change nothing."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.flow.magnus import run

INTERRUPTED = """
import os, signal, threading
import numpy as np
import lie_codegen as lc

signal.signal(signal.SIGINT, signal.default_int_handler)  # a process in the background is born deaf to it
u = lc.PeriodicInput(["cos(t)", "sin(t)", "0"], period="2*pi")
lc.simulate("so3", u, t=[0, 1])
threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
try:
    lc.simulate("so3", u, t=[0, 1e6], steps=60_000_000)
    print("finished")
except KeyboardInterrupt:
    print("interrupted")
"""


def test_blocks_of_steps_give_the_run_in_one(monkeypatch: pytest.MonkeyPatch) -> None:
    u = lc.PeriodicInput(["cos(t)", "sin(2*t)", "0"], period="2*pi")
    t = np.linspace(0, 300, 12)
    whole = lc.simulate("so3", u, t=t, steps=4000).X
    monkeypatch.setattr(run, "BLOCK", 333)
    np.testing.assert_allclose(lc.simulate("so3", u, t=t, steps=4000).X, whole, atol=1e-13)


@pytest.mark.skipif(os.name != "posix" or not hasattr(signal, "SIGINT"), reason="signals of POSIX")
def test_a_long_run_can_be_interrupted(repository: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(repository)}
    done = subprocess.run([sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, env=environment)
    assert "interrupted" in done.stdout
