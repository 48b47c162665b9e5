"""lie-codegen bench propagate: driven qubits, chains, long runs and loops against general solvers, error beside every time.

Every tool works in a process of its own and is told in turn to run; the time is the processor's, of all its threads. What it computed
is compared with a stored row first; a ratio is given only where the other's error is at least a third of ours, since time
bought with error is no gain.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import IO, Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.benchmarks.propagate_cases import Case, chain_case
from lie_codegen.benchmarks.propagate_ours import own_rows
from lie_codegen.benchmarks.propagate_peers import TOOLS
from lie_codegen.benchmarks.propagate_targets import COUNTS, target_rows

#: (qubits, members, tolerances).
CASES = ((1, 1, (1e-6, 1e-9, 1e-12)), (1, 1000, (1e-10,)), (2, 1, (1e-6, 1e-9, 1e-12)), (3, 1, (1e-6, 1e-9, 1e-12)))
#: (system, tolerance, tool, at least so many times our time).
RATIOS = (
    ("qubit", 1e-12, "scipy DOP853", 200.0),
    ("qubit", 1e-12, "heyoka", 1.0),
    ("1000 qubits", 1e-10, "heyoka", 1.0),
    *((f"{count:,} exp of SE(3)", 1e-14, "into out=", 1 / 1.3) for count in COUNTS),
    (f"{COUNTS[-1]:,} exp of SE(3)", 1e-14, "bytes moved", 0.8),
)
#: (system, tolerance, at most so many ms of our processor time).
LIMITS = (
    ("qubit", 1e-12, 0.05),
    ("1000 qubits", 1e-10, 12.0),
    ("two qubits", 1e-12, 0.6),
    ("three qubits", 1e-12, 3.0),
    ("so3, T = 5e4", 1e-11, 300.0),
    ("PD loop", 1e-10, 3.0),
    ("PD loop, another inertia", 1e-10, 5.0),
    ("10,000 PD loops, 500 steps", 1e-6, 1000.0),
    ("a process to a law", 0.0, 300.0),
    ("a process to a plan", 0.0, 400.0),
    ("a process to a run", 0.0, 250.0),
)
#: An error far above what was asked for is no result; ours is held to this many times the tolerance.
_SLACK, _PEER_SLACK = 10.0, 1e4
#: Rounds, the least that is timed at once, and when a tool is not asked again: seconds.
_ROUNDS, _LEAST, _PATIENCE = 7, 2e-3, 2.0


@dataclass(frozen=True)
class PropagateRow:
    """One way to one result.

    Attributes:
        what: the system.
        who: the tool.
        rtol: the tolerance asked for.
        seconds: processor time of a call, the least of several; NaN where the tool took no part.
        error: against the stored value.
        build: processor time of the first call less that of a later one.
        ratio: to our time, where the errors allow it.
        note: why there are no numbers.
    """

    what: str
    who: str
    rtol: float
    seconds: float
    error: float
    build: float
    ratio: float = float("nan")
    note: str = ""


def bench_propagate(
    say: Callable[[str], None] = lambda text: None,
    *,
    cases: Sequence[tuple[int, int, tuple[float, ...]]] = CASES,
    tools: Sequence[str] = tuple(TOOLS),
    own: bool = True,
) -> tuple[list[PropagateRow], list[str]]:
    """The rows, and the stated ratios and limits that were missed.

    Args:
        say: is told what is going on.
        cases: (qubits, members, tolerances).
        tools: names of `TOOLS`, ours first.
        own: whether to run the systems that have no linear form: long runs and loops.
    """
    rows: list[PropagateRow] = []
    for qubits, members, tolerances in cases:
        case = chain_case(qubits, members)
        for rtol in tolerances:
            say(f"{case.name}, {rtol:g}")
            rows += _with_ratios(_compete(case, rtol, tools))
    if own:
        rows += [PropagateRow(*row) for row in own_rows(say)]
        rows += [PropagateRow(*row) for row in target_rows(say)]
    return rows, missed(rows)


class _Tool:
    """A process that runs a case when it is told to."""

    def __init__(self, name: str, case: Case, rtol: float) -> None:
        command = [sys.executable, "-m", "lie_codegen.benchmarks.propagate_peers", name, f"{case.qubits}"]
        self.name = name
        self._process = subprocess.Popen(
            [*command, f"{len(case.scales)}", repr(rtol)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )  # fmt: skip
        self.seconds, self.spent = float("inf"), 0.0
        line = _pipe(self._process.stdout).readline()
        answer: dict[str, Any] = json.loads(line) if line else {"absent": "the process ended"}
        self.absent: str = answer.get("absent", "")
        self.rows = np.empty(0) if self.absent else np.array(answer["re"]) + 1j * np.array(answer["im"])
        self.first = float(answer.get("first", "nan"))

    def run(self) -> None:
        """One round: often enough to be measured."""
        count = 1 if not np.isfinite(self.seconds) else int(np.clip(_LEAST / self.seconds, 1, 200))
        _pipe(self._process.stdin).write(f"{count}\n")
        _pipe(self._process.stdin).flush()
        line = _pipe(self._process.stdout).readline()
        if line:
            seconds = float(json.loads(line)["seconds"])
            self.seconds, self.spent = min(self.seconds, seconds), self.spent + count * seconds

    def end(self) -> None:
        """No more rounds."""
        _pipe(self._process.stdin).close()
        self._process.wait()


def _pipe(pipe: IO[str] | None) -> IO[str]:
    if pipe is None:
        raise RuntimeError("a process without pipes")
    return pipe


def _compete(case: Case, rtol: float, names: Sequence[str]) -> list[PropagateRow]:
    tools = [_Tool(name, case, rtol) for name in names]
    try:
        taking = [tool for tool in tools if not tool.absent]
        wanted = taking[0].rows if taking else np.empty(0)
        errors = {tool.name: _error(case, tool.rows, wanted) for tool in taking}
        taking = [tool for tool in taking if errors[tool.name] <= max(_PEER_SLACK * rtol, 1e-9)]
        for _ in range(_ROUNDS):
            for tool in taking:
                if tool.spent < _PATIENCE:
                    tool.run()
    finally:
        for tool in tools:
            tool.end()
    return [
        PropagateRow(
            case.name, tool.name, rtol, tool.seconds if np.isfinite(tool.seconds) else float("nan"),
            errors.get(tool.name, float("nan")), max(0.0, tool.first - tool.seconds) if tool in taking else float("nan"),
            note=tool.absent or ("" if tool in taking else "computes something else"),
        )
        for tool in tools
    ]  # fmt: skip


def _error(case: Case, rows: Array, ours: Array) -> float:
    """Of the member whose row is stored; and how far the others are from ours."""
    stored = float(np.max(np.abs(rows[case.stored][0] - case.row)))
    return max(stored, float(np.max(np.abs(rows - ours)))) if rows.shape == ours.shape else float("inf")


def _with_ratios(rows: Sequence[PropagateRow]) -> list[PropagateRow]:
    """Times over ours where the other's error is not less than a third of ours."""
    mine = rows[0]
    return [
        replace(row, ratio=row.seconds / mine.seconds) if row is not mine and mine.error <= 3 * max(row.error, 1e-13) else row
        for row in rows
    ]  # fmt: skip


def missed(rows: Sequence[PropagateRow]) -> list[str]:
    """What was stated and does not hold: errors, limits of time, ratios to tools that took part."""
    found = []
    for row in rows:
        if row.who == "lie_codegen" and not row.error <= _SLACK * row.rtol:
            found.append(f"{row.what} at {row.rtol:g}: the error is {row.error:.2g}")
    mine = {(row.what, row.rtol): row for row in rows if row.who == "lie_codegen"}
    for what, rtol, limit in LIMITS:
        own = mine.get((what, rtol))
        if own is not None and not 1e3 * own.seconds <= limit:
            found.append(f"{what} at {rtol:g}: {1e3 * own.seconds:.3g} ms, wanted {limit:g}")
    for what, rtol, who, least in RATIOS:
        for row in rows:
            if (row.what, row.rtol, row.who) == (what, rtol, who) and np.isfinite(row.ratio) and row.ratio < least:
                found.append(f"{what} at {rtol:g}: {who} takes {row.ratio:.3g} times our time, wanted {least:g}")
    return found


def table(rows: Sequence[PropagateRow], misses: Sequence[str]) -> str:
    """The rows as text."""
    lines = [f"{'system':28} {'tool':16} {'rtol':>7} {'ms':>11} {'error':>9} {'build ms':>9} {'/ ours':>9}"]
    for r in rows:
        if r.note:
            lines.append(f"{r.what:28} {r.who:16} {r.rtol:7.0e} -  {r.note}")
            continue
        ratio = f"{r.ratio:9.3g}" if np.isfinite(r.ratio) else f"{'':9}"
        lines.append(
            f"{r.what:28} {r.who:16} {r.rtol:7.0e} {1e3 * r.seconds:11.4f} {r.error:9.1e} {1e3 * r.build:9.1f} {ratio}"
        )
    return "\n".join([*lines, *(f"missed: {text}" for text in misses)])
