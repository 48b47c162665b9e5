"""Kernels of a periodic orbit: the flow and its variational equation, y' = f(y, t), M' = Df(y, t) M."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

from lie_codegen.averaging.vector_field import FieldBody, along, formula_field, read_formulas
from lie_codegen.errors import InputError
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port

NAMESPACE = "floquet"
_TIME = Port("t", (), "time unit")


@kernel_factory()
def formula_orbit_kernels(
    rates: Sequence[Any],
    variables: Sequence[str],
    numbers: Mapping[str, Any] | None = None,
    namespace: str = NAMESPACE,
) -> tuple[Kernel, ...]:
    """rate (y, t) -> f and variational (state, t) -> (f, Df M), state = (y, M by rows), of formulas in the variables and t."""
    if len(rates) != len(variables):
        raise InputError(f"floquet: {len(rates)} formulas for the {len(variables)} variables {', '.join(variables)}")
    expressions = read_formulas(rates, variables, ("t",), numbers, "floquet")
    return _kernels(formula_field(expressions, variables, ("t",)), len(variables), namespace)


@kernel_factory()
def kernel_orbit_kernels(
    kernel: Kernel,
    inputs: Mapping[str, Any] | None = None,
    time: str = "t",
    clock: Any = 1,
    scale: Sequence[Any] | None = None,
    namespace: str = NAMESPACE,
) -> tuple[Kernel, ...]:
    """The same of a kernel whose first input is y, with an input for the time or none, and whose first output is y'.

    Args:
        kernel: of real ports.
        inputs: numbers for its other inputs, by name.
        time: name of its input of time, which is clock * t.
        clock: a number.
        scale: units of y, one an entry; the kernels then are of y in these units.
        namespace: of the C symbols.
    """
    state, *rest = kernel.inputs
    given = dict(inputs or {})
    missing = [port.name for port in rest if port.name != time and port.name not in given]
    if missing:
        raise InputError(f"floquet: {kernel.symbol} has the input {missing[0]!r}: give it in parameters=")
    if state.is_complex or state.shape != kernel.outputs[0].shape or len(state.shape) != 1:
        raise InputError(f"floquet: the first output of {kernel.symbol} must be the rate of its first input, a vector")

    def field(ops: Arithmetic, y: Sequence[Scalar], others: Sequence[Scalar]) -> list[Scalar]:
        now = others[0] * ops.constant(_number(clock))
        values = [now if port.name == time else _constant(ops, given[port.name]) for port in rest]
        if scale is None:
            return list(kernel.evaluate(ops, list(y), *values)[0])
        units = [ops.constant(_number(each)) for each in scale]
        found = kernel.evaluate(ops, [a * unit for a, unit in zip(y, units, strict=True)], *values)[0]
        return [a / unit for a, unit in zip(found, units, strict=True)]

    return _kernels(field, state.size, namespace)


def _constant(ops: Arithmetic, value: Any) -> Any:
    if isinstance(value, list | tuple):
        return [_constant(ops, each) for each in value]
    return ops.constant(_number(value))


def _number(value: Any) -> float:
    """A float, or the exact text that stands for it in a definition."""
    return float(Fraction(value)) if isinstance(value, str) else float(value)


def _kernels(field: FieldBody, n: int, namespace: str) -> tuple[Kernel, ...]:
    def rate(ops: Arithmetic, y: Sequence[Scalar], t: Scalar) -> tuple[Any, ...]:
        return (field(ops, y, [t]),)

    def variational(ops: Arithmetic, state: Sequence[Scalar], t: Scalar) -> tuple[Any, ...]:
        y, columns = state[:n], [[state[n + i * n + j] for i in range(n)] for j in range(n)]
        moved = [along(field, ops, y, [t], column) for column in columns]
        return ([*field(ops, y, [t]), *(moved[j][i] for i in range(n) for j in range(n))],)

    def jacobian(ops: Arithmetic, y: Sequence[Scalar], t: Scalar) -> tuple[Any, ...]:
        columns = [along(field, ops, y, [t], [int(i == j) for i in range(n)]) for j in range(n)]
        return ([[column[i] for column in columns] for i in range(n)],)

    def sample(rng: random.Random) -> tuple[Any, ...]:
        return [rng.uniform(-1, 1) for _ in range(n)], rng.uniform(0, 1)

    def sample_state(rng: random.Random) -> tuple[Any, ...]:
        y, t = sample(rng)
        return [*y, *(rng.uniform(-1, 1) for _ in range(n * n))], t

    y, size = Port("y", (n,)), n + n * n
    state = Port("state", (size,), description="y, then M by rows")
    return (
        Kernel("rate", namespace, (y, _TIME), (Port("y_dot", (n,)),), rate, "y' = f(y, t)", "", sample),
        Kernel("jacobian", namespace, (y, _TIME), (Port("Df", (n, n)),), jacobian, "Df(y, t)", "", sample),
        Kernel("variational", namespace, (state, _TIME), (Port("state_dot", (size,)),), variational,
               "y' = f(y, t), M' = Df(y, t) M", "", sample_state),
    )  # fmt: skip
