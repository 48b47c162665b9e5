"""What a compiled kernel says of itself: docstring, signature and prototype."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lie_codegen.codegen.signature import Signature, python_field
from lie_codegen.runtime.arguments import describe, dtype_of

if TYPE_CHECKING:
    import inspect


def python_signature(signature: Signature) -> inspect.Signature:
    """The ports as parameters."""
    import inspect

    inputs = [
        inspect.Parameter(
            python_field(port.name), inspect.Parameter.POSITIONAL_OR_KEYWORD, annotation=f"{describe(port)}"
        )
        for port in signature.inputs
    ]
    out = inspect.Parameter("out", inspect.Parameter.KEYWORD_ONLY, default=None)
    returned = ", ".join(f"{port.name}: {describe(port)}" for port in signature.outputs)
    return inspect.Signature([*inputs, out], return_annotation=returned)


def documentation(signature: Signature) -> str:
    """The docstring of a compiled kernel."""
    lines = [prototype(signature), "", signature.formula, ""]
    for port in signature.inputs + signature.outputs:
        units = f" [{port.units}]" if port.units else ""
        about = f": {port.description}" if port.description else ""
        lines.append(f"{port.name}: {describe(port)}, {dtype_of(port, signature.real)}{units}{about}")
    if signature.source:
        lines += ["", f"Source: {signature.source}"]
    return "\n".join(lines)


def prototype(signature: Signature) -> str:
    """name(inputs) -> outputs, with shapes."""
    inputs = ", ".join(f"{port.name} {port.shape}" for port in signature.inputs)
    outputs = ", ".join(f"{port.name} {port.shape}" for port in signature.outputs)
    return f"{signature.name}({inputs}) -> {outputs}"
