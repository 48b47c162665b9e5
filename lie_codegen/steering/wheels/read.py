"""What describes a body with wheels, read and checked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.numbers import exact_number
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.mechanics.body_frame import body_frame
from lie_codegen.on_demand import sympy as sp


def read_directions(group: MatrixGroup, axes: Any) -> sp.ImmutableMatrix:
    """(p, 3) exact directions in body axes, of numbers or of labels of the group."""
    rows = axes.tolist() if isinstance(axes, np.ndarray | sp.MatrixBase) else list(axes)
    frame = body_frame(group, "momentum_wheels")
    found = []
    for row in rows:
        if isinstance(row, str):
            found.append(list(frame.col(group.algebra.index(row))))
        elif isinstance(row, Sequence) and len(row) == 3:
            found.append([_exact(value) for value in row])
        else:
            raise ShapeError(f"momentum_wheels: axes are rows of three numbers or labels, got {row!r:.60}")
    if not found:
        raise ShapeError("momentum_wheels: axes is empty; give at least one wheel")
    return sp.ImmutableMatrix(found)


def _exact(value: Any) -> sp.Expr:
    """A number exactly; a float as the decimal that it prints as."""
    return exact_number(repr(float(value)) if isinstance(value, float | np.floating) else value)


def read_each(value: Any, count: int, what: str) -> list[Any]:
    """(p,) exact numbers, one for all or one each."""
    values = value.tolist() if isinstance(value, np.ndarray) else value
    rows = list(values) if isinstance(values, list | tuple) else [values] * count
    if len(rows) != count:
        raise ShapeError(f"momentum_wheels: {what} has {len(rows)} entries for {count} wheels")
    return [_exact(each) for each in rows]


def read_limits(value: Any, count: int, what: str) -> Array | None:
    """(p,) positive limits, or None."""
    if value is None:
        return None
    try:
        limits = np.array(np.broadcast_to(np.asarray(value, dtype=float), (count,)))
    except ValueError:
        raise ShapeError(f"momentum_wheels: {what}_limits is a number or ({count},), got {value!r:.60}") from None
    if not np.all(limits > 0) or not np.all(np.isfinite(limits)):
        raise InputError(f"momentum_wheels: {what}_limits must be positive and finite, got {value!r:.60}")
    return limits
