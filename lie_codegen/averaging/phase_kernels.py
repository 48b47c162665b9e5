"""Kernels of second-order averages with one phase, around the loop over phases."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

from lie_codegen.averaging.phase_routine import Clock, Node
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.routine import Routine, call_routine


def phase_kernels(
    routine: Routine, node: Node, clock: Clock, size: int, namespace: str, unit: float = 1.0,
    sampler: Callable[[random.Random], list[float]] | None = None,
) -> tuple[Kernel, ...]:  # fmt: skip
    """terms, near_identity, mean_rate, actual_rate and slow_field of the system; phases in `unit` a period.

    terms(x) -> (F1, F2, Lambda, G1, G2); near_identity(x, phi) -> (W, V); mean_rate(y, eps, order) -> (x', phi') of the averaged
    system and actual_rate(y, eps) -> (x', phi') of the true one, y = (x, phi); slow_field(x, eps, order) -> x' of the averaged one.
    """
    n = size
    x, phi, eps, state = Port("x", (n,)), Port("phi", ()), Port("eps", ()), Port("y", (n + 1,), description="x, phi")

    def call(ops: Arithmetic, x: Any, phi: Any, order: Any) -> list[Scalar]:
        return call_routine(ops, routine, [*x, phi / unit, order])

    def terms(ops: Arithmetic, x: Any) -> tuple[Any, ...]:
        r = call(ops, x, ops.constant(0), ops.constant(2))
        return r[:n], r[n + 2 : 2 * n + 2], unit * r[n], unit * r[n + 1], unit * r[2 * n + 2]

    def near_identity(ops: Arithmetic, x: Any, phi: Any) -> tuple[Any, ...]:
        r = call(ops, x, phi, ops.constant(2))
        return r[2 * n + 3 : 3 * n + 3], unit * r[3 * n + 3]

    def mean_rate(ops: Arithmetic, y: Any, eps: Any, order: Any) -> tuple[Any, ...]:
        r = call(ops, y[:n], ops.constant(0), order)
        slow = [eps * (a + eps * b) for a, b in zip(r[:n], r[n + 2 : 2 * n + 2], strict=True)]
        return ([*slow, unit * (r[n] + eps * (r[n + 1] + eps * r[2 * n + 2]))],)

    def actual_rate(ops: Arithmetic, y: Any, eps: Any) -> tuple[Any, ...]:
        F, G = node(ops, y[:n], y[n] / unit)
        return ([*(eps * each for each in F), unit * (clock(ops, y[:n]) + eps * G)],)

    def slow_field(ops: Arithmetic, x: Any, eps: Any, order: Any) -> tuple[Any, ...]:
        r = call(ops, x, ops.constant(0), order)
        return ([eps * (a + eps * b) for a, b in zip(r[:n], r[n + 2 : 2 * n + 2], strict=True)],)

    def draw(rng: random.Random) -> list[float]:
        return sampler(rng) if sampler else [rng.uniform(-1, 1) for _ in range(n)]

    source = "Coppola, The method of averaging for Euler's equations of rigid body motion, (19)-(22)"
    rate = Port("y_dot", (n + 1,))
    return (
        Kernel("terms", namespace, (x,), (Port("F1", (n,)), Port("F2", (n,)), Port("Lambda", ()), Port("G1", ()), Port("G2", ())),
               terms, "x' = eps F1 + eps^2 F2, phi' = Lambda + eps G1 + eps^2 G2, zero-mean gauge", source, lambda rng: (draw(rng),)),
        Kernel("near_identity", namespace, (x, phi), (Port("W", (n,)), Port("V", ())), near_identity,
               "x = y + eps W(y, psi), phi = psi + eps V(y, psi), W and V of zero mean", source, lambda rng: (draw(rng), rng.uniform(0, unit))),
        Kernel("mean_rate", namespace, (state, eps, Port("order", (), description="1 or 2")), (rate,), mean_rate,
               "the averaged system", source, lambda rng: ([*draw(rng), 0.0], 0.01, 2.0)),
        Kernel("actual_rate", namespace, (state, eps), (rate,), actual_rate, "x' = eps F, phi' = Lambda + eps G", source,
               lambda rng: ([*draw(rng), rng.uniform(0, unit)], 0.01)),
        Kernel("slow_field", namespace, (x, eps, Port("order", (), description="1 or 2")), (Port("x_dot", (n,)),), slow_field,
               "x' = eps F1 + eps^2 F2, which the phase does not enter", source, lambda rng: (draw(rng), 0.01, 2.0)),
    )  # fmt: skip
