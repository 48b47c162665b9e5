"""Limits of a force: every component clipped by itself, or the whole vector shortened so that its direction stays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from lie_codegen.errors import ShapeError
from lie_codegen.exact.positive_matrix import positive_number
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector
from lie_codegen.kernel.parameter import Parameter, input_ports, parameter, sample_inputs, values_of
from lie_codegen.on_demand import sympy as sp


@kernel_factory()
def with_limits(law: Kernel, limits: Any, name: str | None = None) -> Kernel:
    """The same law with its first output, a force or velocity, clipped to +-limits component by component; "input" for an input.

    Raises:
        ShapeError: the first output is not a vector, or the limits have another length.
        InputError: a limit that is not positive.
    """
    if len(law.outputs[0].shape) != 1:
        raise ShapeError(f"{law.name}: the first output is not a vector, so it has no component limits")
    bounds, count, sampler = force_limits(limits, law.outputs[0].shape[0]), len(law.inputs), law.sampler

    def body(ops: Arithmetic, *arguments: Any) -> tuple[Any, ...]:
        first, *others = law.evaluate(ops, *arguments[:count])
        return saturated(ops, first, *values_of(ops, bounds, arguments[count:])), *others

    return replace(
        law,
        name=name or law.name,
        inputs=(*law.inputs, *input_ports(bounds)),
        body=body,
        formula=f"{law.formula}; clipped to +-limits",
        sampler=None if sampler is None else lambda rng: (*sampler(rng), *sample_inputs(bounds, rng)),
    )


def force_limits(limits: Any, size: int, name: str = "limits") -> tuple[Parameter, ...]:
    """Positive limits, one a component, as one parameter of that name; () for none.

    Raises:
        ShapeError, InputError: another length; a limit that is not positive.
    """
    if limits is None:
        return ()
    port = Port(name, (size,), description="largest magnitude of each component")
    return (parameter(port, limits, lambda value, _: read_limits(value, size, name)),)


def read_limits(limits: Any, size: int, name: str = "limits") -> list[sp.Expr]:
    """One number for all components or one each, exact.

    Raises:
        ShapeError, InputError: another length; a limit that is not positive.
    """
    many = (isinstance(limits, Sequence) and not isinstance(limits, str)) or hasattr(limits, "tolist")
    values = limits if many else [limits] * size
    if len(values) != size:
        raise ShapeError(f"{name}: {len(values)} limits for {size} components")
    return [positive_number(value, f"{name}[{i}]") for i, value in enumerate(values)]


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
