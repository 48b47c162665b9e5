"""Kernels of averages in time, around the loop over times."""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Any

from lie_codegen.averaging.vector_field import FieldBody
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.routine import Routine, call_routine


def time_kernels(
    routine: Routine, field: FieldBody, size: int, order: int, period: float, namespace: str
) -> tuple[Kernel, ...]:
    """terms(z) -> F (order, n), near_identity(z, t) -> u (order - 1, n) for order > 1, mean_rate(z, eps), actual_rate(y, t, eps)."""
    n = size
    z, y, t, eps = Port("z", (n,)), Port("y", (n,)), Port("t", ()), Port("eps", ())

    def rows(values: Sequence[Scalar], first: int, count: int) -> list[list[Scalar]]:
        return [list(values[(first + q) * n : (first + q + 1) * n]) for q in range(count)]

    def terms(ops: Arithmetic, z: Any) -> tuple[Any, ...]:
        return (rows(call_routine(ops, routine, [*z, ops.constant(0)]), 0, order),)

    def near_identity(ops: Arithmetic, z: Any, t: Any) -> tuple[Any, ...]:
        return (rows(call_routine(ops, routine, [*z, t]), order, order - 1),)

    def mean_rate(ops: Arithmetic, z: Any, eps: Any) -> tuple[Any, ...]:
        total: list[Scalar] = [0] * n
        for row in reversed(rows(call_routine(ops, routine, [*z, ops.constant(0)]), 0, order)):
            total = [eps * (a + b) for a, b in zip(row, total, strict=True)]
        return (total,)

    def actual_rate(ops: Arithmetic, y: Any, t: Any, eps: Any) -> tuple[Any, ...]:
        return ([eps * each for each in field(ops, [*y, eps], [t])],)

    def draw(rng: random.Random) -> list[float]:
        return [rng.uniform(0.2, 0.8) for _ in range(n)]

    kernels = [
        Kernel("terms", namespace, (z,), (Port("F", (order, n)),), terms, "z' = sum eps^q F_q(z), zero-mean gauge", "", lambda rng: (draw(rng),)),
        Kernel("mean_rate", namespace, (z, eps), (Port("z_dot", (n,)),), mean_rate, "z' = sum eps^q F_q(z)", "", lambda rng: (draw(rng), 0.05)),
        Kernel("actual_rate", namespace, (y, t, eps), (Port("y_dot", (n,)),), actual_rate, "y' = eps f(y, t; eps)", "",
               lambda rng: (draw(rng), rng.uniform(0, period), 0.05)),
    ]  # fmt: skip
    if order > 1:
        kernels.insert(1, Kernel(
            "near_identity", namespace, (z, t), (Port("u", (order - 1, n)),), near_identity,
            "y = z + sum eps^q u_q(z, t), each of zero mean in t", "", lambda rng: (draw(rng), rng.uniform(0, period)),
        ))  # fmt: skip
    return tuple(kernels)
