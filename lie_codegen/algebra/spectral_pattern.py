"""Annihilating polynomials lambda^k (lambda^2 + q(x))^m of a linear family of matrices, found exactly.

For A(x) = sum_i x_i A_i and a unit vector e_j the smallest k, m and a quadratic form q with

    A(x)^k (A(x)^2 + q(x))^m e_j = 0   for every x

give every analytic f(A(x)) e_j in closed form: so3, se2, se3, SE_2(3), su2, sl2 and every nilpotent algebra have one.
The form follows from the trace, q = -tr A^2 / (2 r) on the coordinates that e_j reaches, where 2 r eigenvalues differ from
zero. The identity, polynomial in x of degree below 20, is tested in exact arithmetic at seeded integer points from a range
of 2^40: it holds, or the three tests all fail to see it with a probability below 10^-30 (Schwartz and Zippel).
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass
from math import comb
from typing import Any

import sympy as sp

from lie_codegen.algebra.exact import Number, field_elements
from lie_codegen.algebra.quadratic_form import QuadraticForm

_POINTS = 3
_RANGE = 2**39
_MOST_ZEROS = 4
_MOST_PAIRS = 3

#: position -> exact field element
_Vector = dict[int, Any]


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
    return _Family(matrices).pattern()


class _Family:
    def __init__(self, matrices: Sequence[sp.MatrixBase]) -> None:
        self.size = int(matrices[0].rows)
        positions = [
            (i, r, c, m[r, c])
            for i, m in enumerate(matrices)
            for r in range(self.size)
            for c in range(self.size)
            if m[r, c] != 0
        ]
        domain, values = field_elements([value for *_, value in positions] or [sp.S.Zero])
        self.domain = domain
        self.entries = [
            (i, r, c, value) for (i, r, c, _), value in zip(positions, values if positions else [], strict=True)
        ]
        rng = random.Random(0)
        self.points = [
            [domain.convert(rng.randint(-_RANGE, _RANGE)) for _ in range(len(matrices))] for _ in range(_POINTS)
        ]
        self.columns = [self._columns(point) for point in self.points]
        self.forms: dict[frozenset[int], tuple[_Form, ...]] = {}

    def _columns(self, point: list[Any]) -> list[_Vector]:
        columns: list[_Vector] = [{} for _ in range(self.size)]
        for i, r, c, value in self.entries:
            columns[c][r] = columns[c].get(r, self.domain.zero) + value * point[i]
        return columns

    def pattern(self) -> tuple[ColumnPattern, ...] | None:
        result = []
        for j in range(self.size):
            column = self._column_pattern(j)
            if column is None:
                return None
            result.append(column)
        return tuple(result)

    def _column_pattern(self, j: int) -> ColumnPattern | None:
        krylov = [self._krylov(p, j) for p in range(_POINTS)]
        for zeros in range(1, self.size + 1):
            if all(not k[zeros] for k in krylov):
                return ColumnPattern(zeros, 0, None, self._supports(krylov, None, zeros, 0))
        for pairs in range(1, _MOST_PAIRS + 1):
            for zeros in range(_MOST_ZEROS + 1):
                for form in self._forms(self._reach(j)):
                    if all(not self._value(k, q, zeros, pairs) for k, q in zip(krylov, form.values, strict=True)):
                        supports = self._supports(krylov, form, zeros, pairs)
                        return ColumnPattern(zeros, pairs, form.form, supports)
        return None

    def _krylov(self, p: int, j: int) -> list[_Vector]:
        vectors: list[_Vector] = [{j: self.domain.one}]
        for _ in range(max(self.size, _MOST_ZEROS + 2 * _MOST_PAIRS)):
            image: _Vector = {}
            for c, x in vectors[-1].items():
                for r, a in self.columns[p][c].items():
                    image[r] = image.get(r, self.domain.zero) + a * x
            vectors.append({r: value for r, value in image.items() if value})
        return vectors

    def _value(self, krylov: list[_Vector], q: Any, power: int, pairs: int) -> _Vector:
        total: _Vector = {}
        for s in range(pairs + 1):
            weight = self.domain.convert(comb(pairs, s)) * q ** (pairs - s)
            for r, value in krylov[power + 2 * s].items():
                total[r] = total.get(r, self.domain.zero) + weight * value
        return {r: value for r, value in total.items() if value}

    def _supports(
        self, krylov: list[list[_Vector]], form: _Form | None, zeros: int, pairs: int
    ) -> tuple[tuple[tuple[int, int], frozenset[int]], ...]:
        wanted = [(power, 0) for power in range(zeros + 2 * pairs)]
        if form is not None:
            wanted += [(power, s) for s in range(1, pairs) for power in range(zeros + 2 * (pairs - s))]
        result = []
        for power, s in wanted:
            rows: set[int] = set()
            for p in range(_POINTS):
                q = form.values[p] if form is not None else self.domain.zero
                rows |= set(self._value(krylov[p], q, power, s))
            result.append(((power, s), frozenset(rows)))
        return tuple(result)

    def _reach(self, j: int) -> frozenset[int]:
        reached, new = {j}, [j]
        while new:
            column = new.pop()
            for _, r, c, _ in self.entries:
                if c == column and r not in reached:
                    reached.add(r)
                    new.append(r)
        return frozenset(reached)

    def _forms(self, rows: frozenset[int]) -> tuple[_Form, ...]:
        """q = -tr A^2 / (2 r) on the coordinates `rows`, for each possible r; none if the trace vanishes."""
        if rows not in self.forms:
            trace = self._trace_of_square(rows)
            self.forms[rows] = tuple(self._form(trace, r) for r in range(1, len(rows) // 2 + 1)) if trace else ()
        return self.forms[rows]

    def _trace_of_square(self, rows: frozenset[int]) -> dict[tuple[int, int], Any]:
        inside = [entry for entry in self.entries if entry[1] in rows and entry[2] in rows]
        trace: dict[tuple[int, int], Any] = {}
        by_place: dict[tuple[int, int], list[tuple[int, Any]]] = {}
        for i, r, c, value in inside:
            by_place.setdefault((r, c), []).append((i, value))
        for i, r, c, value in inside:
            for k, other in by_place.get((c, r), []):
                key = (min(i, k), max(i, k))
                trace[key] = trace.get(key, self.domain.zero) + value * other
        return {key: value for key, value in trace.items() if value}

    def _form(self, trace: dict[tuple[int, int], Any], r: int) -> _Form:
        scale = self.domain.convert(-2 * r)
        scaled = {key: value / scale for key, value in trace.items()}
        values = []
        for point in self.points:
            total = self.domain.zero
            for (i, k), value in scaled.items():
                total = total + value * point[i] * point[k]
            values.append(total)
        exact: list[tuple[tuple[int, int], Number]] = [
            (key, self.domain.to_sympy(value)) for key, value in sorted(scaled.items())
        ]
        return _Form(QuadraticForm(tuple(exact)), tuple(values))


@dataclass(frozen=True)
class _Form:
    form: QuadraticForm
    values: tuple[Any, ...]
