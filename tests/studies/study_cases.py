"""Studies that the tests run in several processes."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path
from typing import Any

import lie_codegen as lc

SPACE = {"a": lc.Normal(2.0, 0.5), "v": lc.Uniform([0, 1, 2], [1, 2, 3])}


def plain(a: Any, v: Any) -> dict[str, Any]:
    """A sample is known in closed form."""
    return {"sum": a + v.sum(axis=1), "square": v * v}


def slow(a: Any, v: Any) -> dict[str, Any]:
    time.sleep(0.02)
    return plain(a, v)


def killing(folder: str) -> Any:
    """As `plain`, but the first worker that comes to a certain chunk is killed there (a single sample is run by the driver)."""

    def run(a: Any, v: Any) -> dict[str, Any]:
        mark = Path(folder) / "killed"
        if len(a) > 1 and a[0] > 2 and not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return plain(a, v)

    return run


def tell(done: int, total: int) -> None:
    sys.stdout.write(f"{done}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    lc.study(slow, SPACE, n=2000, chunk=20, seed=5, store=sys.argv[1], progress=tell)
