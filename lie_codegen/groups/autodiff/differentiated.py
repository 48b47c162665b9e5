"""What the doors to JAX and PyTorch share: a kernel compiled, its derivative kernels, and calls on arrays of any leading axes.

The derivative by one input is the kernel of all Jacobians by it, entry by entry (a complex entry counts as two: re, im). It is
a kernel like the first, so it has derivatives again: the doors differentiate to any order without knowing of it.
"""

from __future__ import annotations

import math
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.codegen.signature import Signature
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.groups.build import build
from lie_codegen.groups.jacobian import jacobian
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.runtime.call import Compiled


class Differentiated:
    """A kernel for a framework that differentiates.

    Attributes:
        kernel: what it computes.
        inputs, outputs: its ports.
    """

    def __init__(self, kernel: Kernel) -> None:
        self.kernel = kernel
        self.inputs, self.outputs = kernel.inputs, kernel.outputs

    @cached_property
    def compiled(self) -> Compiled[Any]:
        """The kernel in C, built when first called."""
        function: Compiled[Any] = build(self.kernel)[self.kernel.name]
        return function

    def by(self, place: int) -> Differentiated:
        """The Jacobians of all outputs by one input, each (entries, directions), or (directions,) for a scalar output."""
        return _derivative(self, place)

    def __call__(self, *arrays: Any) -> tuple[Array, ...]:
        """(..., *shape) of each output; the leading axes of the inputs broadcast."""
        given = [
            np.asarray(array, dtype=complex if port.is_complex else float)
            for array, port in zip(arrays, self.inputs, strict=True)
        ]
        leading = [array.shape[: array.ndim - len(port.shape)] for array, port in zip(given, self.inputs, strict=True)]
        batch = np.broadcast_shapes(*leading)
        flat = [
            np.ascontiguousarray(np.broadcast_to(array, (*batch, *port.shape))).reshape(-1, *port.shape)
            for array, port in zip(given, self.inputs, strict=True)
        ]
        found = self.compiled.batch(*flat)
        several = found if len(self.outputs) > 1 else (found,)
        return tuple(
            np.asarray(value).reshape((*batch, *port.shape)) for value, port in zip(several, self.outputs, strict=True)
        )

    def leading(self, shapes: list[tuple[int, ...]]) -> tuple[int, ...]:
        """The common leading axes of arrays of these shapes.

        Raises:
            ShapeError: naming the input whose last axes are not its port's, or the axes that do not broadcast.
        """
        axes = []
        for shape, port in zip(shapes, self.inputs, strict=True):
            cut = len(shape) - len(port.shape)
            if cut < 0 or tuple(shape[cut:]) != port.shape:
                raise ShapeError(
                    f"{self.kernel.name}: {port.name} has shape {tuple(shape)}; its last axes must be {port.shape}"
                )
            axes.append(tuple(shape[:cut]))
        try:
            return np.broadcast_shapes(*axes)
        except ValueError:
            raise ShapeError(f"{self.kernel.name}: leading axes {axes} do not broadcast") from None

    def bound(self, arguments: tuple[Any, ...], named: dict[str, Any]) -> list[Any]:
        """The inputs in order.

        Raises:
            InputError: one is missing, or is no input.
        """
        names = [port.name for port in self.inputs]
        values = {**dict(zip(names, arguments, strict=False)), **named}
        if len(arguments) > len(names) or set(values) != set(names) or set(named) & set(names[: len(arguments)]):
            raise InputError(f"{self.kernel.name} takes {', '.join(names)}, each once")
        return [values[name] for name in names]


@lru_cache(maxsize=256)
def _derivative(function: Differentiated, place: int) -> Differentiated:
    kernel, port = function.kernel, function.inputs[place]
    parts = [jacobian(kernel, port.name, output=each.name, tangent="entries") for each in kernel.outputs]

    def body(ops: Arithmetic, *arguments: Any) -> tuple[Any, ...]:
        return tuple(part.evaluate(ops, *arguments)[0] for part in parts)

    return Differentiated(
        Kernel(
            name=f"{kernel.name}_by_{port.name}",
            namespace=kernel.namespace,
            inputs=kernel.inputs,
            outputs=tuple(part.outputs[0] for part in parts),
            body=body,
            formula=f"derivatives of all outputs by {port.name}; {kernel.formula}",
            source=kernel.source,
            sampler=kernel.sample,
        )
    )


def directions(port: Port) -> int:
    """How many real numbers an input has."""
    return math.prod(port.shape) * (2 if port.is_complex else 1)


def kernel_of(function: Any, where: str) -> Kernel:
    """The Kernel itself, or the one that a compiled function was made from.

    Raises:
        InputError: it is neither.
    """
    if isinstance(function, Kernel):
        return function
    # a compiled function may be one of the extension type, which hands attributes through
    if isinstance(getattr(function, "signature", None), Signature):
        made: Kernel = function.kernel
        return made
    raise InputError(
        f"{where} takes a Kernel or a compiled function such as lc.build('so3').exp, got {type(function).__name__}"
    )
