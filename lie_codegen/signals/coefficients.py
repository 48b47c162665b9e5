"""The exact numbers of an averaging computation: Z, or Z[generators] where a coefficient is not rational.

Every coefficient is an integer polynomial in generators over a common integer denominator that its signal carries.
A generator is a parameter (an amplitude), a square root of a prime (kept reduced: its square is the prime), or any
other number or function of the parameters that is not rational, such as pi, taken as it stands. Rational inputs
need no generator: the coefficients are then plain Python integers, which is the fast path.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Any

from lie_codegen.errors import InputError
from lie_codegen.on_demand import sympy as sp

#: An int, or a PolyElement over the integers.
Coefficient = Any


@dataclass(frozen=True)
class CoefficientRing:
    """Z[generators] modulo r^2 = p for the generators r that are square roots of primes.

    Attributes:
        generators: SymPy expressions, each standing for itself; empty for the integers.
    """

    generators: tuple[sp.Expr, ...] = ()

    @staticmethod
    def holding(values: Iterable[sp.Expr]) -> CoefficientRing:
        """The smallest such ring with rational multiples of all the values."""
        found: dict[sp.Expr, None] = {}
        for value in values:
            _walk(value, lambda generator: found.setdefault(generator))
        return CoefficientRing(tuple(sorted(found, key=lambda g: g.sort_key())))

    @cached_property
    def squares(self) -> dict[int, int]:
        """Position of a square-root generator -> its square."""
        return {
            k: int(g.base)
            for k, g in enumerate(self.generators)
            if isinstance(g, sp.Pow) and g.exp == sp.Rational(1, 2) and g.base.is_Integer
        }

    @cached_property
    def inverses(self) -> tuple[tuple[int, int], ...]:
        """Positions of generators g and 1/g that are both present; their product is 1."""
        place = {g: k for k, g in enumerate(self.generators)}
        return tuple((k, place[1 / g]) for g, k in place.items() if 1 / g in place and k < place[1 / g])

    @cached_property
    def polynomials(self) -> sp.polys.rings.PolyRing:
        """The polynomial ring over Z; its generators are named x0, x1, ..."""
        return sp.polys.rings.PolyRing([f"x{k}" for k in range(len(self.generators))], sp.polys.domains.ZZ)

    @cached_property
    def multiply(self) -> Callable[[Coefficient, Coefficient], Coefficient]:
        """The product, reduced."""
        if not self.squares and not self.inverses:
            return lambda a, b: a * b

        def product(a: Coefficient, b: Coefficient) -> Coefficient:
            value = a * b
            return value if isinstance(value, int) else self._reduced(value)

        return product

    def element(self, value: sp.Expr) -> tuple[Coefficient, int]:
        """(numerator, denominator) of a value in the ring.

        Raises:
            InputError: if the value needs a generator the ring does not have.
        """
        if value.is_Rational:
            return int(value.p), int(value.q)
        rational = self._rationals
        image = _convert(value, rational, self._images)
        denominator, cleared = image.clear_denoms()
        numerator = self.polynomials.from_dict({monom: int(c) for monom, c in cleared.terms()})
        return self._reduced(numerator), int(denominator)

    def constant(self, value: int) -> Coefficient:
        """An integer as an element."""
        return value

    def expression(self, numerator: Coefficient, denominator: int = 1) -> sp.Expr:
        """The SymPy value of numerator / denominator."""
        if isinstance(numerator, int):
            return sp.Rational(numerator, denominator)
        terms = []
        for monom, coefficient in numerator.terms():
            factors = [g**e for g, e in zip(self.generators, monom, strict=True) if e]
            terms.append(sp.Mul(sp.Rational(int(coefficient), denominator), *factors))
        return sp.Add(*terms)

    def number(self, numerator: Coefficient, denominator: int, values: tuple[Any, ...]) -> Any:
        """The double nearest to numerator / denominator at numeric values of the generators (arrays allowed)."""
        if isinstance(numerator, int):
            return numerator / denominator
        total: Any = 0.0
        for monom, coefficient in numerator.terms():
            term: Any = int(coefficient) / denominator
            for value, exponent in zip(values, monom, strict=True):
                if exponent:
                    term = term * value**exponent
            total = total + term
        return total

    def content(self, value: Coefficient) -> int:
        """The greatest common divisor of the integers in an element."""
        if isinstance(value, int):
            return abs(value)
        return math.gcd(*(int(c) for c in value.values()))

    def divide(self, value: Coefficient, divisor: int) -> Coefficient:
        """Exact division by an integer that divides the content."""
        return value // divisor if isinstance(value, int) else value.quo_ground(sp.polys.domains.ZZ(divisor))

    def _reduced(self, value: Any) -> Any:
        """Even powers of square roots replaced by integers, g and 1/g cancelled."""
        for position, square in self.squares.items():
            if any(monom[position] > 1 for monom in value):
                value = _rewritten(value, lambda m, k=position, n=square: _square(m, k, n))  # type: ignore[misc]
        for first, second in self.inverses:
            if any(monom[first] and monom[second] for monom in value):
                value = _rewritten(value, lambda m, k=first, n=second: _cancel(m, k, n))  # type: ignore[misc]
        return value

    @cached_property
    def _rationals(self) -> sp.polys.rings.PolyRing:
        return sp.polys.rings.PolyRing([f"x{k}" for k in range(len(self.generators))], sp.polys.domains.QQ)

    @cached_property
    def _images(self) -> dict[sp.Expr, Any]:
        return dict(zip(self.generators, self._rationals.gens, strict=True))


Monomial = tuple[int, ...]


def _rewritten(value: Any, rule: Callable[[Monomial], tuple[Monomial, int]]) -> Any:
    """A polynomial with each monomial replaced by a multiple of another."""
    result: dict[Monomial, int] = {}
    for monom, coefficient in value.items():
        key, factor = rule(monom)
        result[key] = result.get(key, 0) + coefficient * factor
    return value.ring.from_dict({key: c for key, c in result.items() if c})


def _square(monom: Monomial, position: int, square: int) -> tuple[Monomial, int]:
    half, odd = divmod(monom[position], 2)
    return (*monom[:position], odd, *monom[position + 1 :]), square**half


def _cancel(monom: Monomial, first: int, second: int) -> tuple[Monomial, int]:
    common = min(monom[first], monom[second])
    key = list(monom)
    key[first] -= common
    key[second] -= common
    return tuple(key), 1


def _root_factors(value: sp.Expr) -> tuple[sp.Rational, list[sp.Expr]]:
    """sqrt(p/q) as (rational, square roots of primes)."""
    numerator, denominator = int(value.p), int(value.q)
    outside = sp.Rational(1, denominator)
    roots = []
    for prime, exponent in sp.factorint(numerator * denominator).items():
        outside *= sp.Integer(prime) ** (exponent // 2)
        if exponent % 2:
            roots.append(sp.sqrt(prime))
    return outside, roots


def _is_root(value: sp.Expr) -> bool:
    return (
        isinstance(value, sp.Pow)
        and value.base.is_Rational
        and value.base > 0
        and value.exp.is_Rational
        and value.exp.q == 2
    )


def _walk(value: sp.Expr, note: Callable[[sp.Expr], Any]) -> None:
    """Report every generator a value needs."""
    if value.is_Rational:
        return
    if _is_root(value):
        for root in _root_factors(value.base)[1]:
            note(root)
    elif isinstance(value, sp.Add | sp.Mul):
        for argument in value.args:
            _walk(argument, note)
    elif isinstance(value, sp.Pow) and value.exp.is_Integer and value.exp > 0:
        _walk(value.base, note)
    elif value.has(sp.I, sp.zoo, sp.nan, sp.oo, sp.Float):
        raise InputError(f"{value} is not an exact real coefficient")
    else:
        note(value)


def _convert(value: sp.Expr, ring: sp.polys.rings.PolyRing, images: Mapping[sp.Expr, Any]) -> Any:
    if value.is_Rational:
        return ring.ground_new(sp.polys.domains.QQ(int(value.p), int(value.q)))
    if _is_root(value):
        outside, roots = _root_factors(value.base)
        power = (int(value.exp.p) - 1) // 2
        outside *= value.base**power
        start = ring.ground_new(sp.polys.domains.QQ(int(outside.p), int(outside.q)))
        return reduce(lambda a, root: a * _image(root, images), roots, start)
    if isinstance(value, sp.Add):
        return reduce(lambda a, b: a + b, (_convert(argument, ring, images) for argument in value.args))
    if isinstance(value, sp.Mul):
        return reduce(lambda a, b: a * b, (_convert(argument, ring, images) for argument in value.args))
    if isinstance(value, sp.Pow) and value.exp.is_Integer and value.exp > 0:
        return _convert(value.base, ring, images) ** int(value.exp)
    return _image(value, images)


def _image(generator: sp.Expr, images: Mapping[sp.Expr, Any]) -> Any:
    if generator not in images:
        raise InputError(f"{generator} is not in the ring of coefficients")
    return images[generator]
