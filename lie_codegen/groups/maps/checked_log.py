"""log(X) as kernels take it: the closed form where membership certifies it, the routine of `log_routine` elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lie_codegen.groups.derivation import GroupDerivation
from lie_codegen.groups.maps.defect import defect
from lie_codegen.groups.maps.log_guard import off_group_square
from lie_codegen.groups.maps.log_routine import log_routine, whole
from lie_codegen.groups.maps.logarithm import candidate
from lie_codegen.groups.maps.moduli import parts_of
from lie_codegen.kernel.arithmetic import ROUNDOFF, Arithmetic, unit_roundoff
from lie_codegen.kernel.linear import Vector
from lie_codegen.kernel.routine import call_routine

#: The defect up to which a closed form is taken as it is: rounding of the numbers that the kernel is printed for.
_ROUNDING = {ROUNDOFF["double"]: 1e-13, ROUNDOFF["float"]: 4e-6}


def log_coordinates(ops: Arithmetic, data: GroupDerivation, X: Sequence[Sequence[Any]]) -> Vector:
    """The x with exp(hat x) = X, of the nearest element within 1e-5 of the group; NaN where there is none."""
    entries = [list(row) for row in X]
    flat = [part for row in entries for entry in row for part in parts_of(entry, data.group.is_complex)]
    if not data.log_structure.is_closed:
        return call_routine(ops, log_routine(data), flat)
    x = whole(ops, data, candidate(ops, data, entries))
    rounding = _ROUNDING[unit_roundoff(ops)]
    # Not `less(rounding, defect)`, which is false for NaN.
    square = off_group_square(ops, data, entries)
    if square is None:
        on_group = ops.less(defect(ops, data, entries), ops.constant(rounding))
    else:
        on_group = ops.less(square, ops.constant(rounding**2))
    off_group = ops.less(ops.where(on_group, ops.constant(1), 0), ops.constant(0.5))
    checked = call_routine(ops, log_routine(data), flat, off_group)
    return [ops.where(on_group, closed, value) for closed, value in zip(x, checked, strict=True)]
