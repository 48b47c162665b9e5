"""Numbers of a law or a body: compiled in, or inputs of the kernel.

inertia=(1, 2, 3)      the number stands in the C code, and is named in the header
inertia="input"        a port `inertia`, (3, 3): one library serves every body, a batch a Monte Carlo
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from lie_codegen.errors import InputError
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.kernel import Port
from lie_codegen.kernel.linear import constant_matrix, number
from lie_codegen.on_demand import sympy as sp

#: What a caller writes in place of a number that is to be an input.
INPUT = "input"


def is_input(value: Any) -> bool:
    """Whether it is the word "input"; an array never is."""
    return isinstance(value, str) and value == INPUT


@dataclass(frozen=True)
class Parameter:
    """A number, a vector or a symmetric matrix by name.

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
    if is_input(value):
        return Parameter(port, None)
    if tunable and value is None:
        return Parameter(port, None)
    exact = read(value, port.name)
    return Parameter(port, None if tunable else exact)


def refuse_input(value: Any, name: str, why: str) -> None:
    """Refuses the word "input" where a number shapes the kernel itself.

    Raises:
        InputError: with the reason.
    """
    if is_input(value):
        raise InputError(f'{name} cannot be "input": {why}')


def input_ports(parameters: Sequence[Parameter]) -> tuple[Port, ...]:
    """The ports of those that are inputs, in order; they stand behind the other inputs of a kernel."""
    return tuple(each.port for each in parameters if each.value is None)


def values_of(ops: Arithmetic, parameters: Sequence[Parameter], given: Sequence[Any]) -> list[Any]:
    """All of them as scalars, vectors and matrices: the compiled ones as constants, the others from the inputs `given`."""
    rest = iter(given)
    return [
        next(rest) if each.value is None
        else constant_matrix(ops, each.value) if len(each.port.shape) == 2
        else [number(ops, entry) for entry in each.value] if each.port.shape
        else number(ops, each.value)
        for each in parameters
    ]  # fmt: skip


def input_symbols(port: Port) -> sp.Symbol | sp.ImmutableMatrix:
    """What stands for the port in a formula: a symbol, or a symmetric matrix of them, of which the upper triangle is read."""
    if not port.shape:
        return sp.Symbol(port.name)
    return sp.ImmutableMatrix(*port.shape, lambda i, j: sp.Symbol(f"{port.name}[{min(i, j) + 1},{max(i, j) + 1}]"))


def symbol_values(ports: Sequence[Port], given: Sequence[Any]) -> dict[sp.Symbol, Any]:
    """The value of each of these symbols, from the values of the ports."""
    found: dict[sp.Symbol, Any] = {}
    for port, value in zip(ports, given, strict=True):
        symbols = input_symbols(port)
        if isinstance(symbols, sp.Symbol):
            found[symbols] = value
        else:
            size = range(port.shape[0])
            found |= {symbols[i, j]: value[i][j] for i in size for j in size if i <= j}
    return found


def check_numbers(ports: Sequence[Port]) -> dict[sp.Symbol, sp.Expr]:
    """Positive fractions for the symbols of inputs, at which a formula is checked.

    The denominators are primes: an identity between polynomials in the inputs that holds at such a point is none by chance, as little as at the
    random points of the other variables; a diagonal matrix of different entries has no symmetry that could hide a term.
    """
    numbers: list[Any] = []
    for place, port in enumerate(ports):
        first = sp.Rational(101 + 7 * place, 97)
        size = port.shape[0] if port.shape else 0
        numbers.append(sp.diag(*[first + sp.Rational(i, 89) for i in range(size)]).tolist() if size else first)
    return symbol_values(ports, numbers)


def sample_inputs(parameters: Sequence[Parameter], rng: random.Random) -> tuple[Any, ...]:
    """Admissible values of those that are inputs; see `sample_ports`."""
    return sample_ports(input_ports(parameters), rng)


def sample_ports(ports: Sequence[Port], rng: random.Random) -> tuple[Any, ...]:
    """Admissible values of the inputs: positive numbers, also in a vector, and positive diagonal matrices."""

    def draw(shape: tuple[int, ...]) -> Any:
        if not shape:
            return rng.uniform(0.5, 2)
        if len(shape) == 1:
            return [rng.uniform(0.5, 2) for _ in range(shape[0])]
        return [[rng.uniform(1, 1.5) if i == j else 0.0 for j in range(shape[1])] for i in range(shape[0])]

    return tuple(draw(port.shape) for port in ports)
