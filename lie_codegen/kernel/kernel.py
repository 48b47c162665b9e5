"""Kernel: the frozen record between mathematics and code, the only thing the code generator takes."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from lie_codegen.errors import InputError, ShapeError
from lie_codegen.identifiers import check_identifier
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.plain_data import Definition, made_from
from lie_codegen.values import settle

if TYPE_CHECKING:
    import random

#: body(ops, *inputs) -> outputs; vectors are lists, matrices lists of rows, scalars plain scalars.
Body = Callable[..., tuple[Any, ...]]
#: sampler(rng) -> one admissible value for each input, in Python floats (or Complex for complex ports).
Sampler: TypeAlias = "Callable[[random.Random], tuple[Any, ...]]"


@dataclass(frozen=True)
class Port:
    """A named input or output.

    Attributes:
        name: C identifier, unique within the kernel.
        shape: () for a scalar, (n,) for a vector, (r, c) for a matrix (row-major in numpy and in C).
        units: text for the generated documentation, one for the port or one a component.
        is_complex: complex entries; C sees them interleaved (re, im), as numpy's complex128 lies in memory.
        description: one line for the generated documentation.
        any_sign: of a number of a law that is an input: zero and negative values are allowed too, as of an offset or a coefficient.

    Raises:
        IdentifierError: name is no C identifier.
        ShapeError: a shape with more than two sides, or one below 1.
    """

    name: str
    shape: tuple[int, ...]
    units: str = ""
    is_complex: bool = False
    description: str = ""
    any_sign: bool = False

    def __post_init__(self) -> None:
        check_identifier(self.name, "port name")
        if len(self.shape) > 2 or any(side < 1 for side in self.shape):
            raise ShapeError(f"port {self.name!r}: shape {self.shape} is not (), (n,) or (r, c) with positive sides")

    @property
    def size(self) -> int:
        """Number of doubles in C."""
        return prod(self.shape) * (2 if self.is_complex else 1)


@dataclass(frozen=True, eq=False)
class Kernel:
    """A function with named, shaped inputs and outputs, written once over an abstract arithmetic.

    Kernels are values. One that a factory made (`kernel_factory`) has a `definition`, from which equality, hash, pickle,
    the cache key and the generated header follow, and from which it can be made again; its body and its sampler are derived and
    never compared. One that a user writes down (or changes by `dataclasses.replace`) has none: it equals another if all else
    is equal and the two bodies are one function, and it can be pickled if its body is a function of a module.

    Attributes:
        name: C identifier; the attribute of the compiled library.
        namespace: prefix of the C symbol, usually the group's name: the symbol is namespace_name.
        inputs, outputs: the ports, in order.
        body: body(ops, *inputs) -> tuple of outputs; see `lie_codegen.kernel.arithmetic`.
        formula: the identity it computes, in plain text.
        source: where the formula comes from, with its equation number.
        sampler: admissible inputs for test vectors; uniform in [-1, 1] when None.
        definition: what it is, as plain data: kind, exact parameters, records; None for one written by hand.

    Raises:
        IdentifierError: name or symbol is no C identifier.
        InputError: two ports of one name, or no output.
    """

    name: str
    namespace: str
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    body: Body = field(repr=False)
    formula: str = ""
    source: str = ""
    sampler: Sampler | None = field(default=None, repr=False)
    #: Not an argument: `dataclasses.replace` makes another thing, of which this would no longer be true.
    definition: Definition | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        check_identifier(self.name, "kernel name")
        check_identifier(self.symbol, "kernel symbol")
        names = [port.name for port in self.inputs + self.outputs]
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise InputError(f"kernel {self.symbol}: port names repeated: {', '.join(repeated)}; rename one of each")
        if not self.outputs:
            raise InputError(f"kernel {self.symbol} has no output")

    def __repr__(self) -> str:
        """One line: <kernel se3.exp: x (6) -> X (4, 4)>; `help` and `inputs`, `outputs`, `formula` tell the rest."""

        def ports(each: tuple[Port, ...]) -> str:
            return ", ".join(
                f"{port.name} ({', '.join(map(str, port.shape))})" if port.shape else port.name for port in each
            )

        return f"<kernel {self.namespace}.{self.name}: {ports(self.inputs)} -> {ports(self.outputs)}>"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Kernel):
            return NotImplemented
        if self._record() != other._record() or self.definition != other.definition:
            return False
        return self.definition is not None or self.body is other.body

    def __hash__(self) -> int:
        return hash((self._record(), self.definition))

    def _record(self) -> tuple[Any, ...]:
        return self.name, self.namespace, self.inputs, self.outputs, self.formula, self.source

    def defined_by(self, definition: Definition) -> Kernel:
        """The same kernel with its definition, which must determine it.

        Args:
            definition: plain data, from which equality, hash and pickle follow.

        Returns:
            A new kernel; this one stays as it is.
        """
        made = replace(self)
        settle(made, definition=definition)
        return made

    def __copy__(self) -> Kernel:
        return self

    def __deepcopy__(self, _: Any) -> Kernel:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        if self.definition is not None:
            return made_from, (self.definition,)
        for function in (self.body, self.sampler):
            if function is not None and not _is_global(function):
                raise InputError(
                    f"the kernel {self.symbol} cannot travel: {getattr(function, '__qualname__', function)} is a function "
                    "inside another; make the kernel in a factory (@lc.kernel_factory), or write a function of a module"
                )
        record = (self.name, self.namespace, self.inputs, self.outputs, self.body, self.formula, self.source)
        return Kernel, (*record, self.sampler)

    def save(self, path: str | Path) -> Path:
        """Write its definition as an npz file from which `lc.load` makes it again; returns the path.

        Raises:
            InputError: it was written by hand or by a factory of the user's; those pickle.
            OutputFolderError, SystemRefusalError: the file cannot be written; what was there is untouched.
        """
        from lie_codegen.kernel.saved import save_definition  # what reads and writes files is imported by whoever saves

        return save_definition(self, path, f"the kernel {self.symbol}")

    @property
    def symbol(self) -> str:
        """The C symbol."""
        return f"{self.namespace}_{self.name}"

    def evaluate(self, ops: Arithmetic, *arguments: Any) -> tuple[Any, ...]:
        """Run the body in the given arithmetic; nothing is checked, for it runs inside others.

        Args:
            ops: exact, float, numpy, CasADi ...: see `lie_codegen.kernel.arithmetic`.
            arguments: one value a port, in their order: a scalar, a list of n, or a list of rows.
        """
        return self.body(ops, *arguments)

    def sample(self, rng: random.Random) -> tuple[Any, ...]:
        """One admissible value for each input.

        Args:
            rng: of Python's `random`, where its random numbers come from.
        """
        return self.sampler(rng) if self.sampler else tuple(uniform_sample(port, rng) for port in self.inputs)


def _is_global(function: Any) -> bool:
    """Whether a pickle can name it."""
    module, name = getattr(function, "__module__", None), getattr(function, "__qualname__", "")
    return getattr(sys.modules.get(module or ""), name, None) is function


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
