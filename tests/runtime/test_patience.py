"""Long work: Ctrl-C ends it between two pieces of compiled code, and a line on stderr says that it goes on."""

from __future__ import annotations

import io
import signal
import subprocess
import sys
import time
from typing import Any

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.flow.libraries import integrators
from lie_codegen.runtime import call, drive, patience, threads


def test_pieces_of_loops_give_the_same_states(monkeypatch: pytest.MonkeyPatch) -> None:
    step, rng = integrators(lc.group("so3")).rkmk4_step, np.random.default_rng(0)
    n, X = 120, np.repeat(np.eye(3)[None], 5, axis=0)
    alone, shared = rng.normal(size=(3, n, 3)), rng.normal(size=(3, 1, n, 3))
    own = rng.normal(size=(3, 5, n, 3))

    def runs() -> list[Any]:
        return [
            step.scan(np.eye(3), *alone, 0.01, n=n, every=6),
            step.scan(np.eye(3), *alone, 0.01, n=n, every=n),
            step.scan_batch(X, *own, 0.01, n=n, every=6),
            step.scan_batch(X, *shared, np.full(5, 0.01), n=n, every=60),
            lc.simulate("so3", ["sin(t)", "cos(t)", "1"], t=[0, 1, 2, 3, 4], method="rkmk4", rtol=1e-8).X,
            lc.closed_loop("so3", inertia=[1, 2, 2], law=lc.attitude_law("pd", inertia=[1, 2, 2], k_d=2), t=[0, 1, 2],
                           xi0=[0.1, 0.2, 0.3], step=0.01, sample=0.02, noise={"X": 0.1}, runs=9).X,
        ]  # fmt: skip

    want = runs()
    for most in (50, 17, 7):
        for module in (call, drive, threads):
            monkeypatch.setattr(module, "CALLS", most)
        for a, b in zip(want, runs(), strict=True):
            np.testing.assert_allclose(a, b, atol=1e-13)


def test_what_steps_are_taken_in_pieces() -> None:
    for steps, every, most in ((12, 3, 7), (12, 12, 5), (12, 6, 100), (12, 1, 1)):
        pieces = list(threads.step_pieces(steps, every, most))
        assert [first for first, _, _ in pieces] == np.cumsum([0, *(count for _, count, _ in pieces)])[:-1].tolist()
        assert sum(count for _, count, _ in pieces) == steps
        assert all(
            count % kept == 0 and count <= max(most, every if every <= most else most) for _, count, kept in pieces
        )
        assert sum(count // kept for first, count, kept in pieces if (first + count) % every == 0) == steps // every


LONG = {
    "closed_loop": "lc.closed_loop('so3', inertia=[1, 2, 2], law=lc.attitude_law('pd', inertia=[1, 2, 2], k_d=2), X0=many, t=[0, 1e5], step=.01)",
    "threads": "step.scan_batch(many, [.1, 0, 0], [.1, 0, 0], [.1, 0, 0], .01, n=10**8, every=10**8, threads=2)",
    "scan": "step.scan(np.eye(3), [.1, 0, 0], [.1, 0, 0], [.1, 0, 0], .01, n=10**10, every=10**10)",
    "shooting": "lc.steer('so4', X, ['L12', 'L13', 'L14'], 5, method='optimal', starts=1000000)",
}


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.parametrize("name", LONG)
def test_ctrl_c_ends_it_within_a_second(name: str) -> None:
    """Of processor time: the machine may be busy with other things."""
    code = f"""
import resource, signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # a process in the background is born deaf to it
import numpy as np, lie_codegen as lc
from lie_codegen.flow.libraries import integrators
step = integrators(lc.group("so3")).rkmk4_step
many = np.repeat(np.eye(3)[None], 20000, axis=0)
step.scan_batch(many[:20], [.1, 0, 0], [.1, 0, 0], [.1, 0, 0], .01, n=1)
X = lc.build("so4").exp([1, 2, -1, .5, .3, .2])
lc.steer('so4', X, ['L12', 'L13', 'L14'], 5, method='optimal', starts=8)
lc.closed_loop('so3', inertia=[1, 2, 2], law=lc.attitude_law('pd', inertia=[1, 2, 2], k_d=2), X0=many[:20], t=[0, 1], step=.01)
print("ready", flush=True)
try:
    {LONG[name]}
except KeyboardInterrupt:
    print("stopped", flush=True)
"""
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    time.sleep(2)
    began = time.perf_counter()
    process.send_signal(signal.SIGINT)
    assert process.stdout.readline() == "stopped\n"
    assert time.perf_counter() - began < 1 + 4  # a second, and what a machine busy with the other tests takes
    process.wait(timeout=30)


def test_a_build_and_a_batch_say_that_they_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    seen = Terminal()
    monkeypatch.setattr(sys, "stderr", seen)
    monkeypatch.setattr(patience, "_FIRST", 0.001)
    port = lc.Port("x", ())
    factor = time.time()  # a kernel that no cache knows
    kernel = lc.Kernel("scaled", "patience", (port,), (lc.Port("y", ()),), lambda ops, x: (ops.sin(factor * x),))
    library = lc.build(kernel)
    assert "build: 0 s" in seen.getvalue()
    monkeypatch.setattr(call, "CALLS", 1000)
    monkeypatch.setattr(threads, "CALLS", 1000)
    library.scaled.batch(np.zeros((1, 1)).repeat(2_000_000, axis=1)[0])
    assert "batch: 0 s" in seen.getvalue()
    assert seen.getvalue().endswith("\r")
