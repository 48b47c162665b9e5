"""A kernel as a CasADi Function in CasADi's own shapes, for problems that the user writes in CasADi."""

from __future__ import annotations

from typing import Any

from lie_codegen.errors import InputError
from lie_codegen.kernel.casadi_arithmetic import CasadiArithmetic, flatten
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.on_demand import casadi as ca


def casadi_function(kernel: Kernel) -> ca.Function:
    """The kernel as a `casadi.Function` with the names of its ports, to be called with DM, SX or MX in the user's own NLP.

    A scalar port is 1 x 1, a vector (n,) is n x 1, a matrix (r, c) is r x c, all dense. Complex entries stand as neighbours
    (re, im) in a row, as NumPy sees them through `X.view(float)`: a complex scalar is 2 x 1, a vector 2n x 1, a matrix r x 2c.

    CasADi differentiates the Function, to any order where the kernel holds no loop that C alone knows, as logarithms by iterations.
    C for flight comes from `build` and `generate`, their derivatives from `jacobian`.

    Raises:
        InputError: what is given is no Kernel.
    """
    if not isinstance(kernel, Kernel):
        raise InputError(
            f"casadi_function takes a Kernel, got {type(kernel).__name__}; those of a group: lc.group_kernels"
        )
    symbols = [ca.SX.sym(port.name, *_shape(port)) for port in kernel.inputs]
    arguments = [_value(port, symbol) for port, symbol in zip(kernel.inputs, symbols, strict=True)]
    results = kernel.evaluate(CasadiArithmetic(differentiated=True), *arguments)
    outputs = [_matrix(port, value) for port, value in zip(kernel.outputs, results, strict=True)]
    names = [port.name for port in kernel.inputs], [port.name for port in kernel.outputs]
    return ca.Function(ca.Function.fix_name(kernel.symbol), symbols, outputs, *names, {"cse": True})


def _shape(port: Port) -> tuple[int, int]:
    parts = 2 if port.is_complex else 1
    if len(port.shape) == 2:
        return port.shape[0], parts * port.shape[1]
    return port.size, 1


def _value(port: Port, symbol: ca.SX) -> Any:
    """The symbols nested as a body takes them."""
    if len(port.shape) == 2:
        return [_paired(port, ca.horzsplit(symbol[i, :])) for i in range(port.shape[0])]
    entries = _paired(port, ca.vertsplit(symbol))
    return entries if port.shape else entries[0]


def _paired(port: Port, entries: list[Any]) -> list[Any]:
    if not port.is_complex:
        return entries
    return [Complex(re, im) for re, im in zip(entries[::2], entries[1::2], strict=True)]


def _matrix(port: Port, value: Any) -> ca.SX:
    rows, columns = _shape(port)
    flat = ca.vertcat(*[ca.SX(entry) for entry in flatten(port, value)])
    return ca.densify(ca.reshape(flat, columns, rows).T)  # CasADi fills columns first, the flat list rows first
