"""Vector fields on a tangent bundle, exact: Lie brackets, symmetric products, homogeneity.

    [X, Y] = DY . X - DX . Y,   <Ya : Yb> = [Ya, [X, Yb]],

a field is homogeneous of degree p if [Delta, X] = p X with Delta = v d/dv: vertical lifts have degree -1, sprays
degree 1. Bullo, SIAM J. Control Optim. 41 (2002); Sanyal, Bloch and McClamroch, Definitions 1 and 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from lie_codegen.errors import InputError
from lie_codegen.on_demand import sympy as sp

#: Components along (q, v), a column.
Field: TypeAlias = "sp.ImmutableMatrix"


def lie_bracket(first: Field, second: Field, state: Sequence[sp.Symbol]) -> Field:
    """[X, Y] = DY . X - DX . Y."""
    variables = sp.Matrix(list(state))
    result = second.jacobian(variables) * first - first.jacobian(variables) * second
    return sp.ImmutableMatrix(result.applyfunc(tidy))


def symmetric_product(first: Field, second: Field, drift: Field, state: Sequence[sp.Symbol]) -> Field:
    """<Ya : Yb> = [Ya, [X, Yb]], symmetric for vertical lifts that depend on the configuration alone."""
    return lie_bracket(first, lie_bracket(drift, second, state), state)


#: Operations beyond which an expression is kept as it was derived: factoring grows faster than code does.
LARGEST_TIDIED = 800


def tidy(expression: sp.Expr) -> sp.Expr:
    """One fraction in lowest terms, factored, with cos^2 written 1 - sin^2 (and cosh^2 as 1 + sinh^2).

    Expressions of more than LARGEST_TIDIED operations stay as they are: exact, and shared subexpressions are computed
    once in code.
    """
    if expression.is_Number or expression.is_Symbol or sp.count_ops(expression) > LARGEST_TIDIED:
        return expression
    numerator, denominator = sp.fraction(sp.together(expression))
    return sp.factor(_without_squares(numerator) / _without_squares(denominator))


def _without_squares(polynomial: sp.Expr) -> sp.Expr:
    def lower(power: sp.Pow) -> sp.Expr:
        base, exponent = power.args
        square = 1 - sp.sin(base.args[0]) ** 2 if isinstance(base, sp.cos) else 1 + sp.sinh(base.args[0]) ** 2
        return square ** (exponent // 2) * base ** (exponent % 2)

    expanded = sp.expand(polynomial)
    return sp.expand(
        expanded.replace(
            lambda e: e.is_Pow and isinstance(e.base, sp.cos | sp.cosh) and e.exp.is_Integer and e.exp > 1, lower
        )
    )


def homogeneous_parts(field: Field, state: Sequence[sp.Symbol]) -> dict[int, Field]:
    """degree -> part; the field is polynomial in the velocities.

    Raises:
        InputError: if it is not.
    """
    half = len(state) // 2
    velocities = list(state[half:])
    parts: dict[int, list[sp.Expr]] = {}
    for row, entry in enumerate(field):
        try:
            polynomial = sp.Poly(entry, *velocities)
        except sp.PolynomialError as error:
            raise InputError(f"component {row + 1}, {entry}, is not polynomial in the velocities") from error
        if polynomial.free_symbols_in_domain & set(velocities):
            raise InputError(f"component {row + 1}, {entry}, is not polynomial in the velocities")
        for powers, coefficient in polynomial.terms():
            if coefficient == 0:
                continue
            degree = sum(powers) - (1 if row >= half else 0)
            term = coefficient * sp.Mul(*(v**p for v, p in zip(velocities, powers, strict=True)))
            part = parts.setdefault(degree, [sp.S.Zero] * len(state))
            part[row] += term
    return {degree: sp.ImmutableMatrix(part) for degree, part in sorted(parts.items())}


def is_vertical_lift(field: Field, state: Sequence[sp.Symbol]) -> bool:
    """Whether the field is of degree -1: no configuration components, no dependence on the velocities."""
    half = len(state) // 2
    return all(entry == 0 for entry in field[:half]) and not any(entry.has(*state[half:]) for entry in field[half:])


def pull_back_series(drift: Field, lift: Field, state: Sequence[sp.Symbol]) -> tuple[Field, Field, Field]:
    """(X, [Y, X], -<Y : Y>): the pull-back of X along the flow of s Y is their sum with 1, s, s^2 / 2.

    Raises:
        InputError: the series does not terminate: the drift is more than quadratic in the velocities, or Y is no lift.
    """
    if not is_vertical_lift(lift, state):
        raise InputError("an input field must be a vertical lift that depends on the configuration alone")
    highest = max(homogeneous_parts(drift, state), default=0)
    if highest > 1:
        raise InputError(
            f"the drift has a part of homogeneity degree {highest}: the pull-back series ends after two brackets "
            "only for drifts at most quadratic in the velocities"
        )
    return drift, lie_bracket(lift, drift, state), -symmetric_product(lift, lift, drift, state)
