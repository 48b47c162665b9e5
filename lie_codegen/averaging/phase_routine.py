"""The loop over phases of second-order averaging as a routine: C, its twin in numpy, and the kernels around it."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import CodegenError
from lie_codegen.kernel.arithmetic import Arithmetic, FloatArithmetic, Scalar
from lie_codegen.kernel.dual import DualArithmetic, tangent_of, value_of
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.routine import Routine, call_routine

#: node(ops, x, phi) -> (F, G), per unit eps; clock(ops, x) -> Lambda. The phase has period 1.
Node = Callable[[Arithmetic, Sequence[Scalar], Scalar], tuple[list[Scalar], Scalar]]
Clock = Callable[[Arithmetic, Sequence[Scalar]], Scalar]


@dataclass(frozen=True)
class Nodes:
    """How many phases are taken.

    Attributes:
        levels: (limit, nodes): the first whose limit x[selector] does not reach; the last takes the rest.
        selector: which slow variable tells how fast the Fourier coefficients fall.
    """

    levels: tuple[tuple[float, int], ...]
    selector: int = 0

    def at(self, x: Sequence[float]) -> int:
        """The number at x."""
        return next((nodes for limit, nodes in self.levels[:-1] if x[self.selector] < limit), self.levels[-1][1])


def primitive(nodes: int) -> Array:
    """(nodes,) p with (P f)_j = sum_k p[(j - k) mod nodes] f_k: each harmonic divided by i 2 pi m, mean and Nyquist dropped."""
    m = np.arange(1, (nodes + 1) // 2)
    waves = np.sin(2 * np.pi * np.outer(np.arange(nodes), m) / nodes)
    return np.asarray(waves @ (1 / (np.pi * m * nodes)))


def phase_routine(name: str, namespace: str, node: Node, clock: Clock, size: int, nodes: Nodes, key: Any) -> Routine:
    """(x, phi, order) -> F1, Lambda, G1, F2, G2, W(phi), V(phi) of x' = eps F, phi' = Lambda + eps G.

    Args:
        name: C identifier; equal systems alone may share it.
        namespace: of the helpers.
        node, clock: the system.
        size: number of slow variables.
        nodes: the phases.
        key: plain data that node and clock follow from.
    """
    x, phi, F, G = Port("x", (size,)), Port("phi", ()), Port("F", (size,)), Port("G", ())
    w = Port("w", (size,))

    def value(ops: Arithmetic, x: Any, phi: Any) -> tuple[Any, ...]:
        return node(ops, x, phi)

    def rate(ops: Arithmetic, x: Any, phi: Any, w: Any) -> tuple[Any, ...]:
        return _directional(ops, node, x, phi, w)

    def speed(ops: Arithmetic, x: Any) -> tuple[Any, ...]:
        return clock_derivatives(ops, clock, x)

    helpers = (
        Kernel(f"{name}_node", namespace, (x, phi), (F, G), value),
        Kernel(f"{name}_node_rate", namespace, (x, phi, w), (F, G), rate),
        Kernel(
            f"{name}_clock",
            namespace,
            (x,),
            (Port("L", ()), Port("slope", (size,)), Port("curvature", (size, size))),
            speed,
        ),
    )
    levels = tuple(
        {"limit": repr(float(limit)), "nodes": count, "primitive": [repr(float(p)) for p in primitive(count)]}
        for limit, count in nodes.levels
    )
    settings = (
        ("key", key), ("size", size), ("selector", nodes.selector), ("counts", nodes.levels), ("levels", Frozen(levels)),
        ("node", helpers[0].symbol), ("node_rate", helpers[1].symbol), ("clock", helpers[2].symbol),
    )  # fmt: skip

    def twin(values: Sequence[float]) -> Array:
        return phase_terms(node, clock, np.asarray(values[:size]), values[size], values[size + 1] > 1, nodes.at(values))

    return Routine(name, size + 2, 3 * size + 4, "phase_average.c.jinja", settings, helpers, twin, no_tangent)


class Frozen(list[Any]):
    """A list that a template reads, told apart by the other settings: it has a hash and equals every other."""

    def __hash__(self) -> int:  # type: ignore[override]
        return 0

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Frozen)


def no_tangent(*_: Any) -> list[Scalar]:
    """Loops over nodes are not differentiated as a whole.

    Raises:
        CodegenError: always.
    """
    raise CodegenError(
        "an average over nodes is a loop whose derivative is not generated; differentiate its formulas instead"
    )


def _directional(ops: Arithmetic, node: Node, x: Any, phi: Any, w: Any) -> tuple[list[Scalar], Scalar]:
    dual = DualArithmetic(ops)
    F, G = node(dual, [dual.variable(a, {0: b}) for a, b in zip(x, w, strict=True)], phi)
    return [tangent_of(each, 0, dual.level) for each in F], tangent_of(G, 0, dual.level)


def clock_derivatives(ops: Arithmetic, clock: Clock, x: Sequence[Scalar]) -> tuple[Any, ...]:
    """Lambda, its gradient (n,) and its Hessian (n, n)."""
    first = DualArithmetic(ops)
    second = DualArithmetic(first)
    point = [second.variable(first.variable(a, {i: 1}), {i: 1}) for i, a in enumerate(x)]
    value = clock(second, point)
    n = len(point)
    outer = [tangent_of(value, i, second.level) for i in range(n)]
    inner = value_of(value, second.level)
    plain = value_of(inner, first.level)
    slope = [tangent_of(inner, i, first.level) for i in range(n)]
    return plain, slope, [[tangent_of(outer[i], j, first.level) for j in range(n)] for i in range(n)]


def phase_terms(node: Node, clock: Clock, x: Array, phi: float, second_order: bool, count: int) -> Array:
    """The same by Python: the outputs of the routine, one after the other."""
    ops, n, point = FloatArithmetic(), len(x), [float(each) for each in x]
    at = [float(phi + j / count) for j in range(count)]
    pairs = [node(ops, point, each) for each in at]
    f, g = np.array([F for F, _ in pairs], dtype=float).T, np.array([G for _, G in pairs], dtype=float)
    rate, slope, curvature = (np.asarray(each, dtype=float) for each in clock_derivatives(ops, clock, point))
    shift = primitive(count)[(np.arange(count)[:, None] - np.arange(count)) % count] / rate
    F1, G1, w = f.mean(axis=1), g.mean(), f @ shift.T
    drive = g - G1 + slope @ w
    F2, G2, V = np.zeros(n), 0.0, 0.0
    if second_order:
        rates = [_directional(ops, node, point, each, w[:, j].tolist()) for j, each in enumerate(at)]
        moved, g_moved = np.array([F for F, _ in rates], dtype=float).T, np.array([G for _, G in rates], dtype=float)
        F2 = (moved - (f - F1[:, None]) * drive / rate).mean(axis=1)
        bent = np.einsum("ik,ij,jk->k", w, curvature, w) / 2
        G2, V = float((g_moved - (g - G1) * drive / rate + bent).mean()), float(shift[0] @ drive)
    return np.concatenate([F1, [rate, G1], F2, [G2], w[:, 0], [V]])


def phase_kernels(
    routine: Routine, node: Node, clock: Clock, size: int, namespace: str, unit: float = 1.0,
    sampler: Callable[[random.Random], list[float]] | None = None,
) -> tuple[Kernel, ...]:  # fmt: skip
    """terms, near_identity, mean_rate and actual_rate of the system; phases in `unit` a period.

    terms(x) -> (F1, F2, Lambda, G1, G2); near_identity(x, phi) -> (W, V); mean_rate(y, eps, order) -> (x', phi') of the averaged
    system and actual_rate(y, eps) -> (x', phi') of the true one, y = (x, phi).
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
    )  # fmt: skip


def tail(values: Array) -> float:
    """The last quarter of the Fourier coefficients of samples (..., M) over the largest: what a jump leaves there."""
    waves = np.abs(np.fft.rfft(values, axis=-1))
    largest = float(waves.max())
    return (
        0.0
        if largest == 0 or not math.isfinite(largest)
        else float(waves[..., 3 * waves.shape[-1] // 4 :].max()) / largest
    )
