"""lie-codegen bench --against: two commits in turn, in one run, row by row; what got slower, and plans that got dearer.

Both checkouts run in processes of their own and are timed A, B, B, A, ..., a few milliseconds each, so that what else the machine does
meets both alike; of each process the least time counts, since nothing makes a program faster than it is. How a process lies in memory is
luck of its own, and the length of its environment, which moves the stack, is part of it (Mytkowicz et al. 2009): the same machine code took 1.08 of
its time in all pairs of one run and .89 in another. So there are several pairs of processes, each with an environment of a length of its own, and
a row is slower only where it is in every pair.
"""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lie_codegen.errors import InputError

_ROOT = Path(__file__).parents[2]
_ROWS = Path(__file__).with_name("commit_rows.py")
#: Pairs of processes; seconds that are timed at once; a row slower by more than this in every pair is said, a cost higher by more too.
PAIRS, _LEAST, SLOWER, _DEARER = 3, 4e-3, 1.05, 1e-3
#: After so many measurements of each side a row that has taken so many seconds is done.
_FEWEST, _PATIENCE = 6, 2.0


@dataclass(frozen=True)
class CommitRow:
    """One row of two commits.

    Attributes:
        name: of the row.
        ours, theirs: seconds of a call, the least of all.
        ratios: ours over theirs, one of each pair of processes.
        cost, their_cost: of a plan, the last one's; None of what is none.
        note: why there are no numbers.
    """

    name: str
    ours: float = float("nan")
    theirs: float = float("nan")
    ratios: tuple[float, ...] = ()
    cost: float | None = None
    their_cost: float | None = None
    note: str = ""

    @property
    def slower(self) -> bool:
        """In every pair of processes."""
        return bool(self.ratios) and min(self.ratios) > SLOWER

    @property
    def dearer(self) -> bool:
        """By more than a plan of the same minimum differs."""
        return None not in (self.cost, self.their_cost) and self.cost > self.their_cost * (1 + _DEARER)  # type: ignore[operator]


def bench_commits(
    against: str, rounds: int = 15, only: str = "", say: Callable[[str], None] = lambda text: None, pairs: int = PAIRS
) -> list[CommitRow]:
    """Every row of this checkout beside that of another commit.

    Args:
        against: a folder with a checkout, or a commit of the repository that this package lies in.
        rounds: of each pair, two measurements of each side in one.
        only: rows with this text in their names.
        say: is told what is going on.
        pairs: of processes, one after the other.

    Raises:
        InputError: neither a checkout nor a commit; no row has the text.
    """
    seen: dict[str, list[CommitRow]] = {}
    lengths = random.Random(against)
    with _checkout(against) as folder:
        for pair in range(pairs):
            sides = [_Side(root, only, lengths.randrange(4096)) for root in (_ROOT, folder)]
            try:
                if not sides[0].rows:
                    raise InputError(f"bench --against: no row has {only!r} in its name; see commit_rows.py")
                for name in sides[0].rows:
                    say(f"{pair + 1} of {pairs}: {name}")
                    seen.setdefault(name, []).append(_duel(name, sides, rounds))
            finally:
                for side in sides:
                    side.end()
    return [_joined(rows) for rows in seen.values()]


@contextmanager
def _checkout(against: str) -> Iterator[Path]:
    if (Path(against) / "lie_codegen" / "__init__.py").is_file():
        yield Path(against).resolve()
        return
    with tempfile.TemporaryDirectory(prefix="lie_codegen-commit-") as name, tempfile.TemporaryFile() as packed:
        command = [
            "git",
            "-C",
            str(_ROOT),
            "archive",
            "--format=tar",
            f"{against}^{{commit}}",
            "lie_codegen",
            "templates",
        ]
        try:
            done = subprocess.run(command, stdout=packed, stderr=subprocess.PIPE, check=False)
        except OSError:
            raise InputError("bench --against: there is no git here; give a folder with a checkout") from None
        if done.returncode:
            raise InputError(
                f"bench --against: {against!r} is neither a checkout of lie_codegen nor a commit of {_ROOT}"
            )
        packed.seek(0)
        with tarfile.open(fileobj=packed) as archive:
            archive.extractall(name, filter="data")
        yield Path(name)


class _Side:
    """A process with one of the checkouts."""

    def __init__(self, root: Path, only: str, padding: int) -> None:
        environment = {**os.environ, "PYTHONPATH": str(root), "PYTHONDONTWRITEBYTECODE": "1"}
        environment["LIE_CODEGEN_BENCH_PADDING"] = "-" * padding
        for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
            environment[threads] = "1"
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(_ROWS), only], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            text=True, env=environment, cwd=root,
        )  # fmt: skip
        self.rows: list[str] = self._answer().get("rows", [])

    def ask(self, name: str, count: int) -> dict[str, Any]:
        """One measurement."""
        if self._process.stdin is None:
            raise RuntimeError("a process without pipes")
        self._process.stdin.write(f"{name} {count}\n")
        self._process.stdin.flush()
        return self._answer()

    def _answer(self) -> dict[str, Any]:
        line = self._process.stdout.readline() if self._process.stdout else ""
        found: dict[str, Any] = json.loads(line) if line else {"absent": "the process ended"}
        return found

    def end(self) -> None:
        """No more rows."""
        if self._process.stdin:
            self._process.stdin.close()
        self._process.wait()


def _duel(name: str, sides: Sequence[_Side], rounds: int) -> CommitRow:
    """The least times of both, in turn."""
    first = [side.ask(name, 1) for side in sides]
    for answer, who in zip(first, ("this checkout", "the other"), strict=True):
        if "absent" in answer:
            return CommitRow(name, note=f"{who}: {answer['absent']}")
    count = max(1, min(10_000, int(_LEAST / max(1e-9, min(answer["seconds"] for answer in first)))))
    least, costs, spent = [float("inf")] * 2, [answer["cost"] for answer in first], 0.0
    for number in range(2 * rounds):
        if number >= _FEWEST and spent > _PATIENCE:
            break
        for which in (0, 1) if number % 2 == 0 else (1, 0):
            answer = sides[which].ask(name, count)
            if "absent" in answer:
                return CommitRow(name, note=answer["absent"])
            least[which], costs[which] = min(least[which], answer["seconds"]), answer["cost"]
            spent += count * answer["seconds"]
    return CommitRow(name, least[0], least[1], (least[0] / least[1],), costs[0], costs[1])


def _joined(rows: Sequence[CommitRow]) -> CommitRow:
    """One row of the pairs."""
    for row in rows:
        if row.note:
            return row
    return CommitRow(
        rows[0].name, min(row.ours for row in rows), min(row.theirs for row in rows), tuple(row.ratios[0] for row in rows),
        rows[-1].cost, rows[-1].their_cost,
    )  # fmt: skip


def worse(rows: Sequence[CommitRow]) -> list[str]:
    """What got slower in every pair, and plans that got dearer."""
    found = [
        f"{row.name}: {min(row.ratios):.3f} to {max(row.ratios):.3f} times the other's time"
        for row in rows
        if row.slower
    ]
    return found + [
        f"{row.name}: its cost is {row.cost:.6g}, the other's {row.their_cost:.6g}" for row in rows if row.dearer
    ]


def table(rows: Sequence[CommitRow], misses: Sequence[str]) -> str:
    """The rows as text."""
    lines = [f"{'row':44} {'us here':>12} {'us there':>12} {'here / there, each pair':>26} {'cost, there':>24}"]
    for row in rows:
        if row.note:
            lines.append(f"{row.name:44} -  {row.note}")
            continue
        ratios = " ".join(f"{each:.3f}" for each in row.ratios)
        cost = f"{row.cost:.6g}, {row.their_cost:.6g}" if row.cost is not None and row.their_cost is not None else ""
        lines.append(f"{row.name:44} {1e6 * row.ours:12.3f} {1e6 * row.theirs:12.3f} {ratios:>26} {cost:>24}")
    return "\n".join([*lines, *(f"worse: {text}" for text in misses)])
