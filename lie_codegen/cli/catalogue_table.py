"""The README's table of groups: dimension, structure, Wei-Norman chart."""

from __future__ import annotations

import time

from lie_codegen.algebra.structure import structure
from lie_codegen.groups.catalogue_load import group
from lie_codegen.groups.catalogue_names import group_names
from lie_codegen.groups.wei_norman.chart_domain import ChartDomain, chart_domain

_HEAD = ("group", "dim", "matrices", "structure", "Wei-Norman chart in the basis order", "det M^-1")
_ENDS = {
    "never": "global",
    "walls": "{walls}",
    "either": "{walls}, escape not excluded",
    "escape": "never singular, but solutions may escape in finite time",
}
#: Walls longer than this are counted instead of written.
_LONG = 40


def catalogue_table(*, with_times: bool = False) -> str:
    """The catalogue as a Markdown table; with the seconds each derivation took, on request."""
    rows = [(*_HEAD, *(("time to derive",) if with_times else ()))]
    rows.append(("---",) * len(rows[0]))
    for name in group_names():
        started = time.perf_counter()
        found = group(name)
        parts = structure(found.algebra)
        domain = chart_domain(found)
        row = (
            name,
            str(found.dim),
            f"{found.degree} x {found.degree} {'complex' if found.is_complex else 'real'}",
            parts.kind,
            _chart(domain),
            _short(str(domain.determinant), "not shown"),
        )
        rows.append((*row, *((f"{time.perf_counter() - started:.2f} s",) if with_times else ())))
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def _chart(domain: ChartDomain) -> str:
    walls = _short(", ".join(domain.wall_texts), f"{len(domain.walls)} walls")
    return _ENDS[domain.end].format(walls=walls).replace("|", "\\|")


def _short(text: str, instead: str) -> str:
    return text if len(text) <= _LONG else instead
