"""Numbers that change from segment to segment of time, found by it: by choices, or, of many segments, in a table.

A chain of choices is a straight line that every target runs, but computes all of them each time: a thousand samples took a minute to compile
and as long to run as a thousand loops. A table is looked up by halving.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.routine import Routine, call_routine
from lie_codegen.on_demand import casadi as ca

#: Segments from which a table is looked up.
_FROM = 13


@dataclass(frozen=True, eq=False)
class TimeTable:
    """Rows of numbers that begin at increasing times.

    Attributes:
        begins: (k,) times.
        rows: (k, w).
    """

    begins: Array
    rows: Array

    def at(self, ops: Arithmetic, t: Scalar) -> list[Scalar]:
        """The last row whose time is below t; the first before all of them."""
        if len(self.rows) >= _FROM and getattr(ops, "routines", False):
            return call_routine(ops, self._routine, [t])
        later = [ops.less(float(begin), t) for begin in self.begins[1:]]
        return [_chosen(ops, later, column) for column in self.rows.T]

    @cached_property
    def _routine(self) -> Routine:
        """Made once: a thousand rows are tens of thousands of numbers as text."""
        begins, rows = self.begins, self.rows
        digest = hashlib.sha256(begins.tobytes() + rows.tobytes()).hexdigest()[:16]
        literals = tuple(tuple(map(repr, row)) for row in rows.tolist())
        settings = (("width", rows.shape[1]), ("begins", tuple(map(repr, begins.tolist()))), ("rows", literals))
        return Routine(
            f"table_{digest}",
            1,
            rows.shape[1],
            "table_row.c.jinja",
            settings,
            (),
            partial(_looked_up, begins, rows),
            _steady,
            graph=partial(_graph, begins, rows),
        )


def _chosen(ops: Arithmetic, later: Sequence[Any], values: Array) -> Scalar:
    result: Scalar = float(values[0])
    if np.all(values == values[0]):
        return result
    for condition, value in zip(later, values[1:], strict=True):
        result = ops.where(condition, float(value), result)
    return result


def _looked_up(begins: Array, rows: Array, values: Sequence[float]) -> Array:
    """The twin of the C."""
    return np.asarray(rows[int(np.searchsorted(begins[1:], values[0], side="left"))])


def _steady(
    ops: Arithmetic, inputs: Sequence[Scalar], outputs: Sequence[Scalar], rates: Sequence[Scalar]
) -> list[Scalar]:
    """A row does not change within its segment."""
    return [0] * len(outputs)


def _graph(begins: Array, rows: Array) -> Any:
    """The same for CasADi."""
    t, width = ca.MX.sym("t"), rows.shape[1]
    row = ca.sum1(ca.DM(begins[1:]) < t)
    found = ca.MX(ca.DM(rows.ravel())).get_nz(False, row * width + ca.DM(list(range(width))))
    return ca.Function("row", [t], [ca.densify(found)])
