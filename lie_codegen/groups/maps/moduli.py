"""Sizes of numbers and of matrices in any arithmetic, where known zeros stay known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.linear import Matrix
from lie_codegen.kernel.structural_zeros import is_zero


def largest(ops: Arithmetic, values: Sequence[Scalar]) -> Scalar:
    """The maximum of non-negative values; 0 of none."""
    result: Scalar = 0
    for value in values:
        if is_zero(result):
            result = value
        elif not is_zero(value):
            result = ops.where(ops.less(result, value), value, result)
    return result


def modulus(ops: Arithmetic, entry: Any) -> Scalar:
    """The larger of |Re| and |Im|; a known zero stays one."""
    return largest(ops, [ops.fabs(part) for part in real_parts(entry) if not is_zero(part)])


def moduli(ops: Arithmetic, matrix: Sequence[Sequence[Any]]) -> Matrix:
    """|A|, entry by entry."""
    return [[modulus(ops, entry) for entry in row] for row in matrix]


def real_parts(entry: Any) -> list[Scalar]:
    """[Re, Im] of a complex scalar; a real one alone."""
    return [entry.re, entry.im] if isinstance(entry, Complex) else [entry]


def parts_of(entry: Any, is_complex: bool) -> list[Scalar]:
    """[Re, Im] of the entry of a complex group's matrix, which may be a real number; [x] of a real group's."""
    if not is_complex:
        return [entry]
    z = Complex.of(entry)
    return [z.re, z.im]
