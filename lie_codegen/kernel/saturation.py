"""A vector within limits: every component clipped by itself, or the whole shortened so that its direction stays."""

from __future__ import annotations

from collections.abc import Sequence

from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.linear import Vector


def saturated(ops: Arithmetic, vector: Sequence[Scalar], limits: Sequence[Scalar] | None = None) -> Vector:
    """min(max(v, -limit), limit), component by component."""
    if limits is None:
        return list(vector)
    result: Vector = []
    for value, limit in zip(vector, limits, strict=True):
        high = ops.constant(limit) if isinstance(limit, int) else limit
        low = -high
        clipped = ops.where(ops.less(high, value), high, value)
        result.append(ops.where(ops.less(value, low), low, clipped))
    return result


def shortened(ops: Arithmetic, vector: Sequence[Scalar], limits: Sequence[Scalar]) -> Vector:
    """s v with the largest s <= 1 that keeps every component within its limit: the direction stays.

    So v . (s K v) keeps its sign for every positive K, which clipping the components one by one does not: with K not diagonal a clipped K v may
    point against v.
    """
    longest: Scalar = ops.constant(1)
    for value, limit in zip(vector, limits, strict=True):
        ratio = ops.fabs(value) / limit
        longest = ops.where(ops.less(longest, ratio), ratio, longest)
    return [value / longest for value in vector]
