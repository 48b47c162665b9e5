"""What must not grow or tear: memory over many calls; a package and a saved plan, written by processes that are killed at any moment."""

from __future__ import annotations

import hashlib
import json
import random
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import lie_codegen as lc
from tests.hunt.faults import _environment

_PAGE = 4  # kB
_ALLOWED = 512  # kB: what the allocator may keep
WRITER = """
import sys
from pathlib import Path
from typing import Any
import lie_codegen as lc
home = Path(sys.argv[1])
plan = lc.steer("so3", (0.1, 0.05, 0.08), ("w1", "w2"), 24.0, method="four_phase")
print("ready", flush=True)
while True:
    plan.save(home / "plan.json")
    lc.generate("so2", home / "so2")
"""


def _resident() -> int:
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * _PAGE


def calls(count: int) -> tuple[int, list[str]]:
    """(calls, finds): resident memory after so many calls of every kind is what it was after a hundredth of them."""
    library, x = lc.build("so3"), np.array([0.1, 0.2, 0.3])
    X, several = library.exp(x), np.ones((100, 3))
    kinds = {
        "a call": (lambda: library.exp(x), count),
        "a list": (lambda: library.exp([0.1, 0.2, 0.3]), count // 10),
        "two matrices": (lambda: library.compose(X, X), count // 10),
        "a logarithm": (lambda: library.log(X), count // 10),
        "a batch": (lambda: library.exp.batch(several), count // 100),
        "a refusal": (lambda: _refused(library), count // 100),
    }
    tried, found = 0, []
    for name, (call, times) in kinds.items():
        for _ in range(max(1000, times // 100)):
            call()
        before = _resident()
        for _ in range(times):
            call()
        tried += times
        if _resident() - before > _ALLOWED:
            found.append(f"{name}: {times} times took {_resident() - before} kB")
    return tried, found


def _refused(library: Any) -> None:
    try:
        library.exp("no")
    except lc.errors.InputError:
        return
    raise AssertionError("a text was taken for three numbers")


def torn_writes(count: int, seed: int = 0) -> tuple[int, list[str]]:
    """(kills, finds): after each kill the package is whole or absent, and the saved plan is one that loads or absent."""
    rng, found = random.Random(seed), []
    with tempfile.TemporaryDirectory(prefix="hunt-") as folder:
        home = Path(folder)
        for number in range(count):
            environment = _environment(home / "cache")
            with subprocess.Popen(
                [sys.executable, "-c", WRITER, folder],
                env=environment,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            ) as running:
                assert running.stdout is not None
                running.stdout.readline()
                try:
                    running.wait(rng.uniform(0.0, 0.3))
                    found.append(f"kill {number}: the writer ended by itself, status {running.returncode}")
                except subprocess.TimeoutExpired:
                    running.kill()
            found += [f"kill {number}: {each}" for each in _torn(home)]
    return count, found


def _torn(home: Path) -> list[str]:
    wrong = []
    plan, package = home / "plan.json", home / "so2"
    if plan.exists() and lc.load(plan).duration != 24.0:
        wrong.append("another plan was loaded")
    if package.exists():
        listed = json.loads((package / "manifest.json").read_text(encoding="utf-8"))["files"]
        for name, digest in listed.items():
            if hashlib.sha256((package / name).read_bytes()).hexdigest() != digest:
                wrong.append(f"{name} is not what the manifest says")
    return wrong
