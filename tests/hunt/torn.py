"""Fault injection where files are written: every call of the system that a write makes fails, finds the disk full, or is the process's last.

Afterwards the file or folder is the old one whole, the new one whole, or absent, nothing lies beside it (unless the process was killed), the error
was one of ours, and an undisturbed write gives the new one. A fork of this process is disturbed, so that nothing of it stays.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import json
import os
import random
import resource
import signal
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import lie_codegen as lc
from lie_codegen.codegen.write import GENERATOR, write_package
from lie_codegen.errors import LieCodegenError

Write = Callable[[Path, bool], Any]
#: What is disturbed: the calls of the system behind Python's files and processes, and (by a limit) the bytes of a file.
POINTS: dict[str, tuple[Any, str]] = {
    "rename": (os, "rename"), "replace": (os, "replace"), "fsync": (os, "fsync"), "mkdir": (os, "mkdir"), "chmod": (os, "chmod"),
    "mkstemp": (tempfile, "mkstemp"), "mkdtemp": (tempfile, "mkdtemp"), "fork": (subprocess.Popen, "__init__"),
}  # fmt: skip
KINDS = {
    "refused": PermissionError(13, "Permission denied"),
    "full": OSError(28, "No space left on device"),
    "killed": None,
}
SIZES = (0, 1, 100, 5000)
OURS, OTHER = 3, 4


@cache
def plan(angle: float) -> Any:
    """A plan that needs no compiler."""
    return lc.steer("so3", (angle, 0.05, 0.08), ("w1", "w2"), 24.0, method="four_phase")


@cache
def optimal(angle: float) -> Any:
    """One that a page solves again."""
    return lc.steer("so3", (angle, 0.05, 0.08), ("w1", "w2"), 2.0)


@cache
def controller() -> Any:
    """A small one of lc.mpc."""
    labels = lc.group("so2").labels
    problem = lc.ocp(
        "so2",
        controls=labels,
        duration=1.0,
        intervals=4,
        parameters={"Xd": (2, 2)},
        stage_cost=("X - Xd", "u"),
        name="turn",
    )
    made = lc.mpc(problem)
    made.reset(problem.solve(X0=np.eye(2), Xd=np.eye(2)))
    return made


def _real(new: bool) -> str:
    return "float" if new else "double"


def tree(path: Path, new: bool) -> None:
    """The least folder that is ours."""
    files: dict[str, str | bytes] = {"src/a.c": f"int a = {int(new)};\n", "b": b"\x00"}
    digests = {
        name: hashlib.sha256(each.encode() if isinstance(each, str) else each).hexdigest()
        for name, each in files.items()
    }
    write_package({**files, "manifest.json": json.dumps({"generator": GENERATOR, "files": digests})}, path)


#: name -> write(path, new): the old thing, or another.
FILES: dict[str, Write] = {
    "plan.npz": lambda path, new: plan(0.2 if new else 0.1).save(path),
    "plan.csv": lambda path, new: plan(0.2 if new else 0.1).to_csv(path),
    "plan.json": lambda path, new: plan(0.2 if new else 0.1).to_json(path),
    "group.npz": lambda path, new: lc.group("so3" if new else "se3").save(path),
    "kernel.npz": lambda path, new: lc.attitude_law("pd", inertia=[1, 2, 3], k_p=4, k_d=5 if new else 6).save(path),
    "library.npz": lambda path, new: lc.build("so3" if new else "so2").save(path),
    "page.html": lambda path, new: lc.view(plan(0.2 if new else 0.1), path),
}
FOLDERS: dict[str, Write] = {
    "tree": tree,
    "kernels": lambda path, new: lc.generate("so2", path, real=_real(new)),
    "plan": lambda path, new: lc.generate(plan(0.1), path, real=_real(new)),
    "solver": lambda path, new: lc.generate("so2", path, steering=True, real=_real(new)),
    "controller": lambda path, new: lc.generate(controller(), path, real=_real(new)),
    "unit": lambda path, new: lc.generate("so2", path, target="fmu", name="changed" if new else None),
    "crate": lambda path, new: lc.generate("so2", path, target="rust", real=_real(new)),
}
if importlib.util.find_spec("ziglang") is not None:  # compiled anew at each write
    FILES["solved.html"] = lambda path, new: lc.view(optimal(0.2 if new else 0.1), path, solve=True)
    FOLDERS["module"] = lambda path, new: lc.generate("so2", path, target="wasm", name="changed" if new else None)
SUBJECTS = {**FILES, **FOLDERS}


def snapshot(path: Path) -> Any:
    """All that stands there, byte for byte."""
    if path.is_dir():
        return {str(each.relative_to(path)): each.read_bytes() for each in sorted(path.rglob("*")) if each.is_file()}
    return path.read_bytes() if path.exists() else None


@contextlib.contextmanager
def watched(seen: Callable[[str], None]) -> Iterator[None]:
    """Every call of a point is told first."""
    kept = {point: getattr(home, name) for point, (home, name) in POINTS.items()}

    def telling(point: str) -> Callable[..., Any]:
        def call(*args: Any, **named: Any) -> Any:
            seen(point)
            return kept[point](*args, **named)

        return call

    for point, (home, name) in POINTS.items():
        setattr(home, name, telling(point))
    try:
        yield
    finally:
        for point, (home, name) in POINTS.items():
            setattr(home, name, kept[point])


def faults(write: Write, folder: Path) -> list[tuple[str, str, int]]:
    """Everything that can go wrong in a write over an older thing: (point, kind, number of the call or size of the file)."""
    calls: dict[str, int] = dict.fromkeys(POINTS, 0)

    def count(point: str) -> None:
        calls[point] += 1

    write(folder, False)
    with watched(count):
        write(folder, True)
    found = [(point, kind, k) for point, times in calls.items() for kind in KINDS for k in range(1, times + 1)]
    return [*found, *(("size", "full", size) for size in SIZES)]


def disturbed(write: Write, path: Path, point: str, kind: str, number: int) -> int:
    """The status of a process in which one thing goes wrong: 0 for success, negative for a signal."""
    child = os.fork()
    if child == 0:
        status = OTHER
        try:
            status = _in_child(write, path, point, kind, number)
        finally:
            os._exit(status)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def _in_child(write: Write, path: Path, point: str, kind: str, number: int) -> int:
    left = [number]

    def fail(passed: str) -> None:
        left[0] -= passed == point
        if passed == point and left[0] == 0:
            if (error := KINDS[kind]) is not None:
                raise error
            os.kill(os.getpid(), signal.SIGKILL)

    if point == "size":
        resource.setrlimit(resource.RLIMIT_FSIZE, (number, resource.RLIM_INFINITY))
    try:
        with watched(fail):
            write(path, True)
    except LieCodegenError:
        return OURS
    return 0


def look(name: str, home: Path, point: str, kind: str, number: int) -> list[str]:
    """What is wrong after one fault in one write."""
    write, found = SUBJECTS[name], []
    about = f"{name}, {point} {number} {kind}"
    path = home / name
    write(path, False)
    old = snapshot(path)
    status = disturbed(write, path, point, kind, number)
    after = snapshot(path)
    beside = sorted(each.name for each in home.iterdir() if each != path)
    killed = kind == "killed" and status == -signal.SIGKILL
    if status not in (0, OURS) and not killed:
        found.append(f"{about}: status {status}")
    if beside and not killed:
        found.append(f"{about}: {beside} left beside it")
    write(path, True)
    new = snapshot(path)
    if after not in (None, old, new) or (status == 0 and after != new):
        found.append(f"{about}: neither the old one nor the new one")
    if new == old:
        found.append(f"{about}: nothing changed")
    return found


def hunt(names: tuple[str, ...] = tuple(SUBJECTS), most: int | None = None, seed: int = 0) -> tuple[int, list[str]]:
    """(faults, finds): every fault of the writes of these names, or as many of each, chosen at random."""
    rng, tried, found = random.Random(seed), 0, []
    for name in names:
        with tempfile.TemporaryDirectory(prefix="hunt-") as folder:
            every = faults(SUBJECTS[name], Path(folder) / name)
        for fault in every if most is None else rng.sample(every, min(most, len(every))):
            with tempfile.TemporaryDirectory(prefix="hunt-") as folder:
                found += look(name, Path(folder), *fault)
                tried += 1
    return tried, found
