"""Exact sums of products of g_k, cos(b g_k), sin(b g_k) and exp(a g_k): a polynomial ring instead of expression trees.

For each coordinate g_k and each class of commensurable frequencies there is one pair of generators c = cos(b g_k) and
s = sin(b g_k), b the largest frequency of which all are multiples; for rates likewise one pair e^{a g_k}, e^{-a g_k}.
Monomials are reduced by s^2 = 1 - c^2 and e^{a g} e^{-a g} = 1, which makes the form of every element unique: equality
is comparison, and no trigonometric simplification is ever needed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import comb
from typing import Any

from lie_codegen.errors import ComputationError
from lie_codegen.exact.budget import Meter
from lie_codegen.exact.exponential import MatrixExponential
from lie_codegen.exact.numbers import Number, exact_number, field_elements
from lie_codegen.on_demand import sympy as sp

#: An element of the ring in reduced form.
Element = Any


class TrigonometricRing:
    """The ring of the functions that exp(g_k A_k) puts into matrices, and an `Arithmetic` over it.

    Attributes:
        symbols: (n) the SymPy symbols g_1..g_n.
        coordinates: (n) the same as ring elements.
        generators, shown: the generators, and the functions they stand for.
        cosine: (k, b) -> position of cos(b g_k); sin(b g_k) follows it.
        pairs: positions of e^{a g_k} and e^{-a g_k}.
    """

    def __init__(self, symbols: Sequence[sp.Symbol], exponentials: Sequence[MatrixExponential]) -> None:
        self.symbols = tuple(symbols)
        self._frequencies = [_bases(mode.frequency for mode in data.modes) for data in exponentials]
        self._rates = [_bases(abs(mode.rate) for mode in data.modes) for data in exponentials]
        shown: list[sp.Expr] = list(self.symbols)
        self.cosine: dict[tuple[int, Number], int] = {}
        self._growth: dict[tuple[int, Number], int] = {}
        for k, (symbol, frequencies, rates) in enumerate(zip(symbols, self._frequencies, self._rates, strict=True)):
            for base in frequencies:
                self.cosine[k, base] = len(shown)
                shown += [sp.cos(base * symbol), sp.sin(base * symbol)]
            for base in rates:
                self._growth[k, base] = len(shown)
                shown += [sp.exp(base * symbol), sp.exp(-base * symbol)]
        self.shown = shown
        numbers = {value for data in exponentials for row in data.entries.values() for value in row.values()}
        numbers.update(value for data in exponentials for mode in data.modes for value in (mode.rate, mode.frequency))
        ordered = sorted(numbers, key=sp.default_sort_key)
        self.domain, elements = field_elements(ordered)
        self._known = dict(zip(ordered, elements, strict=True))
        self.ring, *generators = sp.polys.rings.ring([sp.Dummy() for _ in shown], self.domain)
        self._count_products()
        self.generators: list[Element] = generators
        self.coordinates = tuple(generators[: len(self.symbols)])
        self._sines = tuple(position + 1 for position in self.cosine.values())
        self.pairs = tuple((position, position + 1) for position in self._growth.values())

    def _count_products(self) -> None:
        """Hold every product of two terms against the budget: SymPy makes all of them, those inside a division too, by this."""
        meter, multiply = Meter("the exact Wei-Norman matrix in this basis"), self.ring.monomial_mul
        cost = self.domain.mod.degree() ** 2 if self.domain.is_Algebraic else 1

        def counted(left: tuple[int, ...], right: tuple[int, ...]) -> Any:
            meter.spend(cost)
            return multiply(left, right)

        self.ring.monomial_mul = counted

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
        position, order = self._place(x, self._frequencies, self.cosine)
        cosine = self.generators[position]
        before, value = self.ring.one, cosine
        for _ in range(abs(order) - 1):
            before, value = value, 2 * cosine * value - before
        return value

    def sin(self, x: Element) -> Element:
        """sin of a multiple of one coordinate, as the base sine times a Chebyshev polynomial of the second kind."""
        position, order = self._place(x, self._frequencies, self.cosine)
        cosine, sine = self.generators[position : position + 2]
        before, value = self.ring.zero, self.ring.one
        for _ in range(abs(order) - 1):
            before, value = value, 2 * cosine * value - before
        return sine * value * (1 if order > 0 else -1)

    def exp(self, x: Element) -> Element:
        """exp of a multiple of one coordinate, as a power of the base exponential."""
        position, order = self._place(x, self._rates, self._growth)
        return self.generators[position if order > 0 else position + 1] ** abs(order)

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
        return any(monomial[s] > 1 for s in self._sines) or any(monomial[p] and monomial[m] for p, m in self.pairs)

    def _reduced_monomials(self, monomial: tuple[int, ...]) -> list[tuple[tuple[int, ...], int]]:
        start = list(monomial)
        for plus, minus in self.pairs:
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
        return self.shown_as(self.ring(element), self.shown)

    def shown_as(self, element: Element, shown: list[sp.Expr]) -> sp.Expr:
        terms = []
        for monomial, coefficient in element.terms():
            powers = (name**power for name, power in zip(shown, monomial, strict=True) if power)
            terms.append(sp.Mul(self.domain.to_sympy(coefficient), *powers))
        return sp.Add(*terms)


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
