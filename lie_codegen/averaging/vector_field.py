"""Vector fields that users write as formulas, and their derivatives along directions, over any arithmetic."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from lie_codegen.errors import InputError
from lie_codegen.identifiers import check_identifier
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.dual import DualArithmetic, tangent_of
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.mechanics.formulas import formula, parameter_values
from lie_codegen.on_demand import sympy as sp

#: body(ops, variables, others) -> the components.
FieldBody = Callable[[Arithmetic, Sequence[Scalar], Sequence[Scalar]], list[Scalar]]


def read_formulas(
    formulas: Sequence[Any],
    variables: Sequence[str],
    others: Sequence[str],
    parameters: Mapping[str, Any] | None,
    what: str,
) -> tuple[sp.Expr, ...]:
    """Expressions in real symbols of those names, parameters replaced by their exact values.

    Raises:
        InputError: no formula, a name twice, a parameter that hides a variable or has no value.
        ExpressionError: a text outside the grammar, with its column.
    """
    if isinstance(formulas, str) or not len(formulas):
        raise InputError(f"{what}: a list of formulas is needed, one a variable, got {formulas!r}")
    names = [*variables, *others]
    if isinstance(variables, str) or len(set(names)) != len(names):
        raise InputError(f"{what}: the names {', '.join(map(str, names))} must be different, given as a list")
    for name in names:
        check_identifier(name, f"{what}: variable")
    values = parameter_values(parameters)
    hidden, unset = sorted(set(names) & set(values)), sorted(k for k, v in values.items() if v.is_Symbol)
    if hidden:
        raise InputError(f"{what}: the parameter {hidden[0]!r} hides a variable; rename it")
    if unset:
        raise InputError(f"{what}: the parameter {unset[0]!r} has no value")
    known = {name: sp.Symbol(name, real=True) for name in names}
    return tuple(formula(each, {**known, **values}, f"{what}: component {i + 1}") for i, each in enumerate(formulas))


def formula_field(expressions: Sequence[sp.Expr], variables: Sequence[str], others: Sequence[str]) -> FieldBody:
    """The field of expressions in those symbols."""
    symbols = [sp.Symbol(name, real=True) for name in (*variables, *others)]

    def body(ops: Arithmetic, y: Sequence[Scalar], rest: Sequence[Scalar]) -> list[Scalar]:
        evaluate = ExpressionEvaluator(ops, dict(zip(symbols, (*y, *rest), strict=True)))
        return [evaluate(each) for each in expressions]

    return body


def along(
    field: FieldBody, ops: Arithmetic, y: Sequence[Scalar], others: Sequence[Scalar], *directions: Sequence[Scalar]
) -> list[Scalar]:
    """The derivative of the field along one direction, or the mixed derivative along several: D^m f [a, b, ..].

    Each direction is a nilpotent number of its own level, so that the last coefficient is the multilinear form exactly.
    """
    point, levels, arithmetic = list(y), [], ops
    for direction in directions:
        arithmetic = DualArithmetic(arithmetic)
        levels.append(arithmetic.level)
        point = [arithmetic.variable(value, {0: rate}) for value, rate in zip(point, direction, strict=True)]
    values = field(arithmetic, point, others)
    for level in reversed(levels):
        values = [tangent_of(value, 0, level) for value in values]
    return values
