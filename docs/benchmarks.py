"""The propagation tables of reference/benchmarks.md from the results that are kept: `python docs/benchmarks.py` writes them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

from lie_codegen.gallery.propagation_speed import RECORD

PAGE = Path(__file__).parent / "reference" / "benchmarks.md"
BEGIN, END = "<!-- propagation -->\n", "<!-- end of propagation -->"
#: Heading of a column -> the system of the benchmark.
_EXACT = {"one qubit": "qubit", "two qubits": "two qubits", "three qubits": "three qubits", "attitude loop": "PD loop"}
_MANY = {"1,000 qubits to 1e-10": "1000 qubits", "10,000 attitude loops to 1e-8": "10,000 PD loops"}
_NAMES = {"lie_codegen": "lie_codegen", "qutip vern9": "QuTiP, vern9", "dynamiqs Dopri8": "dynamiqs, Dopri8", "diffrax Dopri8": "diffrax, Dopri8"}  # fmt: skip


def tables(record: Mapping[str, Any]) -> str:
    """Where it was measured, time and error of every tool on every system, what only we do, and what was missed."""
    rows = record["rows"]
    tools = list(dict.fromkeys(row["who"] for row in rows if row["what"] == "qubit"))
    took = ", ".join(f"{name} {version}" for name, version in record["versions"].items())
    alone = [
        row for row in rows if row["who"] == "lie_codegen" and row["what"] not in {*_EXACT.values(), *_MANY.values()}
    ]
    lines = [f"{record['machine']}; {took}.", ""]
    for columns in (_EXACT, _MANY):
        lines += [_line(["ms (error)", *columns]), _line(["---"] * (1 + len(columns)))]
        for tool in tools:
            cells = [", ".join(map(_cell, _of(rows, system, tool))) or "-" for system in columns.values()]
            if any(cell != "-" for cell in cells):
                lines.append(_line([_NAMES.get(tool, tool), *cells]))
        lines.append("")
    lines += [_line(["lie_codegen alone", "ms (error)"]), _line(["---"] * 2)]
    lines += [_line([row["what"], _cell(row)]) for row in alone]
    missed = "; ".join(record["missed"])
    return "\n".join([*lines, "", f"Missed in this run: {missed}." if missed else "Nothing stated was missed.", ""])


def _of(rows: Sequence[Mapping[str, Any]], system: str, tool: str) -> list[Mapping[str, Any]]:
    return [
        row for row in rows
        if (row["what"], row["who"]) == (system, tool) and row["seconds"] is not None and isfinite(row["seconds"])
    ]  # fmt: skip


def _cell(row: Mapping[str, Any]) -> str:
    """2.3 (4e-10); milliseconds alone where nothing was computed to a tolerance."""
    ms = f"{1e3 * row['seconds']:.2g}" if row["seconds"] < 0.1 else f"{1e3 * row['seconds']:,.0f}"
    return f"{ms} ({row['error']:.0e})" if row["rtol"] else ms


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Put the tables between their marks."""
    text = PAGE.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    record = json.loads(RECORD.read_text(encoding="utf-8"))
    PAGE.write_text(f"{before}{BEGIN}{tables(record)}{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
