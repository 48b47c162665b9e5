"""Kernel: the frozen record between mathematics and code, the only thing the code generator takes."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import prod
from typing import Any

from lie_codegen.errors import InputError, ShapeError
from lie_codegen.identifiers import check_identifier
from lie_codegen.kernel.arithmetic import Arithmetic

#: body(ops, *inputs) -> outputs; vectors are lists, matrices lists of rows, scalars plain scalars.
Body = Callable[..., tuple[Any, ...]]
#: sampler(rng) -> one admissible value for each input, in Python floats (or Complex for complex ports).
Sampler = Callable[[random.Random], tuple[Any, ...]]


@dataclass(frozen=True)
class Port:
    """A named input or output.

    Attributes:
        name: C identifier, unique within the kernel.
        shape: () for a scalar, (n,) for a vector, (r, c) for a matrix (row-major in numpy and in C).
        units: text for the generated documentation, one for the port or one a component.
        is_complex: complex entries; C sees them interleaved (re, im), as numpy's complex128 lies in memory.
        description: one line for the generated documentation.
    """

    name: str
    shape: tuple[int, ...]
    units: str = ""
    is_complex: bool = False
    description: str = ""

    def __post_init__(self) -> None:
        check_identifier(self.name, "port name")
        if len(self.shape) > 2 or any(side < 1 for side in self.shape):
            raise ShapeError(f"port {self.name!r}: shape {self.shape} is not (), (n,) or (r, c) with positive sides")

    @property
    def size(self) -> int:
        """Number of doubles in C."""
        return prod(self.shape) * (2 if self.is_complex else 1)


@dataclass(frozen=True)
class Kernel:
    """A function with named, shaped inputs and outputs, written once over an abstract arithmetic.

    Attributes:
        name: C identifier; the attribute of the compiled library.
        namespace: prefix of the C symbol, usually the group's name: the symbol is namespace_name.
        inputs, outputs: the ports, in order.
        body: body(ops, *inputs) -> tuple of outputs; see `lie_codegen.kernel.arithmetic`.
        formula: the identity it computes, in plain text.
        source: where the formula comes from, with its equation number.
        sampler: admissible inputs for test vectors; uniform in [-1, 1] when None.
    """

    name: str
    namespace: str
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    body: Body = field(compare=False)
    formula: str = ""
    source: str = ""
    sampler: Sampler | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        check_identifier(self.name, "kernel name")
        check_identifier(self.symbol, "kernel symbol")
        names = [port.name for port in self.inputs + self.outputs]
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise InputError(f"kernel {self.symbol}: port names repeated: {', '.join(repeated)}; rename one of each")
        if not self.outputs:
            raise InputError(f"kernel {self.symbol} has no output")

    @property
    def symbol(self) -> str:
        """The C symbol."""
        return f"{self.namespace}_{self.name}"

    def evaluate(self, ops: Arithmetic, *arguments: Any) -> tuple[Any, ...]:
        """Run the body in the given arithmetic."""
        return self.body(ops, *arguments)

    def sample(self, rng: random.Random) -> tuple[Any, ...]:
        """One admissible value for each input."""
        return self.sampler(rng) if self.sampler else tuple(uniform_sample(port, rng) for port in self.inputs)


def uniform_sample(port: Port, rng: random.Random) -> Any:
    """Entries uniform in [-1, 1], in the port's shape."""
    from lie_codegen.kernel.complex_scalar import Complex

    def draw() -> Any:
        return Complex(rng.uniform(-1, 1), rng.uniform(-1, 1)) if port.is_complex else rng.uniform(-1, 1)

    return _fill(port.shape, draw)


def _fill(shape: Sequence[int], draw: Callable[[], Any]) -> Any:
    if not shape:
        return draw()
    return [_fill(shape[1:], draw) for _ in range(shape[0])]
