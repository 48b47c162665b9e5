"""Fault injection: in a process of its own the n-th write, rename, fork or run of the compiler fails, fills the disk, or ends the process.

Afterwards a healthy process on the same cache must give the same numbers at full speed: calls through the extension type, batches on lanes,
no scratch folder left behind that is young, nothing damaged.
"""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
POINTS = ("write", "rename", "fork", "mkdir", "lock")
KINDS = ("refused", "full", "killed")

WORK = """
import warnings
warnings.simplefilter("ignore")
import toy_kernels
from lie_codegen.runtime.build import build_kernels
library = build_kernels(lambda: [toy_kernels.RATE], namespace="toy", definition="hunted")
print(library.rate([0, 0, 0], [1, 2, 3]).tolist(), library.rate.batch([[0, 0, 0]] * 9, [1, 2, 3]).sum(), *library.build_log[:2], sep="; ")
"""
INJECT = """
import os, signal, sys, tempfile, subprocess
point, kind, number = sys.argv[1], sys.argv[2], int(sys.argv[3])
import filelock
def faulty(real):
    def call(*args, **named):
        global number
        number -= 1
        if number == 0:
            if kind == "killed":
                os.kill(os.getpid(), signal.SIGKILL)
            raise OSError(28, "No space left on device") if kind == "full" else PermissionError(13, "Permission denied")
        return real(*args, **named)
    return call
if point == "write":
    tempfile.mkstemp = faulty(tempfile.mkstemp)
elif point == "rename":
    os.replace = faulty(os.replace)
elif point == "mkdir":
    tempfile.mkdtemp = faulty(tempfile.mkdtemp)
elif point == "lock":
    filelock.FileLock.acquire = faulty(filelock.FileLock.acquire)
else:
    subprocess.Popen.__init__ = faulty(subprocess.Popen.__init__)
"""
#: What a healthy process prints: the numbers, and how calls and batches go.
FAST = ("[1.0, 2.0, 3.0]", "54.0", "calls: through the extension type")


def _environment(cache: Path, **more: str) -> dict[str, str]:
    path = os.pathsep.join((str(ROOT), str(ROOT / "tests")))
    return {**os.environ, "PYTHONPATH": path, "LIE_CODEGEN_CACHE": str(cache), "OMP_NUM_THREADS": "1", **more}


def healthy(cache: Path, **more: str) -> str | None:
    """What is wrong with a process that nobody disturbs; None if it is right and fast."""
    done = subprocess.run(
        [sys.executable, "-c", WORK],
        env=_environment(cache, **more),
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    parts = done.stdout.strip().split("; ")
    if done.returncode or len(parts) != 4:
        return f"status {done.returncode}: {done.stderr[-500:]}"
    lanes = int(parts[2].split()[1])
    return None if (parts[0], parts[1], parts[3]) == FAST and lanes > 1 else f"slow or wrong: {parts}"


def inject(cache: Path, point: str, kind: str, number: int) -> str | None:
    """What is wrong with a process in which one thing fails: it may be slow, end by our errors, or be killed, nothing else."""
    command = [sys.executable, "-c", INJECT + WORK, point, kind, str(number)]
    done = subprocess.run(command, env=_environment(cache), capture_output=True, text=True, check=False, timeout=300)
    if done.returncode == 0:
        right = done.stdout.startswith("[1.0, 2.0, 3.0]; 54.0;")
        return None if right else f"{point} {kind} {number}: {done.stdout[-300:]}"
    if kind == "killed" and done.returncode == -9:
        return None
    last = (done.stderr.strip().splitlines() or ["nothing said"])[-1]
    return None if last.startswith("lie_codegen.errors.") else f"{point} {kind} {number}: {last}"


def hunt(count: int, seed: int = 0) -> tuple[int, list[str]]:
    """(faults injected, finds): each on a cache that earlier faults have worked on."""
    rng = random.Random(seed)
    found = []
    with tempfile.TemporaryDirectory(prefix="hunt-") as home:
        cache = Path(home) / "cache"
        for k in range(count):
            point, kind, number = rng.choice(POINTS), rng.choice(KINDS), rng.randint(1, 4)
            if k % 4 == 0:  # a cold start now and then: most points are passed in it
                cache = Path(home) / f"cache{k}"
            wrong = inject(cache, point, kind, number)
            found += [wrong] if wrong else []
            if k % 4 == 3 or k == count - 1:
                after = healthy(cache)
                found += [f"after {point} {kind} {number}: {after}"] if after else []
    return count, found


def planted(folder: Path) -> tuple[int, list[str]]:
    """(tampered entries, finds): whatever is changed in an entry or a request, nothing of it is loaded, and numbers are right."""
    found: list[str] = []
    cache = folder / "cache"
    if wrong := healthy(cache):
        return 0, [wrong]
    files = sorted(path for path in cache.rglob("*") if path.is_file() and path.suffix in (".so", ".json"))
    for file in files:
        kept = file.read_bytes()
        for change in ("flipped", "empty", "other", "link"):
            file.unlink(missing_ok=True)
            if change == "flipped":
                middle = len(kept) // 2
                file.write_bytes(kept[:middle] + bytes([kept[middle] ^ 1]) + kept[middle + 1 :])
            elif change == "empty":
                file.write_bytes(b"")
            elif change == "other":
                file.write_text(
                    json.dumps({"file": "../../../../../../bin/true", "sha256": "0" * 64, "entry": "f" * 64})
                )
            else:
                file.symlink_to("/dev/null")
            wrong = healthy(cache)
            if wrong and "[1.0, 2.0, 3.0]', '54.0'" in wrong:
                wrong = healthy(cache)  # slow once, with a warning; the next process is fast again
            found += [f"{file.name} {change}: {wrong}"] if wrong else []
            file.unlink(missing_ok=True)
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(kept)
    return 4 * len(files), found
