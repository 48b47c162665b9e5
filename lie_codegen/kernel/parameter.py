"""Numbers of a law or a body: compiled in, or inputs of the kernel.

inertia=(1, 2, 3)      the number stands in the C code, and is named in the header
inertia="input"        a port `inertia`, (3, 3): one library serves every body, a batch a Monte Carlo
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.kernel import Port
from lie_codegen.kernel.linear import constant_matrix, number

#: What a caller writes in place of a number that is to be an input.
INPUT = "input"


@dataclass(frozen=True)
class Parameter:
    """A number or a symmetric matrix by name.

    Attributes:
        port: its name, shape, units and description.
        value: exact; None for an input.
    """

    port: Port
    value: Any


def parameter(port: Port, value: Any, read: Callable[[Any, str], Any], *, tunable: bool = False) -> Parameter:
    """The parameter of that port.

    Args:
        port: its name and shape.
        value: a number, or "input".
        read: (value, name) -> the exact value; refuses what it cannot be.
        tunable: an input whatever the value, which is checked all the same if there is one.
    """
    if isinstance(value, str) and value == INPUT:
        return Parameter(port, None)
    if tunable and value is None:
        return Parameter(port, None)
    exact = read(value, port.name)
    return Parameter(port, None if tunable else exact)


def input_ports(parameters: Sequence[Parameter]) -> tuple[Port, ...]:
    """The ports of those that are inputs, in order; they stand behind the other inputs of a kernel."""
    return tuple(each.port for each in parameters if each.value is None)


def values_of(ops: Arithmetic, parameters: Sequence[Parameter], given: Sequence[Any]) -> list[Any]:
    """All of them as scalars and matrices: the compiled ones as constants, the others from the inputs `given`."""
    rest = iter(given)
    return [
        next(rest) if each.value is None
        else constant_matrix(ops, each.value) if each.port.shape
        else number(ops, each.value)
        for each in parameters
    ]  # fmt: skip


def sample_inputs(parameters: Sequence[Parameter], rng: random.Random) -> tuple[Any, ...]:
    """Admissible values of the inputs: positive numbers, and positive diagonal matrices."""

    def draw(shape: tuple[int, ...]) -> Any:
        if not shape:
            return rng.uniform(0.5, 2)
        return [[rng.uniform(1, 1.5) if i == j else 0.0 for j in range(shape[1])] for i in range(shape[0])]

    return tuple(draw(port.shape) for port in input_ports(parameters))
