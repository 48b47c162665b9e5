"""Feedback u(t, X) or u(t, g) for `lc.simulate`: told apart from inputs of time, and read from texts, a Kernel or a Python function."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.expression import FORMULA_FUNCTIONS, parse_expression, time_symbol
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.kernel.linear import Vector
from lie_codegen.on_demand import sympy as sp
from lie_codegen.runtime.formula_input import has_formula
from lie_codegen.values import Value

#: (ops, t, X, g) -> u; X or g is None where the feedback does not read it.
LawBody = Callable[[Arithmetic, Scalar, Any, Any], Vector]

_NAMES = re.compile(r"\b(X\d\d|X\s*\[|g\d+|g\s*\[)")


@dataclass(frozen=True)
class Feedback:
    """A feedback as it was given.

    Attributes:
        u: texts, a Kernel, or a Python function.
        reads: "X" or "g", the coordinates of the second kind, X = exp(g_1 A_1) ... exp(g_n A_n).
    """

    u: Any
    reads: str

    @property
    def slow(self) -> bool:
        """Whether Python is called at every stage of every step."""
        return not isinstance(self.u, Kernel | tuple)


def as_feedback(group: MatrixGroup, u: Any) -> Feedback | None:
    """The feedback that u is; None where it is an input of time alone.

    Texts that name entries of X (X[0][1], or X12 counted from 1) or coordinates g1 .. gn, a Kernel, or a function of two
    arguments, of which the second is called g where it is the coordinates.

    Raises:
        InputError: a kernel with other inputs, or texts that read both X and g. ShapeError: another number of components.
    """
    if isinstance(u, Kernel):
        names = [port.name for port in u.inputs]
        if not set(names) <= {"t", "X", "g"} or {"X", "g"} <= set(names):
            raise InputError(
                f"simulate({group.name}): the kernel {u.name} reads {', '.join(names)}; a feedback reads t, and X or g"
            )
        if u.outputs[0].shape != (group.dim,):
            raise ShapeError(
                f"simulate({group.name}): {u.outputs[0].name} of the kernel {u.name} has shape {u.outputs[0].shape}; it is u, "
                f"({group.dim},)"
            )
        return Feedback(u, "g" if "g" in names else "X")
    if isinstance(u, list | tuple) and any(isinstance(each, str) for each in u):
        found = {name[0] for each in u for name in _NAMES.findall(str(each))}
        if len(found) == 2:
            raise InputError(f"simulate({group.name}): a feedback reads X or the coordinates g, not both")
        return Feedback(tuple(map(str, u)), found.pop()) if found else None
    if callable(u) and not has_formula(u):
        second = _second_argument(u)
        return None if second is None else Feedback(u, "g" if second == "g" else "X")
    return None


def _second_argument(function: Any) -> str | None:
    """The name of the second of the arguments that must be given, None for a function of one."""
    if isinstance(function, Value):  # its class says it
        kind: Any = type(function)
        return _second_of_class(kind)
    try:
        return _second(inspect.signature(function))
    except (TypeError, ValueError):
        return None


@lru_cache(maxsize=64)
def _second_of_class(kind: Any) -> str | None:
    signature = inspect.signature(kind.__call__)
    return _second(signature.replace(parameters=list(signature.parameters.values())[1:]))


def _second(signature: inspect.Signature) -> str | None:
    parameters = signature.parameters.values()
    kinds = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    needed = [each.name for each in parameters if each.kind in kinds and each.default is inspect.Parameter.empty]
    return needed[1] if len(needed) == 2 else None


def feedback_body(group: MatrixGroup, u: Kernel | Sequence[str], reads: str) -> LawBody:
    """Texts or a kernel as a function over any arithmetic.

    Raises:
        ShapeError: not one formula for each basis element. ExpressionError: a text outside the grammar, with the column.
        InputError: texts that read the entries of complex matrices.
    """
    if isinstance(u, Kernel):
        kernel = u

        def of_kernel(ops: Arithmetic, t: Scalar, X: Any, g: Any) -> Vector:
            given = {"t": t, "X": X, "g": g}
            return list(kernel.evaluate(ops, *(given[port.name] for port in kernel.inputs))[0])

        return of_kernel
    if len(u) != group.dim:
        raise ShapeError(f"{group.name}: {len(u)} formulas given, one for each of {', '.join(group.labels)} is needed")
    if reads == "X" and group.is_complex:
        raise InputError(f"simulate({group.name}): formulas of X are for real groups; give a Kernel, or read g")
    names: dict[str, sp.Expr] = {"t": time_symbol(), "pi": sp.pi}
    entries: dict[tuple[int, ...], sp.Expr] = {}
    if reads == "g":
        entries = {(i,): sp.Symbol(f"g_{i}", real=True) for i in range(group.dim)}
        names |= {f"g{i + 1}": symbol for (i,), symbol in entries.items()}
    else:
        size = range(group.degree)
        entries = {(i, j): sp.Symbol(f"X_{i}_{j}", real=True) for i in size for j in size}
        names |= {f"X{i + 1}{j + 1}": symbol for (i, j), symbol in entries.items() if group.degree < 10}
    # a text that is a number stands in a definition as that number
    formulas = [parse_expression(str(each), names, FORMULA_FUNCTIONS, {reads: entries}) for each in u]

    def of_texts(ops: Arithmetic, t: Scalar, X: Any, g: Any) -> Vector:
        values: dict[Any, Scalar] = {time_symbol(): t}
        for place, symbol in entries.items():
            values[symbol] = g[place[0]] if reads == "g" else X[place[0]][place[1]]
        evaluate = ExpressionEvaluator(ops, values)
        return [evaluate(formula) for formula in formulas]

    return of_texts
