"""The kernel arithmetic over CasADi SX, and Kernel -> casadi.Function."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from lie_codegen.errors import ShapeError
from lie_codegen.kernel.arithmetic import ROUNDOFF, FloatArithmetic
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.routine import Routine, Where


class CasadiArithmetic:
    """SX scalars; exact constants become the nearest doubles.

    Attributes:
        real: the type of the C that the graph is for.
        routines: whether a routine may stand for what a straight line cannot say; where it may not, that is NaN.
        differentiated: whether CasADi will differentiate the graph: of a choice it weighs the side that is not taken with zero, so that side
            has to be finite, with its derivatives.
    """

    def __init__(self, real: str = "double", *, routines: bool = True, differentiated: bool = False) -> None:
        self.unit_roundoff = ROUNDOFF[real]
        self.routines = routines
        self.differentiated = differentiated

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

    def call(self, routine: Routine, values: list[Any], when: Any = None) -> list[Any]:
        """A call inside the expression; its first argument is the routine's number, by which `routine_number` knows it."""
        function = _called(routine)
        condition = 1.0 if when is None else when
        result = function(_NUMBERS[routine], condition, ca.vertcat(*[ca.SX(value) for value in values]))
        return list(ca.vertsplit(ca.SX(result)))


class _RoutineFunction(ca.Callback):
    """A routine as a CasADi Function (number, condition, inputs) -> outputs, with its own derivative."""

    def __init__(self, routine: Routine) -> None:
        ca.Callback.__init__(self)
        self.routine = routine
        self.kept: list[Any] = []
        self.construct(ca.Function.fix_name(routine.name), {"never_inline": True})

    def get_n_in(self) -> int:
        return 3

    def get_n_out(self) -> int:
        return 1

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self.routine.inputs if i == 2 else 1, 1)

    def get_sparsity_out(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self.routine.outputs, 1)

    def eval(self, arguments: Any) -> list[Any]:
        values = np.array(arguments[2], dtype=np.float64).ravel()
        return [ca.DM(FloatArithmetic().call(self.routine, values.tolist(), float(arguments[1]) != 0.0))]

    def has_forward(self, count: int) -> bool:
        return True

    def get_forward(self, count: int, name: str, inames: Any, onames: Any, options: Any) -> ca.Function:
        number, condition = ca.SX.sym("number"), ca.SX.sym("condition")
        ops, routine = Where(CasadiArithmetic(differentiated=True), condition), self.routine
        inputs, outputs = ca.SX.sym("inputs", routine.inputs), ca.SX.sym("outputs", routine.outputs)
        rates = ca.SX.sym("rates", routine.inputs, count)
        unused = [ca.SX.sym("unused", 1, count), ca.SX.sym("unused", 1, count)]
        columns = []
        for k in range(count):
            seeds = ca.vertsplit(rates[:, k])
            moved = routine.tangent(ops, ca.vertsplit(inputs), ca.vertsplit(outputs), seeds)
            columns.append(ca.vertcat(*[ca.if_else(condition, ca.SX(entry), 0) for entry in moved]))
        result = ca.densify(ca.horzcat(*columns))
        function = ca.Function(
            name, [number, condition, inputs, outputs, *unused, rates], [result], inames, onames, {"cse": True}
        )
        self.kept.append(function)
        return function


def _choice(routine: Routine, graph: Callable[[], ca.Function]) -> ca.Function:
    """The same of a routine that CasADi can say itself: what the condition does not ask for is not run."""
    inputs = ca.SX.sym("inputs", routine.inputs)
    zeros = ca.Function("zeros", [inputs], [ca.SX(ca.DM.zeros(routine.outputs))])
    chosen = ca.Function.if_else("chosen", graph(), zeros)
    symbols = [ca.MX.sym("number"), ca.MX.sym("condition"), ca.MX.sym("inputs", routine.inputs)]
    return ca.Function(ca.Function.fix_name(routine.name), symbols, [chosen(*symbols[1:])], {"never_inline": True})


_FUNCTIONS: dict[Routine, ca.Function] = {}
_NUMBERS: dict[Routine, float] = {}
#: A number that no formula holds: were it one of its constants, the printed C would depend on what was derived before.
_FIRST_NUMBER = -(2.0**52)
_LOCK = threading.Lock()


def _called(routine: Routine) -> ca.Function:
    with _LOCK:
        if routine not in _FUNCTIONS:
            _NUMBERS[routine] = _FIRST_NUMBER + len(_NUMBERS)
            _FUNCTIONS[routine] = (
                _RoutineFunction(routine) if routine.graph is None else _choice(routine, routine.graph)
            )
        return _FUNCTIONS[routine]


def routine_number(number: float) -> Routine:
    """The routine that a call in an expression names by its first argument."""
    return next(routine for routine, each in _NUMBERS.items() if each == number)


def function_of(kernel: Kernel, real: str = "double", *, routines: bool = True) -> ca.Function:
    """The kernel as a CasADi Function of dense column vectors.

    Each port becomes one column vector of `port.size` entries in C order: row-major, complex entries as
    interleaved (re, im). No transposition is left to do in C or in numpy. `real`: the type of the C that it becomes; `routines`: see
    `CasadiArithmetic`.
    """
    symbols = [ca.SX.sym(port.name, port.size) for port in kernel.inputs]
    arguments = [_unflatten(port, ca.vertsplit(symbol)) for port, symbol in zip(kernel.inputs, symbols, strict=True)]
    results = kernel.evaluate(CasadiArithmetic(real, routines=routines), *arguments)
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
