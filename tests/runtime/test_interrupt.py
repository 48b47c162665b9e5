"""Ctrl-C ends long compiled work within a second of the processor's time, whatever it is and on however many threads."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import lie_codegen as lc

WORK = {
    "scan_batch": "step.scan_batch(many, u, u, u, 1e-3, n=100_000, every=1000)",
    "threads": "step.scan_batch(many, u, u, u, 1e-3, n=100_000, every=1000, threads=2)",
    "sampled": "lc.closed_loop('so3', law=law, inertia=(1, 2, 3), runs=20000, t=t, sample=0.01, noise={'X': 1e-3})",
    "continuous": "lc.closed_loop('so3', law=law, inertia=(1, 2, 3), xi0=np.ones((20000, 3)), t=t, step=0.01)",
    "direct": "lc.steer('so3', (0.1, 0.2, 0.3), ('w1', 'w2'), 1.0, method='direct', starts=200000, bounds=30)",
    "gate": "lc.steer(lc.pauli(3), toffoli, ('XII', 'YII', 'IXI', 'IYI', 'IIX', 'IIY'), 12.0, drift={'ZZI': 1, 'IZZ': 1}, bounds=4)",
    "ocp": "long.solve(goal=goal, starts=4000, tolerance=0.0)",
}
#: The same in small, so that what it needs is compiled and the key is pressed in the long work, not before it.
SMALL = {
    "scan_batch": "step.scan_batch(many[:9], u, u, u, 1e-3, n=10)",
    "threads": "step.scan_batch(many[:9], u, u, u, 1e-3, n=10, threads=2)",
    "sampled": "lc.closed_loop('so3', law=law, inertia=(1, 2, 3), runs=2, t=t[:2], sample=0.01, noise={'X': 1e-3})",
    "continuous": "lc.closed_loop('so3', law=law, inertia=(1, 2, 3), xi0=np.ones((2, 3)), t=t[:2], step=0.01)",
    "direct": "lc.steer('so3', (0.1, 0.2, 0.3), ('w1', 'w2'), 1.0, method='direct', starts=1, bounds=30)",
    "gate": WORK["gate"][:-1] + ", starts=1, rounds=1, iterations=1)",
    "ocp": "long.machine()",
}
SETUP = """
import contextlib, os, resource, signal, threading, time
import numpy as np
import lie_codegen as lc

resource.setrlimit(resource.RLIMIT_CPU, (120, 120))  # ends deaf work by its own clock, however busy the machine is
signal.signal(signal.SIGINT, signal.default_int_handler)  # a process in the background is born deaf to it
u, t = np.array([0.3, -0.2, 0.5]), np.linspace(0, 400, 401)
many = np.tile(np.eye(3), (20000, 1, 1))
step = lc.build(lc.rkmk4_step("so3")).rkmk4_step
law = lc.attitude_law("pd", inertia=(1, 2, 3), k_p=4, k_d=6)
long = lc.ocp("se2", controls=("omega", "vx"), duration=1.0, intervals=800, stage_cost="norm2(u)", target="goal")
toffoli = lc.UpToPhase(np.eye(8)[[0, 1, 2, 3, 4, 5, 7, 6]])
goal = np.array([[0, -1, 0.1], [1, 0, 2], [0, 0, 1]])
with contextlib.suppress(lc.errors.SteeringError):
    SMALL
sent = []

def interrupt():
    while time.process_time() < begun + 0.7:  # of the processor, however slow it is: deep in the long work
        time.sleep(0.05)
    sent.append(time.process_time())
    os.kill(os.getpid(), signal.SIGINT)

begun = time.process_time()
threading.Thread(target=interrupt).start()
try:
    WORK
except KeyboardInterrupt:
    print(time.process_time() - sent[0])
"""


@pytest.mark.skipif(os.name != "posix" or not hasattr(signal, "SIGINT"), reason="signals of POSIX")
@pytest.mark.parametrize("work", WORK)
def test_of_long_work(work: str, repository: Path) -> None:
    code = SETUP.replace("SMALL", SMALL[work]).replace("WORK", WORK[work])
    environment = {**os.environ, "PYTHONPATH": str(repository)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, timeout=1200)
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) < 1.5  # of two threads at most


def test_cutting_changes_nothing() -> None:
    step = lc.build(lc.rkmk4_step("so3")).rkmk4_step
    rng = np.random.default_rng(0)
    starts = np.array([np.eye(3)] * 1001)
    u = rng.normal(size=(1001, 3))
    whole = step.scan_batch(starts, u, u, u, 1e-2, n=400, every=400)  # 400,400 steps: in bites
    for k in (0, 500, 1000):
        np.testing.assert_array_equal(
            whole[k],
            step.scan_batch(starts[k : k + 1], u[k : k + 1], u[k : k + 1], u[k : k + 1], 1e-2, n=400, every=400)[0],
        )


def test_the_process_of_a_solver_is_silent_at_ctrl_c() -> None:
    """A terminal sends it to every process: the one that waits for work neither ends nor prints where it was."""
    solver = [sys.executable, "-m", "lie_codegen.steering.transcription.watched_solver"]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(solver, **pipes) as process:  # type: ignore[call-overload]
        assert pickle.load(process.stdout) == "ready"
        process.send_signal(signal.SIGINT)
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(0.5)
        _, said = process.communicate()
    assert process.returncode == 0
    assert said == b""
