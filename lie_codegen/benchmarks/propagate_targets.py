"""Rows of `lie-codegen bench propagate` beside propagation: fresh processes with a warm cache, and what fresh results of batches cost."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from lie_codegen.benchmarks.limits import memory_work
from lie_codegen.benchmarks.peers import hand_written
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.groups.build import build
from lie_codegen.groups.catalogue_load import group
from lie_codegen.runtime.child import child_environment

#: what, who, rtol, seconds, error, build, ratio.
Row = tuple[str, str, float, float, float, float, float]

#: name -> what a fresh process does; then it imports nothing of what derives (an error of the process, were it otherwise).
PROCESSES = {
    "a process to a law": "lc.build(lc.attitude_law('pd', inertia=(1, 2, 3), k_p=4, k_d=6))",
    "a process to a plan": "lc.steer('so3', (0.1, 0.2, 0.3), controls=[0, 1], duration=4.0)",
    "a process to a run": "lc.simulate('so3', ['sin(t)', 'cos(t)', '1'], t=[0, 1])",
}
_LIGHT = "import sys; assert not {'sympy', 'casadi', 'jinja2'} & set(sys.modules)"
#: Batches of exponentials of SE(3), from those that stay in the caches to those that do not.
COUNTS = (1_000, 16_384, 1_000_000)


def target_rows(say: Callable[[str], None]) -> Iterator[Row]:
    """One after the other."""
    say("fresh processes")
    for name, code in PROCESSES.items():
        program = f"import lie_codegen as lc; {code}; {_LIGHT}"
        _seconds(f"import lie_codegen as lc; {code}")  # fills the cache
        both = np.array([(_seconds(program), _seconds("import numpy")) for _ in range(3)]).min(axis=0)
        yield name, "lie_codegen", 0.0, both[0], 0.0, 0.0, float("nan")
        yield name, "import numpy", 0.0, both[1], 0.0, 0.0, both[1] / both[0]
    say("fresh results")
    with TemporaryDirectory() as folder:
        hand = hand_written(Path(folder))
        for count in COUNTS:
            yield from _batches(count, lambda n: memory_work(hand, 6 * n, 16 * n))


def _batches(count: int, moved: Callable[[int], Callable[[], object]]) -> Iterator[Row]:
    """With a fresh result, into one that is there, and only the bytes; in turn."""
    exp, se3 = build("se3").exp, group("se3")
    x = np.tile(np.random.default_rng(0).normal(size=(64, 6)), (-(-count // 64), 1))[:count]
    out = exp.batch(x)
    error = float(np.max(np.abs(out[:64] - expm(np.array([se3.hat(row) for row in x[:64]])))))
    works: list[Callable[[], object]] = [lambda: exp.batch(x), lambda: exp.batch(x, out=out), moved(count)]
    repeats = max(1, 200_000 // count)
    least = [float("inf")] * len(works)
    for _ in range(9):
        for k, work in enumerate(works):
            least[k] = min(least[k], _timed(work, repeats))
    fresh, into, bytes_moved = least
    what = f"{count:,} exp of SE(3)"
    yield what, "lie_codegen", 1e-14, fresh, error, 0.0, float("nan")
    yield what, "into out=", 1e-14, into, error, 0.0, into / fresh
    yield what, "bytes moved", 1e-14, bytes_moved, 0.0, 0.0, bytes_moved / into


def _timed(work: Callable[[], object], repeats: int) -> float:
    start = time.process_time()
    for _ in range(repeats):
        kept = work()
    del kept
    return (time.process_time() - start) / repeats


def _seconds(program: str) -> float:
    """Processor time of a process."""
    import resource  # Unix alone has it

    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    # Warm is with bytecode: where a session forbids to write it, compiling the package anew is two fifths of such a process.
    environment = child_environment(PYTHONDONTWRITEBYTECODE="")
    subprocess.run([sys.executable, "-c", program], env=environment, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
