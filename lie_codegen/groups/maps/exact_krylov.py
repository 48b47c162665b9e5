"""A^power (A^2 + q)^s e_j as exact polynomials in x, in factors: what a sum of numbers would compute term by term and mostly cancel.

Of the translations of SE(3) these are +-2 (w . v) (w w^T - |w|^2) e_j, five operations and three shared by all columns instead of forty a column.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from fractions import Fraction

from lie_codegen.on_demand import sympy as sp

#: A homogeneous polynomial: the places of its coordinates, sorted, -> coefficient.
Polynomial = dict[tuple[int, ...], Fraction]
#: The same as a value, of first or second degree.
Factor = tuple[tuple[tuple[int, ...], Fraction], ...]
#: An entry: a coefficient, and what to multiply it with.
Entry = tuple[Fraction, tuple[Factor, ...]]
#: Polynomials with more terms are left to numbers; on the way, before their terms cancel, they may have more.
_MOST_TERMS, _MOST_ON_THE_WAY = 40, 400


class ExactKrylov:
    """The vectors of one start e_j, for a family with rational matrices; None where they are no short products.

    Args:
        columns: column -> row -> {coordinate: coefficient}, of A(x).
        form: q.
        j: of e_j.
    """

    def __init__(
        self, columns: list[dict[int, dict[int, Fraction]]], form: Mapping[tuple[int, ...], Fraction], j: int
    ) -> None:
        self._columns = columns
        self._form = form
        self._done: dict[tuple[int, int], dict[int, Polynomial] | None] = {(0, 0): {j: {(): Fraction(1)}}}

    def factors(self, power: int, s: int) -> dict[int, Entry] | None:
        """Row -> entry, without the rows that vanish."""
        entries = {}
        vector = self._vector(power, s)
        if vector is None:
            return None
        for row, polynomial in vector.items():
            found = _factored(polynomial)
            if found is None:
                return None
            entries[row] = found
        # What most rows have comes first, so that the coefficient before the vector meets it once.
        count = Counter(factor for _, factors in entries.values() for factor in set(factors))
        return {
            row: (scale, tuple(sorted(factors, key=lambda factor: (-count[factor], factor))))
            for row, (scale, factors) in entries.items()
        }

    def _vector(self, power: int, s: int) -> dict[int, Polynomial] | None:
        """Row -> polynomial; None where these grow too long, as in a basis without zeros."""
        if (power, s) not in self._done:
            self._done[power, s] = self._product(power, s)
        return self._done[power, s]

    def _product(self, power: int, s: int) -> dict[int, Polynomial] | None:
        below = self._vector(power, s - 1) if s else self._vector(power - 1, 0)
        start = self._vector(power + 2, s - 1) if s else {}
        if below is None or start is None:
            return None
        found = {row: dict(p) for row, p in start.items()}
        for column, p in below.items():
            by_row = (
                {column: self._form} if s else {row: _linear(entry) for row, entry in self._columns[column].items()}
            )
            for row, factor in by_row.items():
                _add_product(found.setdefault(row, {}), p, factor)
                if len(found[row]) > _MOST_ON_THE_WAY:
                    return None
        left = {row: {key: value for key, value in p.items() if value} for row, p in found.items()}
        return {row: p for row, p in left.items() if p}


def _linear(entry: Mapping[int, Fraction]) -> Polynomial:
    return {(i,): value for i, value in entry.items()}


def _add_product(total: Polynomial, a: Polynomial, b: Mapping[tuple[int, ...], Fraction]) -> None:
    for first, x in a.items():
        for second, y in b.items():
            key = tuple(sorted((*first, *second)))
            total[key] = total.get(key, Fraction(0)) + x * y


def _factored(polynomial: Polynomial) -> Entry | None:
    if len(polynomial) > _MOST_TERMS:
        return None
    places = sorted({i for key in polynomial for i in key})
    symbols = {i: sp.Symbol(f"x{i}") for i in places}
    terms = {
        tuple(key.count(i) for i in places): sp.Rational(v.numerator, v.denominator) for key, v in polynomial.items()
    }
    scale, irreducible = _irreducible(sp.Poly(terms, *symbols.values()))
    total = Fraction(int(scale.p), int(scale.q))
    found: list[Factor] = []
    for factor, multiplicity in irreducible:
        if factor.total_degree() > 2:
            return None
        items: list[tuple[tuple[int, ...], Fraction]] = []
        for exponents, value in factor.terms():
            key = tuple(i for i, count in zip(places, exponents, strict=True) for _ in range(count))
            items.append((key, Fraction(int(value.p), int(value.q))))
        items.sort()
        lead = items[0][1]
        total *= lead**multiplicity
        found += [tuple((key, value / lead) for key, value in items)] * multiplicity
    return total, _paired(sorted(found))


def _irreducible(polynomial: sp.Poly) -> tuple[sp.Rational, list[tuple[sp.Poly, int]]]:
    """A number, and irreducible factors with their multiplicities.

    Where a coordinate x appears in first degree alone, p = a x + b = gcd(a, b) (a' x + b') and the last is irreducible: one of two factors of it
    would be free of x, and divide a' and b'. Translations do, so that general factoring is left with polynomials of a few coordinates; for many
    of them it draws points at random, and now and then takes minutes.
    """
    if polynomial.is_ground:
        return polynomial.LC(), []
    for x in polynomial.gens:
        if polynomial.degree(x) == 1:
            a = polynomial.diff(x)
            common = a.gcd(polynomial - a * sp.Poly(x, *polynomial.gens))
            scale, factors = _irreducible(common)
            return scale, [*factors, (polynomial.exquo(common), 1)]
    found: tuple[sp.Rational, list[tuple[sp.Poly, int]]] = polynomial.factor_list()
    return found


def _paired(
    factors: list[tuple[tuple[tuple[int, ...], Fraction], ...]],
) -> tuple[tuple[tuple[tuple[int, ...], Fraction], ...], ...]:
    """Two coordinates are one monomial, which the squares of A share."""
    single = [factor for factor in factors if len(factor) == 1 and len(factor[0][0]) == 1]
    rest = [factor for factor in factors if factor not in single]
    while len(single) > 1:
        (a,), (b,) = single.pop()[0][0], single.pop()[0][0]
        rest.append((((min(a, b), max(a, b)), Fraction(1)),))
    return (*rest, *single)
