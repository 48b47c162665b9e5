"""Fractions over a `TrigonometricRing`: cancelled by polynomial gcd, written with tangents."""

from __future__ import annotations

from lie_codegen.groups.wei_norman.ring_factors import factored, without_decay
from lie_codegen.groups.wei_norman.trigonometric_ring import Element, TrigonometricRing
from lie_codegen.on_demand import sympy as sp


def fraction(ring: TrigonometricRing, numerator: Element, denominator: Element) -> tuple[Element, Element]:
    """Numerator and denominator in lowest terms; powers of exponentials end in the numerator."""
    numerator, denominator = without_decay(ring, ring.ring(numerator), ring.ring(denominator))
    if not ring.domain.is_Algebraic:
        numerator, denominator = numerator.cancel(denominator)
    elif numerator:
        # A gcd over Q(sqrt 3) takes minutes; common monomials and an exact quotient are found at once.
        common = ring.ring.from_dict({_common(numerator, denominator): ring.domain.one})
        numerator, denominator = numerator.quo(common), denominator.quo(common)
        quotient, rest = numerator.div(denominator)
        numerator, denominator = (numerator, denominator) if rest else (quotient, ring.ring.one)
    return _units_above(ring, numerator, denominator)


def _common(*elements: Element) -> tuple[int, ...]:
    """The largest monomial that divides all elements."""
    return tuple(map(min, zip(*(monomial for element in elements for monomial in element), strict=True)))


def _units_above(ring: TrigonometricRing, numerator: Element, denominator: Element) -> tuple[Element, Element]:
    """Divide both by the exponentials and the number that divide the denominator."""
    for plus, minus in ring.pairs:
        power = min((monomial[plus] for monomial in denominator), default=0)
        if power:
            decay = ring.generators[minus] ** power
            numerator, denominator = ring.reduce(numerator * decay), ring.reduce(denominator * decay)
    if len(denominator) == 1 or ring.domain.is_negative(denominator.LC):
        unit = denominator.LC
        numerator, denominator = (element.mul_ground(ring.domain.one / unit) for element in (numerator, denominator))
    return numerator, denominator


def quotient(ring: TrigonometricRing, numerator: Element, denominator: Element) -> sp.Expr:
    """numerator / denominator in lowest terms as a SymPy expression, sin/cos written as tan where it divides."""
    numerator, denominator = fraction(ring, numerator, denominator)
    tangents = sp.S.One
    for position in ring.cosine.values():
        cosine, sine = ring.generators[position : position + 2]
        in_all = all(monomial[position + 1] for monomial in numerator) and bool(numerator)
        if in_all and all(monomial[position] for monomial in denominator):
            numerator, denominator = numerator.quo(sine), denominator.quo(cosine)
            shown = ring.shown[position + 1]
            tangents *= sp.tan(shown.args[0])
    return ring.expression(numerator) * tangents / factored(ring, denominator)
