"""Sums and products of scalars in which a plain Python 0 or 1 leaves no operation: what is zero by structure stays zero."""

from __future__ import annotations

from typing import Any

from lie_codegen.kernel.arithmetic import Scalar


def is_zero(value: Any) -> bool:
    """Whether a scalar is a plain Python zero: a structural zero."""
    return isinstance(value, int | float) and value == 0


def product(a: Scalar, b: Scalar) -> Scalar:
    """a b, with plain zeros and ones absorbed."""
    if is_zero(a) or is_zero(b):
        return 0
    if isinstance(a, int) and a == 1:
        return b
    if isinstance(b, int) and b == 1:
        return a
    return a * b


def add(a: Scalar, b: Scalar) -> Scalar:
    """a + b, with plain zeros absorbed."""
    return b if is_zero(a) else a if is_zero(b) else a + b
