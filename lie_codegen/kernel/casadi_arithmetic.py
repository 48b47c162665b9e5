"""The kernel arithmetic over CasADi SX, and Kernel -> casadi.Function."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca

from lie_codegen.errors import ShapeError
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.kernel import Kernel, Port


class CasadiArithmetic:
    """SX scalars; exact constants become the nearest doubles."""

    def constant(self, value: Any) -> float:
        return float(value)

    sin: Callable[..., Any] = staticmethod(ca.sin)
    cos: Callable[..., Any] = staticmethod(ca.cos)
    tan: Callable[..., Any] = staticmethod(ca.tan)
    exp: Callable[..., Any] = staticmethod(ca.exp)
    expm1: Callable[..., Any] = staticmethod(ca.expm1)
    log: Callable[..., Any] = staticmethod(ca.log)
    sqrt: Callable[..., Any] = staticmethod(ca.sqrt)
    sinh: Callable[..., Any] = staticmethod(ca.sinh)
    cosh: Callable[..., Any] = staticmethod(ca.cosh)
    tanh: Callable[..., Any] = staticmethod(ca.tanh)
    acos: Callable[..., Any] = staticmethod(ca.acos)
    asin: Callable[..., Any] = staticmethod(ca.asin)
    atan: Callable[..., Any] = staticmethod(ca.atan)
    atan2: Callable[..., Any] = staticmethod(ca.atan2)
    fabs: Callable[..., Any] = staticmethod(ca.fabs)

    def less(self, a: Any, b: Any) -> Any:
        return ca.SX(a) < b

    def where(self, condition: Any, then: Any, otherwise: Any) -> Any:
        return ca.if_else(condition, then, otherwise)


def function_of(kernel: Kernel) -> ca.Function:
    """The kernel as a CasADi Function of dense column vectors.

    Each port becomes one column vector of `port.size` entries in C order: row-major, complex entries as
    interleaved (re, im). No transposition is left to do in C or in numpy.
    """
    symbols = [ca.SX.sym(port.name, port.size) for port in kernel.inputs]
    arguments = [_unflatten(port, ca.vertsplit(symbol)) for port, symbol in zip(kernel.inputs, symbols, strict=True)]
    results = kernel.evaluate(CasadiArithmetic(), *arguments)
    flat = [
        ca.densify(ca.vertcat(*[ca.SX(entry) for entry in flatten(port, value)]))
        for port, value in zip(kernel.outputs, results, strict=True)
    ]
    for port, entries in zip(kernel.outputs, flat, strict=True):
        if entries.numel() != port.size:
            raise ShapeError(
                f"kernel {kernel.symbol}: its body gives {entries.numel()} real numbers for the output {port.name}, "
                f"which is declared with {port.size}"
            )
    # CasADi forbids some C identifiers (two underscores in a row); its name for the function never reaches the C
    return ca.Function(
        ca.Function.fix_name(kernel.symbol),
        symbols,
        flat,
        [p.name for p in kernel.inputs],
        [p.name for p in kernel.outputs],
        {"cse": True},
    )


def flatten(port: Port, value: Any) -> list[Any]:
    """A nested port value as its flat C-order list of real scalars."""
    if len(port.shape) == 0:
        entries = [value]
    elif len(port.shape) == 1:
        entries = list(value)
    else:
        entries = [entry for row in value for entry in row]
    if not port.is_complex:
        return entries
    return [part for entry in entries for part in (Complex.of(entry).re, Complex.of(entry).im)]


def _unflatten(port: Port, entries: list[Any]) -> Any:
    if port.is_complex:
        entries = [Complex(re, im) for re, im in zip(entries[::2], entries[1::2], strict=True)]
    if len(port.shape) == 0:
        return entries[0]
    if len(port.shape) == 1:
        return entries
    columns = port.shape[1]
    return [entries[start : start + columns] for start in range(0, len(entries), columns)]
