"""Signatures: what remains of a kernel once it is compiled; plain data that travels as JSON."""

from __future__ import annotations

import keyword
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from lie_codegen.kernel.kernel import Kernel, Port


@dataclass(frozen=True)
class Signature:
    """Name, C symbol, ports and documentation of a compiled kernel; `real`: "double", or "float" where it computes in floats."""

    name: str
    symbol: str
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    formula: str = ""
    source: str = ""
    real: str = "double"

    @staticmethod
    def of(kernel: Kernel, real: str = "double") -> Signature:
        """The signature of a kernel."""
        return Signature(kernel.name, kernel.symbol, kernel.inputs, kernel.outputs, kernel.formula, kernel.source, real)

    def to_json(self) -> dict[str, Any]:
        """As a JSON object."""
        data = asdict(self)
        if self.real == "double":
            del data["real"]  # what was written before floats were is still found
        return data

    @staticmethod
    def from_json(data: dict[str, Any]) -> Signature:
        """From a JSON object."""
        return Signature(
            name=data["name"],
            symbol=data["symbol"],
            inputs=_ports(data["inputs"]),
            outputs=_ports(data["outputs"]),
            formula=data["formula"],
            source=data["source"],
            real=data.get("real", "double"),
        )


def is_step(inputs: Sequence[Port], outputs: Sequence[Port]) -> bool:
    """Whether the first output has the type of the first input, so that the kernel can be iterated."""
    if not inputs:
        return False
    state, after = inputs[0], outputs[0]
    return (state.shape, state.is_complex) == (after.shape, after.is_complex)


def python_field(name: str) -> str:
    """The name of an output as an attribute of a Python result."""
    return f"{name}_" if keyword.iskeyword(name) else name


def _ports(data: Sequence[dict[str, Any]]) -> tuple[Port, ...]:
    return tuple(Port(**{**port, "shape": tuple(port["shape"])}) for port in data)
