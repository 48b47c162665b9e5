"""Signatures: what remains of a kernel once it is compiled; plain data that travels as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from lie_codegen.kernels.kernel import Kernel, Port


@dataclass(frozen=True)
class Signature:
    """Name, C symbol, ports and documentation of a compiled kernel."""

    name: str
    symbol: str
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    formula: str = ""
    source: str = ""

    @staticmethod
    def of(kernel: Kernel) -> Signature:
        """The signature of a kernel."""
        return Signature(kernel.name, kernel.symbol, kernel.inputs, kernel.outputs, kernel.formula, kernel.source)

    def to_json(self) -> dict[str, Any]:
        """As a JSON object."""
        return asdict(self)

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
        )


def _ports(data: Sequence[dict[str, Any]]) -> tuple[Port, ...]:
    return tuple(Port(**{**port, "shape": tuple(port["shape"])}) for port in data)
