"""The loop over times of averages to order 4 as a routine, and the kernels around it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.averaging.phase_routine import no_tangent, primitive
from lie_codegen.averaging.time_program import Program, Step, differentiated, indexed, program
from lie_codegen.averaging.vector_field import FieldBody, along
from lie_codegen.kernel.arithmetic import Arithmetic, FloatArithmetic, Scalar
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.plain_data import Definition
from lie_codegen.kernel.routine import Routine, Tangent, call_routine


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
    plain = program(order)
    results = [f"F{q}[i]" for q in range(1, order + 1)] + [f"u{q}[0][i]" for q in range(1, order)]
    moving, rates = differentiated(order)
    sources = {each.output: str(each.terms[0]) for each in plain.steps if each.kind == "primitive"}
    # du_q/dt = H_q - F_q, H_q being what u_q is the primitive of
    moved = [f"{rates[f'F{q}']}[i]" for q in range(1, order + 1)]
    moved += [f"{rates[f'u{q}']}[0][i] + turn * ({sources[f'u{q}']}[0][i] - F{q}[i])" for q in range(1, order)]

    def made(name: str, steps: Program, results: list[str], inputs: int, tangent: Tangent, direction: bool) -> Routine:
        most = max(len(each.terms) for each in steps.steps if each.kind == "field")
        helpers = tuple(_derivative(name, namespace, field, size, count) for count in range(most + 1))
        views = [Definition(_view(each, steps, [helper.symbol for helper in helpers])) for each in steps.steps]
        lines = [f"{array}[M][N]" for array in steps.arrays] + [f"{mean}[N]" for mean in steps.means]
        settings = (
            ("key", key), ("size", size), ("order", order), ("nodes", nodes), ("period", repr(period)), ("direction", direction),
            ("primitive", tuple(repr(float(p)) for p in primitive(nodes))), ("arrays", tuple(lines)),
            ("steps", tuple(views)), ("results", tuple(results)),
        )  # fmt: skip

        def twin(values: Sequence[float]) -> Array:
            given = np.asarray(values, dtype=float)
            known = run_program(steps, field, given, size, period, nodes)
            if not direction:
                return np.concatenate(
                    [known[each] for each in _names(order)[0]] + [known[each][0] for each in _names(order)[1]]
                )
            slow = [known[rates[each]] for each in _names(order)[0]]
            turn, fast = given[2 * size + 1], []
            for q in range(1, order):
                fast.append(known[rates[f"u{q}"]][0] + turn * (known[sources[f"u{q}"]][0] - known[f"F{q}"]))
            return np.concatenate([*slow, *fast])

        outputs = (2 * order - 1) * size
        return Routine(name, inputs, outputs, "time_average.c.jinja", settings, helpers, twin, tangent)

    rate = made(f"{name}_tangent", moving, moved, 2 * size + 2, no_tangent, True)

    def tangent(ops: Any, inputs: Sequence[Scalar], outputs: Sequence[Scalar], rates: Sequence[Scalar]) -> list[Scalar]:
        return call_routine(ops, rate, [*inputs, *(ops.constant(0) + each for each in rates)])

    return made(name, plain, results, size + 1, tangent, False)


def _names(order: int) -> tuple[list[str], list[str]]:
    return [f"F{q}" for q in range(1, order + 1)], [f"u{q}" for q in range(1, order)]


def _derivative(name: str, namespace: str, field: FieldBody, size: int, count: int) -> Kernel:
    """D^count f at (z, t) along directions, each with its component along eps."""
    ports = tuple(port for v in "abcd"[:count] for port in (Port(v, (size,)), Port(f"{v}_eps", ())))

    def body(ops: Arithmetic, z: Any, t: Any, *given: Any) -> tuple[Any, ...]:
        directions = [[*given[2 * i], given[2 * i + 1]] for i in range(count)]
        return (along(field, ops, [*z, ops.constant(0)], [t], *directions),)

    inputs = (Port("z", (size,)), Port("t", ()), *ports)
    return Kernel(f"{name}_d{count}", namespace, inputs, (Port("f", (size,)),), body)


def _view(step: Step, steps: Program, symbols: Sequence[str]) -> dict[str, Any]:
    """A step as the template reads it."""
    view: dict[str, Any] = {"kind": step.kind, "output": step.output, "mean": step.mean}
    if step.kind == "field":
        return view | {"helper": symbols[len(step.terms)], "inputs": indexed(step.terms, [*steps.means, "v"])}
    if step.kind == "sum":
        return view | {"expression": " + ".join(f"({factor!r}) * {array}[j][i]" for factor, array in step.terms)}
    return view | {"inputs": step.terms[0]}


def run_program(steps: Program, field: FieldBody, values: Array, n: int, period: float, nodes: int) -> dict[str, Array]:
    """The arrays and the means by Python; `values` are z, t and, of a derivative, the direction of z."""
    ops, z, t = FloatArithmetic(), values[:n], float(values[n])
    shift = period * primitive(nodes)[(np.arange(nodes)[:, None] - np.arange(nodes)) % nodes]
    found: dict[str, Array] = {"v": values[n + 1 : 2 * n + 1]}
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
    return found
