"""The loop over phases of second-order averaging as a routine: C, its twin in numpy, and the kernels around it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import CodegenError
from lie_codegen.kernel.arithmetic import Arithmetic, FloatArithmetic, Scalar
from lie_codegen.kernel.dual import DualArithmetic, tangent_of, value_of
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.plain_data import Definition
from lie_codegen.kernel.routine import Routine, call_routine

#: node(ops, x, phi) -> (F, G), per unit eps; clock(ops, x) -> Lambda. The phase has period 1.
Node = Callable[[Arithmetic, Sequence[Scalar], Scalar], tuple[list[Scalar], Scalar]]
Clock = Callable[[Arithmetic, Sequence[Scalar]], Scalar]
#: Derivatives of them, as kernel bodies.
Derivative = Callable[..., tuple[Any, ...]]


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

    def twice(ops: Arithmetic, x: Any, phi: Any, w: Any, v: Any) -> tuple[Any, ...]:
        dual = DualArithmetic(ops)
        F, G = _directional(dual, node, [dual.variable(a, {0: b}) for a, b in zip(x, v, strict=True)], phi, w)
        return [tangent_of(each, 0, dual.level) for each in F], tangent_of(G, 0, dual.level)

    def speed_rate(ops: Arithmetic, x: Any, v: Any) -> tuple[Any, ...]:
        dual = DualArithmetic(ops)
        rate, slope, bent = clock_derivatives(
            dual, clock, [dual.variable(a, {0: b}) for a, b in zip(x, v, strict=True)]
        )
        level = dual.level
        return (
            tangent_of(rate, 0, level), [tangent_of(each, 0, level) for each in slope],
            [[tangent_of(each, 0, level) for each in row] for row in bent],
        )  # fmt: skip

    v, ends = Port("v", (size,)), (F, G)
    derivatives = (Port("L", ()), Port("slope", (size,)), Port("curvature", (size, size)))
    helpers = (
        Kernel(f"{name}_node", namespace, (x, phi), ends, value),
        Kernel(f"{name}_node_rate", namespace, (x, phi, w), ends, rate),
        Kernel(f"{name}_clock", namespace, (x,), derivatives, speed),
    )
    more = (
        Kernel(f"{name}_node_twice", namespace, (x, phi, w, v), ends, twice),
        Kernel(f"{name}_clock_rate", namespace, (x, v), derivatives, speed_rate),
    )
    levels = tuple(
        Definition(limit=repr(float(limit)), nodes=count, primitive=tuple(repr(float(p)) for p in primitive(count)))
        for limit, count in nodes.levels
    )
    settings = (
        ("key", key), ("size", size), ("selector", nodes.selector), ("counts", nodes.levels), ("levels", levels),
        ("node", helpers[0].symbol), ("node_rate", helpers[1].symbol), ("clock", helpers[2].symbol),
    )  # fmt: skip

    def twin(values: Sequence[float]) -> Array:
        return phase_terms(node, clock, np.asarray(values[:size]), values[size], values[size + 1] > 1, nodes.at(values))

    def twin_of_tangent(values: Sequence[float]) -> Array:
        given = np.asarray(values, dtype=float)
        return phase_terms_rate(node, clock, twice, speed_rate, given, size, nodes.at(values))

    moved = Routine(
        f"{name}_tangent", 2 * size + 3, 3 * size + 4, "phase_average_tangent.c.jinja",
        (*settings, ("node_twice", more[0].symbol), ("clock_rate", more[1].symbol)),
        (*helpers, *more), twin_of_tangent, no_tangent,
    )  # fmt: skip

    def tangent(ops: Any, inputs: Sequence[Scalar], outputs: Sequence[Scalar], rates: Sequence[Scalar]) -> list[Scalar]:
        # The last input is the order, 1 or 2, which has no derivative.
        directions = [ops.constant(0) + each for each in rates[: size + 1]]
        return call_routine(ops, moved, [*inputs, *directions])

    return Routine(name, size + 2, 3 * size + 4, "phase_average.c.jinja", settings, helpers, twin, tangent)


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


def phase_terms_rate(
    node: Node, clock: Clock, twice: Derivative, speed_rate: Derivative, values: Array, n: int, count: int
) -> Array:
    """The derivative of `phase_terms` along a direction of (x, phi): `values` are x, phi, order, and the direction."""
    ops, x, v = FloatArithmetic(), values[:n].tolist(), values[n + 2 : 2 * n + 2].tolist()
    second_order, turn = values[n + 1] > 1, float(values[2 * n + 2])
    at = [float(values[n] + j / count) for j in range(count)]

    def rows(pairs: Sequence[tuple[Any, Any]]) -> tuple[Array, Array]:
        return np.array([F for F, _ in pairs], dtype=float).T, np.array([G for _, G in pairs], dtype=float)

    f, g = rows([node(ops, x, each) for each in at])
    df, dg = rows([_directional(ops, node, x, each, v) for each in at])
    rate, slope, bent = (np.asarray(each, dtype=float) for each in clock_derivatives(ops, clock, x))
    drate, dslope, dbent = (np.asarray(each, dtype=float) for each in speed_rate(ops, x, v))
    P = primitive(count)[(np.arange(count)[:, None] - np.arange(count)) % count]
    w = f @ P.T / rate
    dw = (df @ P.T - w * drate) / rate
    f0, df0, g0, dg0 = f - f.mean(axis=1)[:, None], df - df.mean(axis=1)[:, None], g - g.mean(), dg - dg.mean()
    drive, ddrive = g0 + slope @ w, dg0 + dslope @ w + slope @ dw
    dF2, dG2, dV = np.zeros(n), 0.0, 0.0
    if second_order:
        pushed, dpushed = drive / rate, (ddrive - drive * drate / rate) / rate
        bend, g_bend = rows([twice(ops, x, each, w[:, j].tolist(), v) for j, each in enumerate(at)])
        moved, g_moved = rows([_directional(ops, node, x, each, dw[:, j].tolist()) for j, each in enumerate(at)])
        dF2 = (bend + moved - df0 * pushed - f0 * dpushed).mean(axis=1)
        curved = np.einsum("ik,il,lk->k", w, dbent, w) / 2 + np.einsum("ik,il,lk->k", dw, bent, w)
        dG2 = float((g_bend + g_moved - dg0 * pushed - g0 * dpushed + curved).mean())
        dV = float(P[0] @ dpushed) + turn * float(pushed[0])
    W_dot = dw[:, 0] + turn * f0[:, 0] / rate  # Lambda W_phi = F - F1
    return np.concatenate([df.mean(axis=1), [drate, dg.mean()], dF2, [dG2], W_dot, [dV]])
