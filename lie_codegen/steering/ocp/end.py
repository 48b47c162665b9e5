"""How far a plan truly ends from where it was asked to."""

from __future__ import annotations

from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import LieCodegenError
from lie_codegen.flow.elements import group_element
from lie_codegen.flow.logarithm import distance
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.steering.ocp.problem_data import ProblemData
from lie_codegen.steering.ocp.terms import Point


def end_error(data: ProblemData, X: Array, z: Array, parameters: Array) -> float:
    """The largest over the conditions at the end: |log(T^-1 X)| for one of the form X - T with T on the group, else |e|.

    A condition may vanish far from its target (skew(T' X) at half a turn): the distance does not.
    """
    errors = [0.0]
    for condition in data.terminal:
        element = [list(map(_scalar, row)) for row in X]
        values = {"state": list(z), "parameter": list(parameters)}
        at = Point(FloatArithmetic(), element, values, data.duration)
        entries = np.array(data.rows((condition,), at), dtype=float)
        target = None if isinstance(condition.term, Kernel) else _target(data, X, entries)
        errors.append(float(np.linalg.norm(entries)) if target is None else distance(data.group, target, X))
    return max(errors)


def _target(data: ProblemData, X: Array, entries: Array) -> Array | None:
    """T where the entries are those of X - T and T is on the group."""
    parts = entries.view(complex) if data.group.is_complex and entries.size == 2 * X.size else entries
    if parts.size != X.size:
        return None
    try:
        return group_element(data.group, X - parts.reshape(X.shape), "target")
    except LieCodegenError:
        return None


def _scalar(value: Any) -> Any:
    from lie_codegen.kernel.complex_scalar import Complex

    return Complex(value.real, value.imag) if isinstance(value, complex | np.complexfloating) else float(value)
