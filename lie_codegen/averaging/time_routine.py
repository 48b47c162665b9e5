"""The loop over times of averages to order 4 as a routine, and the kernels around it."""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.averaging.phase_routine import Frozen, no_tangent, primitive
from lie_codegen.averaging.time_program import Program, indexed, program
from lie_codegen.averaging.vector_field import FieldBody, along
from lie_codegen.kernel.arithmetic import Arithmetic, FloatArithmetic, Scalar
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.routine import Routine, call_routine


def time_routine(
    name: str, namespace: str, field: FieldBody, size: int, period: float, order: int, nodes: int, key: str
) -> Routine:
    """(z, t) -> F_1 .. F_order and u_1 .. u_(order-1) at t.

    Args:
        name: C identifier.
        namespace: of the helpers.
        field: f of (y.., eps) and (t).
        size: n.
        period: T.
        order: 1 to 4.
        nodes: number of times.
        key: a text that all this follows from.
    """
    z, t = Port("z", (size,)), Port("t", ())

    def helper(count: int) -> Kernel:
        letters = [("a", "a_eps"), ("b", "b_eps"), ("c", "c_eps")][:count]
        ports = tuple(port for v, e in letters for port in (Port(v, (size,)), Port(e, ())))

        def body(ops: Arithmetic, z: Any, t: Any, *given: Any) -> tuple[Any, ...]:
            directions = [[*given[2 * i], given[2 * i + 1]] for i in range(count)]
            return (along(field, ops, [*z, ops.constant(0)], [t], *directions),)

        return Kernel(f"{name}_d{count}", namespace, (z, t, *ports), (Port("f", (size,)),), body)

    steps = program(order)
    helpers = tuple(helper(count) for count in range(min(order, 4)))
    views = []
    for each in steps.steps:
        view: dict[str, Any] = {"kind": each.kind, "output": each.output, "mean": each.mean}
        if each.kind == "field":
            view |= {"helper": helpers[len(each.terms)].symbol, "inputs": indexed(each.terms, steps.means)}
        elif each.kind == "sum":
            view["expression"] = " + ".join(f"({factor!r}) * {array}[j][i]" for factor, array in each.terms)
        else:
            view["inputs"] = each.terms[0]
        views.append(view)
    lines = [f"{array}[M][N]" for array in steps.arrays] + [f"{mean}[N]" for mean in steps.means]
    settings = (
        ("key", key), ("size", size), ("order", order), ("nodes", nodes), ("period", repr(period)),
        ("primitive", Frozen([repr(float(p)) for p in primitive(nodes)])), ("arrays", Frozen(lines)),
        ("steps", Frozen(views)),
    )  # fmt: skip

    def twin(values: Sequence[float]) -> Array:
        return run_program(steps, field, np.asarray(values[:size]), float(values[size]), period, order, nodes)

    return Routine(name, size + 1, (2 * order - 1) * size, "time_average.c.jinja", settings, helpers, twin, no_tangent)


def run_program(steps: Program, field: FieldBody, z: Array, t: float, period: float, order: int, nodes: int) -> Array:
    """The same by Python."""
    ops, n = FloatArithmetic(), len(z)
    shift = period * primitive(nodes)[(np.arange(nodes)[:, None] - np.arange(nodes)) % nodes]
    found: dict[str, Array] = {}
    for each in steps.steps:
        if each.kind == "field":
            rows = []
            for j in range(nodes):
                directions = [
                    [*(found[name] if found[name].ndim == 1 else found[name][j]).tolist(), float(name == "u1")]
                    for name in map(str, each.terms)
                ]
                point = [*z.tolist(), 0.0]
                rows.append([float(v) for v in along(field, ops, point, [t + period * j / nodes], *directions)])
            found[each.output] = np.array(rows)
        elif each.kind == "sum":
            found[each.output] = sum((factor * found[array] for factor, array in each.terms), np.zeros((nodes, n)))
        else:
            array = found[str(each.terms[0])]
            found[each.output], found[each.mean] = shift @ array, array.mean(axis=0)
    slow = [found[f"F{q}"] for q in range(1, order + 1)]
    return np.concatenate([*slow, *(found[f"u{q}"][0] for q in range(1, order))])


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
