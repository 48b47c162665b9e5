"""The hunt: `python -m tests.hunt [--scale N] [--write]` tries to break what SECURITY.md promises, prints a table, and with --write puts it there.

A scale of 1 takes half an hour of a processor, 10 is the slow job. The status is 1 if anything was found. Each part is a process of its own, as many at
once as there are processors (`--jobs`): one that is killed has found that, and what it limits or breaks is its own. Its row is kept as it ends: an interrupted
hunt has its figures, and `--resume` goes on with the parts that are not in the table at this scale and commit.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkProcess
from pathlib import Path

from tests.hunt import (
    faults,
    fuzz,
    generated_c,
    growth,
    hostile,
    kills,
    matrix,
    methods,
    off_manifold,
    resumed,
    rows,
    solver_arguments,
    texts,
    torn,
)

Part = Callable[[], tuple[int, list[str]]]
Ended = tuple[str, int, list[str], float]


def parts(scale: int, home: Path) -> dict[str, Part]:
    """What is hunted: (what, unit) -> the hunt."""
    found: dict[str, Part] = {"calls of the front door with one hostile argument": lambda: _calls(scale)}
    found["calls of methods of results with one hostile argument"] = lambda: methods.hunt(min(1.0, 0.1 * scale))
    for kind in texts.KINDS:
        found[f"{kind} by Hypothesis, after the corpus"] = lambda kind=kind: texts.hunt(kind, 100 * scale)
    found["targets and states off the group"] = lambda: off_manifold.hunt(8 * scale)
    if generated_c.has_sanitizers(home / "probe"):
        for group in ("so3", "se3", "su2"):
            for lanes in (False, True):
                found[
                    f"samples of every kernel of {group}, {'lanes' if lanes else 'one lane'}, under ASan and UBSan"
                ] = lambda group=group, lanes=lanes: generated_c.hunt(
                    home / f"{group}{lanes}", group, 10 * scale, lanes=lanes
                )
        found["calls of the C steering solver with unusable arguments, under ASan and UBSan"] = lambda: (
            solver_arguments.hunt(home / "solver")
        )
    if fuzz.has_fuzzer():
        for target in fuzz.TARGETS:
            found[f"inputs that libFuzzer makes for the C of {target}, under ASan and UBSan"] = lambda target=target: (
                fuzz.hunt(home / "fuzz" / target, target, 10 * scale)
            )
    if fuzz.has_atheris():
        for kind in fuzz.TEXTS:
            found[f"{kind} that atheris makes"] = lambda kind=kind: fuzz.hunt_texts(kind, 10 * scale)
    found["faults injected: n-th write, rename, fork, lock refused, full or killed"] = lambda: faults.hunt(12 * scale)
    found["faults in writing files and packages: each call refused, full, or killed"] = lambda: torn.hunt(
        most=2 * scale
    )
    found["faults in the store of a study that is gone on with"] = lambda: resumed.hunt(8 * scale)
    found["kills among eight processes: one cache with tiny limits, files, packages, studies"] = lambda: kills.hunt(
        20 * scale
    )
    found["calls of six kinds without growth of memory"] = lambda: growth.calls(1_000_000 * scale)
    found["planted and tampered files of the cache"] = lambda: faults.planted(home / "planted")
    found["cells of the matrix: packages by compilers, targets, sanitizers, analysers; plain C"] = lambda: matrix.hunt(
        home / "matrix", tell=sys.stdout.write
    )
    return found


def _calls(scale: int) -> tuple[int, list[str]]:
    with texts.limited_memory():
        return hostile.hunt(min(1.0, 0.03 * scale))


def hunted(part: Part) -> tuple[int, list[str]]:
    """What a part found; one that breaks has found that."""
    try:
        return part()
    except Exception:
        return 1, [traceback.format_exc()]


def at_once(every: dict[str, Part], jobs: int) -> Iterator[Ended]:
    """(what, tried, finds, seconds) of every part as it ends, so many processes at a time; what still runs is ended with the caller."""
    fork = multiprocessing.get_context("fork")  # the parts are closures, which fork hands on without pickling them
    waiting = list(every.items())
    running: dict[Connection, tuple[str, ForkProcess, float]] = {}
    try:
        while waiting or running:
            while waiting and len(running) < jobs:
                what, part = waiting.pop(0)
                reads, writes = fork.Pipe(duplex=False)
                process = fork.Process(target=_told, args=(part, writes))
                process.start()
                writes.close()  # the child's copy is the last one: its end is the end of the pipe, even where it was killed
                running[reads] = what, process, time.perf_counter()
            ready = wait(list(running))
            for reads in [each for each in running if each in ready]:
                what, process, began = running.pop(reads)
                try:
                    tried, found = reads.recv()
                except EOFError:
                    process.join()
                    tried, found = 1, [f"its process ended with status {process.exitcode}"]
                process.join()
                yield what, tried, found, time.perf_counter() - began
    finally:
        for _, process, _ in running.values():
            process.terminate()


def _told(part: Part, writes: Connection) -> None:
    writes.send(hunted(part))


def main() -> int:
    """Hunt, keep a row a part, print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scale", type=int, default=1)
    parser.add_argument("--only", default="", help="parts whose name holds this")
    parser.add_argument("--write", action="store_true", help="keep the rows in SECURITY.md")
    parser.add_argument("--rows", type=Path, help="keep the rows in this file instead, under the same two marks")
    parser.add_argument(
        "--resume", action="store_true", help="leave out the parts that have a row of this scale and commit"
    )
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)), help="parts at once")
    asked = parser.parse_args()
    page = asked.rows or (rows.PAGE if asked.write else None)
    had = rows.read(page) if page else []
    new: list[rows.Row] = []
    with tempfile.TemporaryDirectory(prefix="hunt-") as folder:
        every = parts(asked.scale, Path(folder))
        commit = rows.commit()
        kept = {row.hunted for row in had if asked.resume and (row.scale, row.commit) == (asked.scale, commit)}
        took = {row.hunted: row.seconds for row in had}
        # The longest first, so that none is left alone at the end.
        left = sorted(
            (what for what in every if asked.only in what and what not in kept), key=lambda what: -took.get(what, 0)
        )
        for what, tried, found, seconds in at_once({what: every[what] for what in left}, asked.jobs):
            new.append(rows.Row(what, asked.scale, commit, tried, len(found), round(seconds)))
            print(f"{what}: {tried:,} tried, {len(found)} found", *found, sep="\n", flush=True)  # noqa: T201
            if page:
                rows.write(page, rows.joined(had, new, list(every)))
    print(rows.table(rows.joined(had, new, list(every))))  # noqa: T201
    return 1 if any(row.found for row in new) else 0


if __name__ == "__main__":
    sys.exit(main())
