"""lie-codegen bench propagate: driven qubits, chains, long runs and loops against general solvers, error beside every time.

Every tool works in a process of its own and is told in turn to run; the time is the processor's, of all its threads. What it computed
is compared with a stored value first; a ratio is given only where the faster errs at most three times as much as the slower, since
time bought with error is no gain.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from lie_codegen.benchmarks import loop_peers, propagate_peers
from lie_codegen.benchmarks.loop_cases import loop_case
from lie_codegen.benchmarks.propagate_cases import chain_case
from lie_codegen.benchmarks.propagate_ours import own_rows
from lie_codegen.benchmarks.propagate_targets import COUNTS, target_rows
from lie_codegen.benchmarks.turns import ROUNDS, Case, Tool
from lie_codegen.errors import InputError

_TOLERANCES = (1e-6, 1e-9, 1e-12)
Contest = tuple[Case, Sequence[str], Sequence[float]]
#: What is computed, by which tools (ours first), and how exactly.
CONTESTS: tuple[Contest, ...] = (
    *((chain_case(qubits), tuple(propagate_peers.TOOLS), _TOLERANCES) for qubits in (1, 2, 3)),
    (chain_case(1, 1000), tuple(propagate_peers.TOOLS), (1e-10,)),
    (loop_case(), tuple(loop_peers.TOOLS), _TOLERANCES),
    (loop_case(10_000), tuple(loop_peers.TOOLS), (1e-8,)),
)
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
    ("PD loop", 1e-9, 3.0),
    ("PD loop, another inertia", 1e-10, 5.0),
    ("10,000 PD loops, 500 steps", 1e-6, 1000.0),
    ("a process to a law", 0.0, 300.0),
    ("a process to a plan", 0.0, 400.0),
    ("a process to a run", 0.0, 250.0),
)
#: An error far above what was asked for is no result; ours is held to this many times the tolerance.
_SLACK, _PEER_SLACK = 10.0, 1e4
#: Errors below it are as good as none.
_ROUNDING = 1e-13


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
    contests: Sequence[Contest] = CONTESTS,
    only: str = "",
    own: bool = True,
) -> tuple[list[PropagateRow], list[str]]:
    """The rows, and the stated ratios and limits that were missed.

    Args:
        say: is told what is going on.
        contests: systems with their tools and tolerances.
        only: keeps the systems with this text in their names, and leaves out the rest of ours.
        own: whether to run what has no peer: long runs, fixed steps, fresh processes and results.

    Raises:
        InputError: no system has the text in its name.
    """
    chosen = [contest for contest in contests if only.lower() in contest[0].name.lower()]
    if not chosen:
        names = ", ".join(case.name for case, _, _ in contests)
        raise InputError(f"bench propagate: no system has {only!r} in its name; they are {names}")
    rows: list[PropagateRow] = []
    for case, tools, tolerances in chosen:
        for rtol in tolerances:
            say(f"{case.name}, {rtol:g}")
            rows += with_ratios(_compete(case, rtol, tools))
    if own and not only:
        rows += [PropagateRow(*row) for row in own_rows(say)]
        rows += [PropagateRow(*row) for row in target_rows(say)]
    return rows, missed(rows)


def versions() -> dict[str, str]:
    """Of the tools that are installed."""
    found = {}
    for name in ("heyoka", "qutip", "dynamiqs", "diffrax", "jax", "scipy", "numba"):
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def _compete(case: Case, rtol: float, names: Sequence[str]) -> list[PropagateRow]:
    tools = [Tool(name, case, rtol) for name in names]
    try:
        taking = [tool for tool in tools if not tool.absent]
        wanted = taking[0].found if taking else np.empty(0)
        errors = {tool.name: case.error(tool.found, wanted) for tool in taking}
        taking = [tool for tool in taking if errors[tool.name] <= max(_PEER_SLACK * rtol, 1e-9)]
        for _ in range(ROUNDS):
            for tool in taking:
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


def with_ratios(rows: Sequence[PropagateRow]) -> list[PropagateRow]:
    """Times over ours, the first, where the faster of the two errs at most three times as much as the slower."""
    mine = rows[0]

    def fair(row: PropagateRow) -> bool:
        fast, slow = (row, mine) if row.seconds < mine.seconds else (mine, row)
        return fast.error <= 3 * max(slow.error, _ROUNDING)

    return [
        replace(row, ratio=row.seconds / mine.seconds) if row is not mine and not row.note and fair(row) else row
        for row in rows
    ]


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
