"""The pair of order 8(5, 3) as headers of C: its step, its coefficients, and the solution within a step."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from types import MappingProxyType

from lie_codegen.codegen.templates import template_folder
from lie_codegen.runtime import dop853


def pair_headers() -> dict[str, str]:
    """The headers of one step, of vectors and of groups."""
    return {"pair_step.h": _template("pair_step.h"), "ode_table.h": _step_table()}


def group_headers() -> dict[str, str]:
    """The headers of steps on groups, of one member and of many."""
    return {**pair_headers(), "pair_control.h": _template("pair_control.h")}


@cache
def two_files() -> Mapping[str, str]:
    """The step of two runs of one system, which is compiled for its rate: the main file first."""
    return MappingProxyType(
        {**{name: _template(name) for name in ("pair_two.c", "pair_two.h")}, "ode_table.h": _step_table()}
    )


def dense_headers() -> dict[str, str]:
    """The headers of the solution within a step."""
    return {"pair_dense.h": _template("pair_dense.h"), "ode_dense.h": _dense_table()}


def _template(name: str) -> str:
    return (template_folder() / name).read_text(encoding="utf-8")


def _step_table() -> str:
    stages = len(dop853.A)
    rows = [f"enum {{ STAGES = {stages} }};", *_matrix("A", "STAGES", _filled(dop853.A, stages))]
    for name, values in (("B", dop853.B), ("C", dop853.C), ("E3", dop853.E3), ("E5", dop853.E5)):
        rows.append(f"static const double {name}[STAGES] = {{ {', '.join(map(repr, values))} }};")
    # row s of A, then B: where it is not 0
    sums = [[j for j in range(stages) if row.get(j, 0.0)] for row in (*dop853.A, dict(enumerate(dop853.B)))]
    lists = ", ".join("{ " + ", ".join(map(str, used or [0])) + " }" for used in sums)
    rows.append(f"static const unsigned char USED[STAGES + 1][STAGES] = {{ {lists} }};")
    rows.append(f"static const int USES[STAGES + 1] = {{ {', '.join(str(len(used)) for used in sums)} }};")
    return "\n".join([*rows, ""])


def _dense_table() -> str:
    stages = len(dop853.D[0])
    rows = [f"enum {{ DENSE_STAGES = {stages} }};"]
    rows += _matrix("DENSE_A", "DENSE_STAGES", _filled(dop853.DENSE_A, stages))
    rows += _matrix("DENSE_D", "DENSE_STAGES", dop853.D)
    rows.append(f"static const double DENSE_C[] = {{ {', '.join(map(repr, dop853.DENSE_C))} }};")
    return "\n".join([*rows, ""])


def _filled(rows: tuple[dict[int, float], ...], stages: int) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row.get(j, 0.0) for j in range(stages)) for row in rows)


def _matrix(name: str, columns: str, values: tuple[tuple[float, ...], ...]) -> list[str]:
    rows = [f"    {{ {', '.join(map(repr, row))} }}," for row in values]
    return [f"static const double {name}[{len(values)}][{columns}] = {{", *rows, "};"]
