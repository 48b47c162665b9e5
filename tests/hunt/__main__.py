"""The hunt: `python -m tests.hunt [--scale N] [--write]` tries to break what SECURITY.md promises, prints a table, and with --write puts it there.

A scale of 1 takes some minutes, 10 is the slow job (under two hours on two cores). The status is 1 if anything was found.
"""

from __future__ import annotations

import argparse
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from tests.hunt import (
    analysers,
    faults,
    fuzz,
    generated_c,
    growth,
    hostile,
    methods,
    off_manifold,
    solver_arguments,
    texts,
    warnings_matrix,
)

PAGE = Path(__file__).resolve().parents[2] / "SECURITY.md"
BEGIN, END = "<!-- hunt: begin -->", "<!-- hunt: end -->"
Part = Callable[[], tuple[int, list[str]]]


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
    found["kills among eight processes on one cache with tiny limits"] = lambda: faults.kills(20 * scale)
    found["kills of processes that write a package and a plan"] = lambda: growth.torn_writes(20 * scale)
    found["calls of six kinds without growth of memory"] = lambda: growth.calls(1_000_000 * scale)
    found["planted and tampered files of the cache"] = lambda: faults.planted(home / "planted")
    found["strict compilations: compilers, float, one lane, foreign targets"] = lambda: warnings_matrix.hunt(
        home / "matrix"
    )
    found[f"packages under {', '.join(analysers.tools())} (with sanitizers)"] = lambda: analysers.hunt(
        home / "analysed"
    )
    return found


def _calls(scale: int) -> tuple[int, list[str]]:
    with texts.limited_memory():
        return hostile.hunt(min(1.0, 0.03 * scale))


def table(rows: list[tuple[str, int, int, float]]) -> str:
    """The figures as Markdown."""
    lines = ["| hunted | tried | found | seconds |", "|---|---|---|---|"]
    lines += [f"| {what} | {tried:,} | {found} | {seconds:.0f} |" for what, tried, found, seconds in rows]
    return "\n".join(lines)


def read_table(text: str) -> list[tuple[str, int, int, float]]:
    """The figures of `table`."""
    cells = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("| ")
    ]
    return [
        (what, int(tried.replace(",", "")), int(found), float(seconds)) for what, tried, found, seconds in cells[1:]
    ]


def joined(
    old: list[tuple[str, int, int, float]], new: list[tuple[str, int, int, float]], order: list[str]
) -> list[tuple[str, int, int, float]]:
    """The rows of parts that there are, the new one of each where it was hunted again."""
    rows = {row[0]: row for row in (*old, *new)}
    return [rows[what] for what in order if what in rows]


def main() -> int:
    """Hunt, print, and write if asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scale", type=int, default=1)
    parser.add_argument("--only", default="", help="parts whose name holds this; the others keep their rows")
    parser.add_argument("--write", action="store_true", help="put the table into SECURITY.md")
    asked = parser.parse_args()
    rows, finds = [], []
    with tempfile.TemporaryDirectory(prefix="hunt-") as folder:
        every = parts(asked.scale, Path(folder))
        for what, part in every.items():
            if asked.only in what:
                began = time.perf_counter()
                tried, found = part()
                rows.append((what, tried, len(found), time.perf_counter() - began))
                finds += found
                print(f"{what}: {tried:,} tried, {len(found)} found", *found, sep="\n", flush=True)  # noqa: T201
    print(table(rows))  # noqa: T201
    if asked.write:
        head, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
        before, _, tail = rest.partition(END)
        text = table(joined(read_table(before), rows, list(every)) if asked.only else rows)
        commit = subprocess.run(
            ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False
        ).stdout.strip()
        about = f"Scale {asked.scale}, commit {commit or 'unknown'}, Python {platform.python_version()}, {platform.system()} {platform.machine()}."
        PAGE.write_text(f"{head}{BEGIN}\n{about}\n\n{text}\n{END}{tail}", encoding="utf-8")
    return 1 if finds else 0


if __name__ == "__main__":
    sys.exit(main())
