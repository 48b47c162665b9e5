"""Studies whose store meets faults: what is called done is right, and going on gives what an undisturbed study gives, all of it."""

from __future__ import annotations

import random
import signal
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import lie_codegen as lc
from lie_codegen.arrays import Array
from lie_codegen.errors import LieCodegenError
from tests.hunt import torn

N, CHUNK = 60, 10


def squares(x: Array) -> dict[str, Array]:
    """What is studied."""
    return {"square": x**2, "pair": np.stack([x, -x], axis=1)}


def study(store: Path | None) -> Any:
    """It, from the beginning or gone on with."""
    return lc.study(squares, {"x": lc.studies.Normal(0.0, 1.0)}, n=N, seed=7, store=store, chunk=CHUNK, progress=False)


def write(store: Path, new: bool) -> None:
    """For `torn.disturbed`."""
    study(store)


def wrong(store: Path, expected: Any) -> list[str]:
    """What is wrong with a store that a study was interrupted in, before and after going on."""
    found = []
    if store.exists():
        try:
            half = lc.studies.open_study(store)
            for k in np.flatnonzero(half._store.done() == 1):
                part = slice(k * CHUNK, (k + 1) * CHUNK)
                if not np.array_equal(half["square"][part], expected["square"][part]):
                    found.append(f"chunk {k} is called done and is not")
        except LieCodegenError as error:
            found.append(f"the store does not open: {error}")
    whole = study(store)
    for name in ("x", "square", "pair", "status"):
        if not np.array_equal(whole[name], expected[name]):
            found.append(f"{name} differs after going on")
    return found


def calls(store: Path) -> dict[str, int]:
    """How often each point is passed in a whole study."""
    seen = dict.fromkeys(torn.POINTS, 0)

    def count(point: str) -> None:
        seen[point] += 1

    with torn.watched(count):
        study(store)
    return seen


def hunt(most: int, seed: int = 0) -> tuple[int, list[str]]:
    """(faults, finds): so many faults, one a study."""
    rng, found = random.Random(seed), []
    expected = study(None)
    with tempfile.TemporaryDirectory(prefix="hunt-") as folder:
        home = Path(folder)
        every = [
            (point, kind, k)
            for point, times in calls(home / "counted").items()
            for kind in torn.KINDS
            for k in range(1, times + 1)
        ]
        every += [("size", "full", size) for size in (0, 50, 500)]
        chosen = rng.sample(every, min(most, len(every)))
        for number, (point, kind, k) in enumerate(chosen):
            store = home / f"study{number}"
            status = torn.disturbed(write, store, point, kind, k)
            about = f"{point} {k} {kind}"
            if status not in (0, torn.OURS) and not (kind == "killed" and status == -signal.SIGKILL):
                found.append(f"{about}: status {status}")
            found += [f"{about}: {each}" for each in wrong(store, expected)]
    return len(chosen), found
