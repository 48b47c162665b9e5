"""Disturbances beside the command of a law: formulas of t, X and xi, or a Kernel."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.expression import FORMULA_FUNCTIONS, parse_expression, time_symbol
from lie_codegen.exact.positive_matrix import real_number
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector
from lie_codegen.on_demand import sympy as sp

#: (ops, t, X, xi) -> (n,) body force.
ForceBody = Callable[[Arithmetic, Scalar, Any, Vector], Vector]

_READS = {"t": "t", "X": "X", "q": "X", "xi": "xi", "omega": "xi", "q_dot": "xi"}


def disturbance_body(plant: Any, disturbance: Any) -> ForceBody:
    """The disturbance as a function over any arithmetic.

    Raises:
        ShapeError: another number of components than the command has.
        InputError: a kernel with inputs other than t, X and xi.
        ExpressionError: a text outside the grammar, with the column.
    """
    element, velocity = plant.ports
    size = plant.sizes[2]
    if isinstance(disturbance, Kernel):
        return _of_kernel(disturbance, size)
    if len(disturbance) != size:
        raise ShapeError(f"closed_loop: the disturbance has {len(disturbance)} components, the command {size}")
    names, arrays = symbols_of(element, velocity)
    formulas = [
        parse_expression(each, names, FORMULA_FUNCTIONS, arrays)
        if isinstance(each, str)
        else real_number(each, "disturbance")
        for each in disturbance
    ]

    def force(ops: Arithmetic, t: Scalar, X: Any, xi: Vector) -> Vector:
        evaluate = ExpressionEvaluator(ops, values_of_symbols(arrays, t, X, xi))
        return [evaluate(formula) for formula in formulas]

    return force


def symbols_of(
    element: Port, velocity: Port | None
) -> tuple[dict[str, sp.Expr], dict[str, dict[tuple[int, ...], sp.Expr]]]:
    """Names and entries of arrays that formulas of (t, X, xi) may hold; X11, xi1, q1 count from 1, X[0][0] from 0.

    Raises:
        InputError: the elements are complex.
    """
    if element.is_complex:
        raise InputError("formulas of X are for real groups; give a Kernel for a complex one")
    arrays: dict[str, dict[tuple[int, ...], sp.Expr]] = {}
    names: dict[str, sp.Expr] = {"t": time_symbol(), "pi": sp.pi}
    if len(element.shape) == 2:
        places = [(i, j) for i in range(element.shape[0]) for j in range(element.shape[1])]
        arrays["X"] = {(i, j): sp.Symbol(f"X_{i}_{j}", real=True) for i, j in places}
        if max(element.shape) < 10:
            names |= {f"X{i + 1}{j + 1}": symbol for (i, j), symbol in arrays["X"].items()}
    else:
        arrays["X"] = {(i,): sp.Symbol(f"X_{i}", real=True) for i in range(element.shape[0])}
        names |= {f"q{i + 1}": symbol for (i,), symbol in arrays["X"].items()}
        arrays["q"] = arrays["X"]
    if velocity is not None:
        arrays["xi"] = {(i,): sp.Symbol(f"xi_{i}", real=True) for i in range(velocity.shape[0])}
        for word in ("xi", "omega", "dq"):
            names |= {f"{word}{i + 1}": symbol for (i,), symbol in arrays["xi"].items()}
    return names, arrays


def values_of_symbols(
    arrays: Mapping[str, Mapping[tuple[int, ...], sp.Expr]], t: Scalar, X: Any, xi: Sequence[Scalar]
) -> dict[sp.Symbol, Scalar]:
    """What the symbols of `symbols_of` stand for."""
    values: dict[Any, Scalar] = {time_symbol(): t}
    for place, symbol in arrays["X"].items():
        values[symbol] = X[place[0]][place[1]] if len(place) == 2 else X[place[0]]
    values |= {symbol: xi[place[0]] for place, symbol in arrays.get("xi", {}).items()}
    return values


def _of_kernel(kernel: Kernel, size: int) -> ForceBody:
    unknown = [port.name for port in kernel.inputs if port.name not in _READS]
    if unknown or kernel.outputs[0].shape != (size,):
        said = f"reads {', '.join(unknown)}" if unknown else f"gives {kernel.outputs[0].shape}"
        raise InputError(f"closed_loop: the disturbance {kernel.name} {said}; it maps some of t, X, xi to ({size},)")

    def force(ops: Arithmetic, t: Scalar, X: Any, xi: Vector) -> Vector:
        given = {"t": t, "X": X, "xi": xi}
        found = kernel.evaluate(ops, *(given[_READS[port.name]] for port in kernel.inputs))
        return list(found[0])

    return force
