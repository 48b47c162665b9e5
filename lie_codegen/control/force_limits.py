"""Limits of a force as numbers of a law, and any law with its force clipped to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from lie_codegen.errors import ShapeError
from lie_codegen.exact.positive_matrix import positive_number
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.parameter import Parameter, input_ports, parameter, sample_inputs, values_of
from lie_codegen.kernel.saturation import saturated
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
