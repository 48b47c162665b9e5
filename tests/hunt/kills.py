"""Kills at any moment of processes that work at once: on one cache with tiny limits, on saved files, on packages, on studies.

Nothing may be lost or half: a survivor's numbers are right, a file is one of those that were written, a package is what its manifest says, a
study gone on with gives all that an undisturbed one gives, and the cache is as fast as ever.
"""

from __future__ import annotations

import hashlib
import json
import random
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import lie_codegen as lc
from lie_codegen.errors import LieCodegenError
from tests.hunt import resumed, torn
from tests.hunt.faults import WORK, _environment, healthy

RIGHT = "[1.0, 2.0, 3.0]; 54.0;"
ENDLESS = """
import itertools, sys
from pathlib import Path
from tests.hunt import kills
home = Path(sys.argv[1])
print("ready", flush=True)
for k in itertools.count():
    kills.{work}(home, k)
"""
#: What each of eight processes does; those on the cache end by themselves.
ROLES = ("cache", "cache", "cache", "save", "save", "package", "package", "study")
SAVED = ("plan.npz", "plan.csv", "plan.json", "group.npz", "kernel.npz")
PACKAGES = ("kernels", "plan", "solver")


def save(home: Path, k: int) -> None:
    """Write every kind of file over the one before."""
    for name in SAVED:
        torn.FILES[name](home / name, bool(k % 2))


def package(home: Path, k: int) -> None:
    """Write every kind of package over the one before."""
    for name in PACKAGES:
        torn.FOLDERS[name](home / name, bool(k % 2))


def study(home: Path, k: int) -> None:
    """A study from where the last process was killed, then further ones."""
    resumed.study(home / f"study{k}")


def _started(role: str, home: Path, rng: random.Random) -> subprocess.Popen[bytes]:
    limit = rng.choice(["1", "100000", "1000000000"])
    code, folder = WORK.replace('"hunted"', f'"hunted {rng.randrange(3)}"'), home
    environment = _environment(home / "cache", LIE_CODEGEN_CACHE_LIMIT=limit)
    if role != "cache":  # what they build is not what is hunted here
        code, folder = ENDLESS.replace("{work}", role), Path(tempfile.mkdtemp(dir=home, prefix=f"{role}-"))
        environment = _environment(home / "beside")
    return subprocess.Popen(
        [sys.executable, "-c", code, str(folder)], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def hunt(count: int, seed: int = 0, longest: float = 8.0) -> tuple[int, list[str]]:
    """(kills, finds): eight processes at once, one after another killed, until so many are."""
    rng, found, killed = random.Random(seed), [], 0
    expected = resumed.study(None)
    with tempfile.TemporaryDirectory(prefix="hunt-") as folder:
        home = Path(folder)
        save(home, 0)  # the library and the laws are built once, undisturbed
        while killed < count:
            running = {_started(role, home, rng): role for role in ROLES}
            for each, role in running.items():
                if role != "cache" and each.stdout is not None:
                    each.stdout.readline()  # killed at work, not while Python begins
            for each, role in rng.sample(list(running.items()), len(running)):
                try:
                    each.wait(rng.uniform(0.0, longest / len(ROLES)))
                except subprocess.TimeoutExpired:
                    if killed < count or role != "cache":
                        each.kill()
            for each, role in running.items():
                out, err = each.communicate(timeout=600)
                killed += each.returncode == -9
                if each.returncode not in (0, -9) or (each.returncode == 0 and not out.decode().startswith(RIGHT)):
                    found.append(f"a survivor ({role}): status {each.returncode}, {out[-200:]!r}, {err[-500:]!r}")
            for place in sorted(home.glob("*-*")):
                found += [f"after {killed} kills: {each}" for each in _torn(place)]
                for store in sorted(place.glob("study*")):
                    found += [f"after {killed} kills: {each}" for each in resumed.wrong(store, expected)]
                shutil.rmtree(place)
        after = healthy(home / "cache")
        found += [f"after {killed} kills: {after}"] if after else []
    return killed, found


def _torn(home: Path) -> list[str]:
    """What of the files and packages of a folder is neither the one nor the other."""
    wrong = []
    for name in SAVED:
        path = home / name
        if path.exists():
            try:
                if _read(path) not in _both(name):
                    wrong.append(f"{name} is half written")
            except LieCodegenError as error:
                wrong.append(f"{name}: {error}")
    for name in PACKAGES:
        package = home / name
        if package.exists():
            listed = json.loads((package / "manifest.json").read_text(encoding="utf-8"))["files"]
            present = {str(each.relative_to(package)) for each in package.rglob("*") if each.is_file()}
            if present != {*listed, "manifest.json"}:
                wrong.append(f"{name} holds other files than its manifest says")
            wrong += [
                f"{name}/{file} is not what the manifest says"
                for file, digest in listed.items()
                if file in present and hashlib.sha256((package / file).read_bytes()).hexdigest() != digest
            ]
    return wrong


def _read(path: Path) -> Any:
    """What a file says; of results the values, for how long a plan took is another figure in every process."""
    return lc.load(path) if path.suffix == ".npz" else path.read_bytes()


def _both(name: str) -> list[Any]:
    """What a file says as each of the two writes leaves it."""
    with tempfile.TemporaryDirectory(prefix="hunt-") as folder:
        found = []
        for new in (False, True):
            torn.FILES[name](Path(folder) / name, new)
            found.append(_read(Path(folder) / name))
    return found
