"""Exact sums of products of g_k, cos(b g_k), sin(b g_k) and exp(a g_k): a polynomial ring instead of expression trees.

For each coordinate g_k and each class of commensurable frequencies there is one pair of generators c = cos(b g_k) and
s = sin(b g_k), b the largest frequency of which all are multiples; for rates likewise one pair e^{a g_k}, e^{-a g_k}.
Monomials are reduced by s^2 = 1 - c^2 and e^{a g} e^{-a g} = 1, which makes the form of every element unique: equality
is comparison, and no trigonometric simplification is ever needed. Fractions are cancelled by polynomial gcd.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import comb
from typing import Any

import sympy as sp
from sympy.polys.domains import QQ
from sympy.polys.rings import PolyElement, ring

from lie_codegen.algebra.exact import Number, exact_number, field_elements
from lie_codegen.algebra.exponential import MatrixExponential
from lie_codegen.errors import ComputationError

#: An element of the ring in reduced form.
Element = Any
_Factor = tuple[Element, list[sp.Expr], int]
#: Terms above which polynomials over an irrational field are not factored.
_LONG = 40


class TrigonometricRing:
    """The ring of the functions that exp(g_k A_k) puts into matrices, and an `Arithmetic` over it.

    Attributes:
        symbols: (n) the SymPy symbols g_1..g_n.
        coordinates: (n) the same as ring elements.
    """

    def __init__(self, symbols: Sequence[sp.Symbol], exponentials: Sequence[MatrixExponential]) -> None:
        self.symbols = tuple(symbols)
        self._frequencies = [_bases(mode.frequency for mode in data.modes) for data in exponentials]
        self._rates = [_bases(abs(mode.rate) for mode in data.modes) for data in exponentials]
        shown: list[sp.Expr] = list(self.symbols)
        self._cosine: dict[tuple[int, Number], int] = {}
        self._growth: dict[tuple[int, Number], int] = {}
        for k, (symbol, frequencies, rates) in enumerate(zip(symbols, self._frequencies, self._rates, strict=True)):
            for base in frequencies:
                self._cosine[k, base] = len(shown)
                shown += [sp.cos(base * symbol), sp.sin(base * symbol)]
            for base in rates:
                self._growth[k, base] = len(shown)
                shown += [sp.exp(base * symbol), sp.exp(-base * symbol)]
        self._shown = shown
        numbers = {value for data in exponentials for row in data.entries.values() for value in row.values()}
        numbers.update(value for data in exponentials for mode in data.modes for value in (mode.rate, mode.frequency))
        ordered = sorted(numbers, key=sp.default_sort_key)
        self.domain, elements = field_elements(ordered)
        self._known = dict(zip(ordered, elements, strict=True))
        self.ring, *generators = ring([sp.Dummy() for _ in shown], self.domain)
        self._generators: list[PolyElement] = generators
        self.coordinates = tuple(generators[: len(self.symbols)])
        self._sines = tuple(position + 1 for position in self._cosine.values())
        self._pairs = tuple((position, position + 1) for position in self._growth.values())

    def constant(self, value: Any) -> Element:
        """An exact number."""
        return self.ring.ground_new(self._element(exact_number(value)))

    def _element(self, value: Number) -> Any:
        """A number of the field; an irrational factor is converted once (that takes an integer relation search)."""
        if value not in self._known:
            coefficient, rest = value.as_coeff_Mul()
            if value.is_Add:
                self._known[value] = sum((self._element(term) for term in value.args), self.domain.zero)
            elif coefficient != 1 and rest != 1:
                self._known[value] = self._element(coefficient) * self._element(rest)
            else:
                self._known[value] = self.domain.from_sympy(value)
        return self._known[value]

    def cos(self, x: Element) -> Element:
        """cos of a multiple of one coordinate, as a Chebyshev polynomial of the base cosine."""
        position, order = self._place(x, self._frequencies, self._cosine)
        cosine = self._generators[position]
        before, value = self.ring.one, cosine
        for _ in range(abs(order) - 1):
            before, value = value, 2 * cosine * value - before
        return value

    def sin(self, x: Element) -> Element:
        """sin of a multiple of one coordinate, as the base sine times a Chebyshev polynomial of the second kind."""
        position, order = self._place(x, self._frequencies, self._cosine)
        cosine, sine = self._generators[position : position + 2]
        before, value = self.ring.zero, self.ring.one
        for _ in range(abs(order) - 1):
            before, value = value, 2 * cosine * value - before
        return sine * value * (1 if order > 0 else -1)

    def exp(self, x: Element) -> Element:
        """exp of a multiple of one coordinate, as a power of the base exponential."""
        position, order = self._place(x, self._rates, self._growth)
        return self._generators[position if order > 0 else position + 1] ** abs(order)

    def _place(
        self, x: Element, bases: Sequence[Sequence[Number]], positions: dict[tuple[int, Number], int]
    ) -> tuple[int, int]:
        """The position of the base function of x = coefficient * g_k, and coefficient / base as an integer."""
        [(monomial, coefficient)] = x.terms()
        k = monomial.index(1)
        value = self.domain.to_sympy(coefficient)
        for base in bases[k]:
            order = _ratio(value, base)
            if order is not None:
                return positions[k, base], int(order)
        raise ComputationError(f"{value} {self.symbols[k]} is not a frequency or rate of this ring")

    def reduce(self, element: Element) -> Element:
        """The unique form: sines to the power 0 or 1, no e^{a g} beside e^{-a g}."""
        if not any(self._reducible(monomial) for monomial in element):
            return element
        result: dict[tuple[int, ...], Any] = {}
        for monomial, coefficient in element.terms():
            for reduced, factor in self._reduced_monomials(monomial):
                result[reduced] = result.get(reduced, self.domain.zero) + factor * coefficient
        return self.ring.from_dict({monomial: value for monomial, value in result.items() if value})

    def _reducible(self, monomial: tuple[int, ...]) -> bool:
        return any(monomial[s] > 1 for s in self._sines) or any(monomial[p] and monomial[m] for p, m in self._pairs)

    def _reduced_monomials(self, monomial: tuple[int, ...]) -> list[tuple[tuple[int, ...], int]]:
        start = list(monomial)
        for plus, minus in self._pairs:
            common = min(start[plus], start[minus])
            start[plus] -= common
            start[minus] -= common
        found = [(start, 1)]
        for sine in self._sines:
            half, odd = divmod(start[sine], 2)
            if half:
                found = [
                    ([*m[: sine - 1], m[sine - 1] + 2 * r, odd, *m[sine + 1 :]], factor * comb(half, r) * (-1) ** r)
                    for m, factor in found
                    for r in range(half + 1)
                ]
        return [(tuple(m), factor) for m, factor in found]

    def expression(self, element: Element) -> sp.Expr:
        """The element as a SymPy expression."""
        return self._shown_as(self.ring(element), self._shown)

    def _shown_as(self, element: Element, shown: list[sp.Expr]) -> sp.Expr:
        terms = []
        for monomial, coefficient in element.terms():
            powers = (name**power for name, power in zip(shown, monomial, strict=True) if power)
            terms.append(sp.Mul(self.domain.to_sympy(coefficient), *powers))
        return sp.Add(*terms)

    def fraction(self, numerator: Element, denominator: Element) -> tuple[Element, Element]:
        """Numerator and denominator in lowest terms; powers of exponentials end in the numerator."""
        numerator, denominator = self._without_decay(self.ring(numerator), self.ring(denominator))
        if not self.domain.is_Algebraic:
            numerator, denominator = numerator.cancel(denominator)
        elif numerator:
            # A gcd over Q(sqrt 3) takes minutes; common monomials and an exact quotient are found at once.
            common = self.ring.from_dict({self._common(numerator, denominator): self.domain.one})
            numerator, denominator = numerator.quo(common), denominator.quo(common)
            quotient, rest = numerator.div(denominator)
            numerator, denominator = (numerator, denominator) if rest else (quotient, self.ring.one)
        return self._units_above(numerator, denominator)

    @staticmethod
    def _common(*elements: Element) -> tuple[int, ...]:
        """The largest monomial that divides all elements."""
        return tuple(map(min, zip(*(monomial for element in elements for monomial in element), strict=True)))

    def _without_decay(self, *elements: Element) -> list[Element]:
        """The elements times a common power of each e^{a g}, such that no e^{-a g} is left."""
        result = list(elements)
        for plus, minus in self._pairs:
            power = max((monomial[minus] for element in result for monomial in element), default=0)
            if power:
                result = [self.reduce(element * self._generators[plus] ** power) for element in result]
        return result

    def _units_above(self, numerator: Element, denominator: Element) -> tuple[Element, Element]:
        """Divide both by the exponentials and the number that divide the denominator."""
        for plus, minus in self._pairs:
            power = min((monomial[plus] for monomial in denominator), default=0)
            if power:
                decay = self._generators[minus] ** power
                numerator, denominator = self.reduce(numerator * decay), self.reduce(denominator * decay)
        if len(denominator) == 1 or self.domain.is_negative(denominator.LC):
            unit = denominator.LC
            numerator, denominator = (
                element.mul_ground(self.domain.one / unit) for element in (numerator, denominator)
            )
        return numerator, denominator

    def quotient(self, numerator: Element, denominator: Element) -> sp.Expr:
        """numerator / denominator in lowest terms as a SymPy expression, sin/cos written as tan where it divides."""
        numerator, denominator = self.fraction(numerator, denominator)
        tangents = sp.S.One
        for position in self._cosine.values():
            cosine, sine = self._generators[position : position + 2]
            in_all = all(monomial[position + 1] for monomial in numerator) and bool(numerator)
            if in_all and all(monomial[position] for monomial in denominator):
                numerator, denominator = numerator.quo(sine), denominator.quo(cosine)
                shown = self._shown[position + 1]
                tangents *= sp.tan(shown.args[0])
        return self.expression(numerator) * tangents / self.factored(denominator)

    def factors(self, element: Element) -> tuple[sp.Expr, list[tuple[sp.Expr, int]]]:
        """(unit, [(factor, multiplicity)]): the unit is a number times exponentials and never vanishes."""
        element = self.ring(element)
        [cleared] = self._without_decay(element)
        unit = sp.S.One
        for _, minus in self._pairs:
            unit *= self._shown[minus] ** max((monomial[minus] for monomial in element), default=0)
        constant, found = self._factor_list(cleared, self._shown)
        unit *= constant
        proper: list[tuple[sp.Expr, int]] = []
        for factor, shown, multiplicity in found:
            hyperbolic = self._hyperbolic(factor)
            if len(factor) == 1 and self._is_exponential(factor):
                unit *= self.expression(factor) ** multiplicity
            elif hyperbolic is not None:
                growth, function = hyperbolic
                unit *= (2 * growth) ** multiplicity
                proper.append((function, multiplicity))
            else:
                proper.append((self._shown_as(factor, shown), multiplicity))
        return unit, proper

    def _factor_list(self, element: Element, shown: list[sp.Expr]) -> tuple[sp.Expr, list[_Factor]]:
        """(constant, [(factor, what its generators stand for, multiplicity)]), in double angles where that splits more.

        Over Q where the coefficients allow it up to a constant; factoring over Q(sqrt 3) is far slower and is left out
        for long polynomials.
        """
        if not element:
            return sp.S.Zero, []
        leading = element.LC
        monic = element.mul_ground(self.domain.one / leading)
        if self.domain.is_Algebraic:
            if all(self.domain.to_sympy(value).is_Rational for value in monic.values()):
                rational = monic.set_ring(self.ring.clone(domain=QQ))
                constant, found = rational.factor_list()
                found = [(factor.set_ring(self.ring), multiplicity) for factor, multiplicity in found]
                constant = sp.Rational(constant.numerator, constant.denominator)
            elif len(monic) > _LONG:
                constant, found = sp.S.One, [(monic, 1)]
            else:
                constant, found = monic.factor_list()
                constant = self.domain.to_sympy(constant)
        else:
            constant, found = monic.factor_list()
            constant = self.domain.to_sympy(constant)
        constant *= self.domain.to_sympy(leading)
        result: list[_Factor] = []
        for factor, multiplicity in found:
            doubled = self._doubled(factor, shown) if len(factor) > 1 else None
            if doubled is None:
                result.append((factor, shown, multiplicity))
                continue
            inner, parts = self._factor_list(*doubled)
            constant *= inner**multiplicity
            result += [(part, names, power * multiplicity) for part, names, power in parts]
        return constant, result

    def _doubled(self, element: Element, shown: list[sp.Expr]) -> tuple[Element, list[sp.Expr]] | None:
        """The element over cos 2x and sin 2x for every x in which it is even: c^2 = (1 + C) / 2, s c = S / 2."""
        names = list(shown)
        half = self.domain.one / self.domain.from_sympy(sp.Integer(2))
        for position in self._cosine.values():
            degrees = [monomial[position] + monomial[position + 1] for monomial in element]
            if not any(degrees) or any(degree % 2 for degree in degrees):
                continue
            cosine, sine = self._generators[position : position + 2]
            total = self.ring.zero
            for monomial, coefficient in element.terms():
                c, s = monomial[position : position + 2]
                rest = self.ring.from_dict({(*monomial[:position], 0, 0, *monomial[position + 2 :]): coefficient})
                rest = rest * (half * (1 + cosine)) ** ((c - s) // 2)
                total = total + (rest * half * sine if s else rest)
            element = total
            angle = 2 * names[position].args[0]
            names[position], names[position + 1] = sp.cos(angle), sp.sin(angle)
        return None if names == shown else (element, names)

    def factored(self, element: Element) -> sp.Expr:
        """The element as a product of its factors."""
        unit, proper = self.factors(element)
        return unit * sp.Mul(*(factor**multiplicity for factor, multiplicity in proper))

    def _hyperbolic(self, factor: Element) -> tuple[sp.Expr, sp.Expr] | None:
        """e^{2x} + 1 = 2 e^x cosh x and e^{2x} - 1 = 2 e^x sinh x as (e^x, cosh x or sinh x)."""
        if len(factor) != 2:
            return None
        (top, one), (rest, sign) = factor.terms()
        domain = self.domain
        if any(rest) or one != domain.one or sign not in (domain.one, -domain.one):
            return None
        powers = [position for position, power in enumerate(top) if power]
        if len(powers) != 1 or powers[0] not in {plus for plus, _ in self._pairs}:
            return None
        exponent = self._shown[powers[0]].args[0] * sp.Rational(top[powers[0]], 2)
        return sp.exp(exponent), sp.cosh(exponent) if sign == domain.one else sp.sinh(exponent)

    def _is_exponential(self, factor: Element) -> bool:
        [monomial] = list(factor)
        plus = {p for p, _ in self._pairs}
        return all(power == 0 or position in plus for position, power in enumerate(monomial))


def _ratio(value: Number, base: Number) -> sp.Rational | None:
    """value / base if that is a rational number."""
    ratio = sp.radsimp(value / base)
    return ratio if ratio.is_Rational else None


def _bases(values: Iterable[Number]) -> tuple[Number, ...]:
    """For each class of commensurable positive numbers the largest of which all in the class are multiples."""
    bases: list[Number] = []
    for value in sorted({value for value in values if value != 0}, key=sp.default_sort_key):
        for position, base in enumerate(bases):
            ratio = _ratio(value, base)
            if ratio is not None:
                bases[position] = base / ratio.q
                break
        else:
            bases.append(value)
    return tuple(bases)
