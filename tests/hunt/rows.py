"""The table of the hunt: a row a part, kept in a file between two marks."""

from __future__ import annotations

import platform
import subprocess
from collections.abc import Sequence
from dataclasses import astuple, dataclass
from pathlib import Path

PAGE = Path(__file__).resolve().parents[2] / "SECURITY.md"
BEGIN, END = "<!-- hunt: begin -->", "<!-- hunt: end -->"
_HEAD = "| hunted | scale | commit | tried | found | seconds |\n|---|---|---|---|---|---|"


@dataclass(frozen=True)
class Row:
    """What one part of a hunt did: how large it was, on which commit, how much was tried and found, how long it took."""

    hunted: str
    scale: int
    commit: str
    tried: int
    found: int
    seconds: int


def table(rows: Sequence[Row]) -> str:
    """The figures as Markdown."""
    return "\n".join((_HEAD, *(f"| {' | '.join(_cell(each) for each in astuple(row))} |" for row in rows)))


def _cell(value: str | int) -> str:
    return value if isinstance(value, str) else f"{value:,}"


def parsed(text: str) -> list[Row]:
    """The rows of `table`."""
    lines = [line for line in text.splitlines() if line.startswith("| ")][1:]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return [
        Row(what, int(scale), commit, *(int(each.replace(",", "")) for each in numbers))
        for what, scale, commit, *numbers in cells
    ]


def read(page: Path) -> list[Row]:
    """The rows between the marks of a file; none where there is no such file."""
    return parsed(_parts(page)[1]) if page.exists() else []


def write(page: Path, rows: Sequence[Row]) -> None:
    """Put the rows between the marks of a file; the rest of it stays."""
    head, _, tail = _parts(page)
    about = f"Python {platform.python_version()}, {platform.system()} {platform.machine()}."
    page.write_text(f"{head}{BEGIN}\n{about}\n\n{table(rows)}\n{END}{tail}", encoding="utf-8")


def _parts(page: Path) -> tuple[str, str, str]:
    text = page.read_text(encoding="utf-8") if page.exists() else ""
    head, _, rest = text.partition(BEGIN)
    figures, _, tail = rest.partition(END)
    return head, figures, tail


def joined(old: Sequence[Row], new: Sequence[Row], order: Sequence[str]) -> list[Row]:
    """The rows of parts that there are, the new one of each where it was hunted again."""
    rows = {row.hunted: row for row in (*old, *new)}
    return [rows[what] for what in order if what in rows]


def commit() -> str:
    """What is hunted; "unknown" outside a checkout."""
    done = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=PAGE.parent, capture_output=True, text=True, check=False
    )
    return done.stdout.strip() or "unknown"
