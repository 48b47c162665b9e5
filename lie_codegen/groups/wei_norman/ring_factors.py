"""Factors of elements of a `TrigonometricRing`, printed in double or half angles and as cosh and sinh where they split."""

from __future__ import annotations

from math import prod
from typing import TypeAlias

from lie_codegen.groups.wei_norman.trigonometric_ring import Element, TrigonometricRing
from lie_codegen.on_demand import sympy as sp

_Factor: TypeAlias = "tuple[Element, list[sp.Expr], int]"
#: Coefficients of the norm (a dense polynomial over Q) above which polynomials over an irrational field are not factored.
_LARGE = 2000


def factors(ring: TrigonometricRing, element: Element) -> tuple[sp.Expr, list[tuple[sp.Expr, int]]]:
    """(unit, [(factor, multiplicity)]): the unit is a number times exponentials and never vanishes."""
    element = ring.ring(element)
    [cleared] = without_decay(ring, element)
    unit = sp.S.One
    for _, minus in ring.pairs:
        unit *= ring.shown[minus] ** max((monomial[minus] for monomial in element), default=0)
    constant, found = _factor_list(ring, cleared, ring.shown)
    unit *= constant
    proper: list[tuple[sp.Expr, int]] = []
    for factor, shown, multiplicity in found:
        hyperbolic = _hyperbolic(ring, factor)
        if len(factor) == 1 and _is_exponential(ring, factor):
            unit *= ring.expression(factor) ** multiplicity
        elif hyperbolic is not None:
            growth, function = hyperbolic
            unit *= (2 * growth) ** multiplicity
            proper.append((function, multiplicity))
        else:
            number, function, power = _half_angle(ring.shown_as(factor, shown))
            unit *= number**multiplicity
            proper.append((function, power * multiplicity))
    return unit, proper


def _factor_list(ring: TrigonometricRing, element: Element, shown: list[sp.Expr]) -> tuple[sp.Expr, list[_Factor]]:
    """(constant, [(factor, what its generators stand for, multiplicity)]), in double angles where that splits more.

    Over Q where the coefficients allow it up to a constant; factoring over Q(sqrt 3) is far slower, by way of the norm, and
    is left out where that is large.
    """
    if not element:
        return sp.S.Zero, []
    leading = element.LC
    monic = element.mul_ground(ring.domain.one / leading)
    if ring.domain.is_Algebraic:
        if all(ring.domain.to_sympy(value).is_Rational for value in monic.values()):
            rational = monic.set_ring(ring.ring.clone(domain=sp.polys.domains.QQ))
            constant, found = rational.factor_list()
            found = [(factor.set_ring(ring.ring), multiplicity) for factor, multiplicity in found]
            constant = sp.Rational(constant.numerator, constant.denominator)
        elif prod(ring.domain.mod.degree() * degree + 1 for degree in monic.degrees()) > _LARGE:
            constant, found = sp.S.One, [(monic, 1)]
        else:
            constant, found = monic.factor_list()
            constant = ring.domain.to_sympy(constant)
    else:
        constant, found = monic.factor_list()
        constant = ring.domain.to_sympy(constant)
    constant *= ring.domain.to_sympy(leading)
    result: list[_Factor] = []
    for factor, multiplicity in found:
        doubled = _doubled(ring, factor, shown) if len(factor) > 1 else None
        if doubled is None:
            result.append((factor, shown, multiplicity))
            continue
        inner, parts = _factor_list(ring, *doubled)
        constant *= inner**multiplicity
        result += [(part, names, power * multiplicity) for part, names, power in parts]
    return constant, result


def _doubled(ring: TrigonometricRing, element: Element, shown: list[sp.Expr]) -> tuple[Element, list[sp.Expr]] | None:
    """The element over cos 2x and sin 2x for every x in which it is even: c^2 = (1 + C) / 2, s c = S / 2."""
    names = list(shown)
    half = ring.domain.one / ring.domain.from_sympy(sp.Integer(2))
    for position in ring.cosine.values():
        degrees = [monomial[position] + monomial[position + 1] for monomial in element]
        if not any(degrees) or any(degree % 2 for degree in degrees):
            continue
        cosine, sine = ring.generators[position : position + 2]
        total = ring.ring.zero
        for monomial, coefficient in element.terms():
            c, s = monomial[position : position + 2]
            rest = ring.ring.from_dict({(*monomial[:position], 0, 0, *monomial[position + 2 :]): coefficient})
            rest = rest * (half * (1 + cosine)) ** ((c - s) // 2)
            total = total + (rest * half * sine if s else rest)
        element = total
        angle = 2 * names[position].args[0]
        names[position], names[position + 1] = sp.cos(angle), sp.sin(angle)
    return None if names == shown else (element, names)


def factored(ring: TrigonometricRing, element: Element) -> sp.Expr:
    """The element as a product of its factors."""
    unit, proper = factors(ring, element)
    return unit * sp.Mul(*(factor**multiplicity for factor, multiplicity in proper))


def _hyperbolic(ring: TrigonometricRing, factor: Element) -> tuple[sp.Expr, sp.Expr] | None:
    """e^{2x} + 1 = 2 e^x cosh x and e^{2x} - 1 = 2 e^x sinh x as (e^x, cosh x or sinh x)."""
    if len(factor) != 2:
        return None
    (top, one), (rest, sign) = factor.terms()
    domain = ring.domain
    if any(rest) or one != domain.one or sign not in (domain.one, -domain.one):
        return None
    powers = [position for position, power in enumerate(top) if power]
    if len(powers) != 1 or powers[0] not in {plus for plus, _ in ring.pairs}:
        return None
    exponent = ring.shown[powers[0]].args[0] * sp.Rational(top[powers[0]], 2)
    return sp.exp(exponent), sp.cosh(exponent) if sign == domain.one else sp.sinh(exponent)


def _is_exponential(ring: TrigonometricRing, factor: Element) -> bool:
    [monomial] = list(factor)
    plus = {p for p, _ in ring.pairs}
    return all(power == 0 or position in plus for position, power in enumerate(monomial))


def without_decay(ring: TrigonometricRing, *elements: Element) -> list[Element]:
    """The elements times a common power of each e^{a g}, such that no e^{-a g} is left."""
    result = list(elements)
    for plus, minus in ring.pairs:
        power = max((monomial[minus] for element in result for monomial in element), default=0)
        if power:
            result = [ring.reduce(element * ring.generators[plus] ** power) for element in result]
    return result


def _half_angle(factor: sp.Expr) -> tuple[sp.Expr, sp.Expr, int]:
    """(number, function, power): cos x + 1 = 2 cos^2(x / 2) and cos x - 1 = -2 sin^2(x / 2); else (1, factor, 1)."""
    constant, rest = factor.as_coeff_Add()
    if isinstance(rest, sp.cos) and constant in (1, -1):
        half = rest.args[0] / 2
        return (sp.Integer(2), sp.cos(half), 2) if constant == 1 else (sp.Integer(-2), sp.sin(half), 2)
    return sp.S.One, factor, 1
