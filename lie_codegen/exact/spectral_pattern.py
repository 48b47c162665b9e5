"""Annihilating polynomials lambda^k (lambda^2 + q(x))^m of a linear family of matrices.

For A(x) = sum_i x_i A_i and a unit vector e_j the smallest k, m and a quadratic form q with

    A(x)^k (A(x)^2 + q(x))^m e_j = 0   for every x

give every analytic f(A(x)) e_j in closed form: so3, se2, se3, SE_2(3), su2, sl2 and every nilpotent algebra have one.
The form follows from the trace, q = -tr A^2 / (2 r) on the coordinates that e_j reaches, where 2 r eigenvalues differ from
zero. The identity, polynomial in x of degree below 20, is tested at two random points modulo a prime near 2^61: it holds, or
both tests fail to see it with a probability below 10^-30.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass
from math import comb

from lie_codegen.exact.modular import modular_images, random_point
from lie_codegen.exact.numbers import Number
from lie_codegen.exact.quadratic_form import QuadraticForm
from lie_codegen.on_demand import sympy as sp

_POINTS = 2
_MOST_ZEROS = 4
_MOST_PAIRS = 3

#: row -> residue, no zeros.
_Vector = dict[int, int]
#: For each point the value of a quadratic form.
_Values = tuple[int, ...]


@dataclass(frozen=True)
class ColumnPattern:
    """A^zeros (A^2 + q)^pairs e_j = 0.

    Attributes:
        zeros: k.
        pairs: m; zero when e_j is only acted on nilpotently.
        form: q, None when pairs is zero.
        supports: ((power, s), rows): the rows where A^power (A^2 + q)^s e_j is not identically zero.
    """

    zeros: int
    pairs: int
    form: QuadraticForm | None
    supports: tuple[tuple[tuple[int, int], frozenset[int]], ...]


def spectral_pattern(matrices: Sequence[sp.MatrixBase]) -> tuple[ColumnPattern, ...] | None:
    """The pattern of every column, or None when a column has none of this kind."""
    family = _Family(matrices)
    result = []
    for j in range(family.size):
        column = family.column_pattern(j)
        if column is None:
            return None
        result.append(column)
    return tuple(result)


class _Family:
    """The family at random points modulo a prime near 2^61.

    A polynomial identity that fails is true at such a point by chance only, with probability of about degree / prime
    (Schwartz and Zippel); ranks and zeros are thus found by integer arithmetic instead of symbols.
    """

    def __init__(self, matrices: Sequence[sp.MatrixBase]) -> None:
        self.size = int(matrices[0].rows)
        self.entries = [
            (i, *divmod(place, self.size), value)
            for i, m in enumerate(matrices)
            for place, value in enumerate(m.flat())
            if value != 0
        ]
        images = modular_images([value for *_, value in self.entries]) if self.entries else (2**61 - 1, [])
        self.known = images is not None
        self.prime, self.residues = images if images is not None else (2**61 - 1, [])
        self.points = [random_point(random.Random(k), self.prime, len(matrices)) for k in range(_POINTS)]
        self.columns = [self._columns_at(point) for point in self.points]
        self.forms: dict[frozenset[int], list[_Values]] = {}

    def _columns_at(self, point: list[int]) -> list[_Vector]:
        columns: list[_Vector] = [{} for _ in range(self.size)]
        for (i, r, c, _), value in zip(self.entries, self.residues, strict=False):
            columns[c][r] = (columns[c].get(r, 0) + value * point[i]) % self.prime
        return columns

    def column_pattern(self, j: int) -> ColumnPattern | None:
        if not self.known:
            return None
        krylov = [self._krylov(p, j) for p in range(_POINTS)]
        # e_j on which the family acts nilpotently needs no form at all: A^k e_j = 0.
        for zeros in range(1, self.size + 1):
            if all(not k[zeros] for k in krylov):
                return ColumnPattern(zeros, 0, None, self._supports(krylov, (0,) * _POINTS, zeros, 0))
        # The shortest polynomial first: a pair costs two products with A in every kernel, a zero one.
        rows = self._reach(j)
        for pairs in range(1, _MOST_PAIRS + 1):
            for zeros in range(_MOST_ZEROS + 1):
                for r, q in enumerate(self._forms(rows), start=1):
                    if all(not self._value(k, value, zeros, pairs) for k, value in zip(krylov, q, strict=True)):
                        return ColumnPattern(
                            zeros, pairs, self._exact(rows, r), self._supports(krylov, q, zeros, pairs)
                        )
        return None

    def _krylov(self, p: int, j: int) -> list[_Vector]:
        vectors: list[_Vector] = [{j: 1}]
        for _ in range(max(self.size, _MOST_ZEROS + 2 * _MOST_PAIRS)):
            image: _Vector = {}
            for c, x in vectors[-1].items():
                for r, a in self.columns[p][c].items():
                    image[r] = (image.get(r, 0) + a * x) % self.prime
            vectors.append({r: value for r, value in image.items() if value})
        return vectors

    def _value(self, krylov: list[_Vector], q: int, power: int, pairs: int) -> _Vector:
        # (A^2 + q)^m = sum_s binomial(m, s) q^(m - s) A^(2 s), on vectors A^i e_j that are there already.
        total: _Vector = {}
        for s in range(pairs + 1):
            weight = comb(pairs, s) * pow(q, pairs - s, self.prime)
            for r, value in krylov[power + 2 * s].items():
                total[r] = (total.get(r, 0) + weight * value) % self.prime
        return {r: value for r, value in total.items() if value}

    def _supports(
        self, krylov: list[list[_Vector]], q: _Values, zeros: int, pairs: int
    ) -> tuple[tuple[tuple[int, int], frozenset[int]], ...]:
        wanted = [(power, 0) for power in range(zeros + 2 * pairs)]
        wanted += [(power, s) for s in range(1, pairs) for power in range(zeros + 2 * (pairs - s))]
        return tuple(
            (
                (power, s),
                # a row that vanishes at one point only does so by chance: it counts if it is there at any
                frozenset(r for k, value in zip(krylov, q, strict=True) for r in self._value(k, value, power, s)),
            )
            for power, s in wanted
        )

    def _reach(self, j: int) -> frozenset[int]:
        # The smallest set of rows that no A_i leads out of: e_j and all its images live there, so the trace is taken there.
        reached, new = {j}, [j]
        while new:
            column = new.pop()
            for _, r, c, _ in self.entries:
                if c == column and r not in reached:
                    reached.add(r)
                    new.append(r)
        return frozenset(reached)

    def _forms(self, rows: frozenset[int]) -> list[_Values]:
        """q = -tr A^2 / (2 r) on the coordinates `rows` at the points, for r = 1, 2, ...; none if the trace vanishes."""
        if rows not in self.forms:
            traces = []
            for columns in self.columns:
                total = sum(a * columns[r].get(c, 0) for c in rows for r, a in columns[c].items() if r in rows)
                traces.append(total % self.prime)
            # r pairs +-sqrt(-q) and zeros have tr A^2 = -2 r q: for every r there is one candidate for q.
            shares = [pow(-2 * r, -1, self.prime) for r in range(1, len(rows) // 2 + 1)] if any(traces) else []
            self.forms[rows] = [tuple(t * share % self.prime for t in traces) for share in shares]
        return self.forms[rows]

    def _exact(self, rows: frozenset[int], r: int) -> QuadraticForm:
        """The same q as an exact polynomial."""
        by_place: dict[tuple[int, int], list[tuple[int, Number]]] = {}
        for i, row, c, value in self.entries:
            if row in rows and c in rows:
                by_place.setdefault((row, c), []).append((i, value))
        trace: dict[tuple[int, int], Number] = {}
        for (row, c), entries in by_place.items():
            for i, value in entries:
                for k, other in by_place.get((c, row), []):
                    key = (min(i, k), max(i, k))
                    trace[key] = trace.get(key, sp.S.Zero) + value * other
        exact = {key: sp.radsimp(sp.expand(value)) / (-2 * r) for key, value in trace.items()}
        return QuadraticForm(tuple((key, value) for key, value in sorted(exact.items()) if value != 0))
