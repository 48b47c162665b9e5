"""A law is a law on the group: fed a matrix that is not one of its elements, a kernel returns NaN, never a number."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.admission import NEAR_GROUP
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.kernel import Kernel


def nan_off_group(kernel: Kernel, group: MatrixGroup, ports: Iterable[str]) -> Kernel:
    """The kernel with all outputs NaN where the matrix of one of the ports is farther than 1e-5 (its defect) from the group.

    A reflection fed to an attitude law has no rotation angle: without this the law reads zero, the picture of success. Below
    1e-5, as in single precision, the outputs are as good as the input.
    """
    names = [port.name for port in kernel.inputs]
    places = [names.index(name) for name in ports]
    data, inner = derivation_of(group), kernel.body

    def body(ops: Arithmetic, *arguments: Any) -> tuple[Any, ...]:
        from lie_codegen.groups.maps.defect import defect

        worst = [defect(ops, data, arguments[place]) for place in places]
        on_group = [ops.less(each, ops.constant(NEAR_GROUP)) for each in worst]
        return tuple(kept_where(ops, on_group, output) for output in inner(ops, *arguments))

    return replace(kernel, body=body)


def kept_where(ops: Arithmetic, conditions: Iterable[Any], values: Any) -> Any:
    """Nested values where all conditions hold, else NaN. A defect that is NaN is less than nothing, so that it refuses too."""
    if isinstance(values, list | tuple):
        held = list(conditions)
        return type(values)(kept_where(ops, held, value) for value in values)
    if isinstance(values, Complex):
        held = list(conditions)
        return Complex(kept_where(ops, held, values.re), kept_where(ops, held, values.im))
    kept: Scalar = values
    for condition in conditions:
        kept = ops.where(condition, kept, ops.constant(math.nan))
    return kept
