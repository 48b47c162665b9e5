"""A(x) = sum_i x_i A_i at one x: its columns, squares and quadratic forms, with products of coordinates shared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

from lie_codegen.exact.quadratic_form import QuadraticForm
from lie_codegen.groups.maps.exact_krylov import ExactKrylov
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.linear import number
from lie_codegen.kernel.structural_zeros import add, is_zero, product
from lie_codegen.on_demand import sympy as sp

Sparse = dict[int, Scalar]


def _fraction(value: Any) -> Fraction:
    return Fraction(int(value.p), int(value.q))


class LinearFamily:
    """A(x) = sum_i x_i A_i at one x, with its square and its quadratic forms; products of coordinates are shared."""

    def __init__(self, ops: Arithmetic, matrices: Sequence[sp.MatrixBase], x: Sequence[Scalar]) -> None:
        self.ops = ops
        self.x = x
        self.size = int(matrices[0].rows)
        self.columns: list[dict[int, dict[int, Any]]] = [{} for _ in range(self.size)]
        for i, matrix in enumerate(matrices):
            for r, row in enumerate(matrix.tolist()):
                for c, value in enumerate(row):
                    if value != 0 and not is_zero(x[i]):
                        self.columns[c].setdefault(r, {})[i] = value
        self._polynomials: dict[Any, tuple[Any, Scalar]] = {}
        self._monomials: dict[tuple[int, ...], Scalar] = {}
        self._exact: dict[tuple[int, QuadraticForm], ExactKrylov | None] = {}

    def form(self, form: QuadraticForm) -> Scalar:
        """q(x)."""
        return self._signed(self._polynomial(dict(form.coefficients)))

    def apply(self, column: Mapping[int, Scalar]) -> Sparse:
        """A v for a sparse v."""
        result: Sparse = {}
        for c, value in column.items():
            for r, entry in self.columns[c].items():
                sign, linear = self._polynomial({(i,): a for i, a in entry.items()})
                term = product(product(linear, value), sign)
                result[r] = add(result.get(r, 0), term)
        return result

    def first(self, j: int) -> dict[int, tuple[int, Scalar]]:
        """A e_j as (sign, value): equal entries up to sign are one value."""
        return {r: self._polynomial({(i,): a for i, a in entry.items()}) for r, entry in self.columns[j].items()}

    def second(self, j: int) -> dict[int, tuple[int, Scalar]]:
        """A^2 e_j, from its exact quadratic polynomials."""
        # Summed exactly before any arithmetic: A^2 of a Lie algebra loses most of its terms (of so(3) w w^T - |w|^2 remains), and a term that
        # cancels here is neither computed nor rounded. An entry whose polynomial is zero is zero for every x and is left out.
        squares: dict[int, dict[tuple[int, ...], Any]] = {}
        for c, entry in self.columns[j].items():
            for r, other in self.columns[c].items():
                polynomial = squares.setdefault(r, {})
                for i, a in entry.items():
                    for k, b in other.items():
                        key = (min(i, k), max(i, k))
                        total = polynomial.get(key, 0) + a * b
                        polynomial[key] = total if total.is_Rational else sp.expand(total)
        result = {}
        for r, polynomial in squares.items():
            left = {key: value for key, value in polynomial.items() if value != 0}
            if left:
                result[r] = self._polynomial(left)
        return result

    def factored(self, form: QuadraticForm, j: int, power: int, s: int) -> dict[int, tuple[int, Scalar]] | None:
        """A^power (A^2 + q)^s e_j from its exact polynomials, where these are short products."""
        if (j, form) not in self._exact:
            self._exact[j, form] = self._exact_krylov(form, j)
        exact = self._exact[j, form]
        entries = None if exact is None else exact.factors(power, s)
        if entries is None:
            return None
        return {row: self._product_of(*entry) for row, entry in entries.items()}

    def _exact_krylov(self, form: QuadraticForm, j: int) -> ExactKrylov | None:
        numbers = [a for column in self.columns for entry in column.values() for a in entry.values()]
        if not all(a.is_Rational for a in (*numbers, *(value for _, value in form.coefficients))):
            return None
        columns = [
            {r: {i: _fraction(a) for i, a in entry.items()} for r, entry in column.items()} for column in self.columns
        ]
        zero = {i for i, value in enumerate(self.x) if is_zero(value)}
        q: dict[tuple[int, ...], Fraction] = {
            pair: _fraction(a) for pair, a in form.coefficients if not zero & set(pair)
        }
        return ExactKrylov(columns, q, j)

    def _product_of(self, scale: Fraction, factors: Sequence[Any]) -> tuple[int, Scalar]:
        sign, value = (-1 if scale < 0 else 1), number(self.ops, sp.Rational(abs(scale).numerator, scale.denominator))
        for factor in factors:
            turned, entry = self._polynomial({key: sp.Rational(a.numerator, a.denominator) for key, a in factor})
            sign, value = sign * turned, product(value, entry)
        return sign, value

    def _signed(self, pair: tuple[int, Scalar]) -> Scalar:
        return product(pair[1], pair[0])

    def _polynomial(self, polynomial: Mapping[tuple[int, ...], Any]) -> tuple[int, Scalar]:
        """A homogeneous polynomial, up to a sign that makes its first coefficient positive."""
        # With the first coefficient positive p and -p have one key, so that the two entries +-w_3 of a rotation cost one value.
        items = sorted(polynomial.items())
        sign = -1 if items[0][1].is_negative else 1
        key = tuple((m, sign * value) for m, value in items)
        if key not in self._polynomials:
            total: Scalar = 0
            # One common factor is taken out: (a^2 + b^2) / 4 rather than a^2 / 4 + b^2 / 4.
            scale = key[0][1]
            for m, value in key:
                ratio = value / scale
                ratio = ratio if ratio.is_Rational else sp.radsimp(ratio)
                term = self._monomial(m)
                if ratio == -1 and not is_zero(total):
                    total = total - term
                else:
                    total = add(total, product(number(self.ops, ratio), term))
            self._polynomials[key] = (1, product(number(self.ops, scale), total))
        return sign, self._polynomials[key][1]

    def _monomial(self, m: tuple[int, ...]) -> Scalar:
        if m not in self._monomials:
            self._monomials[m] = self.x[m[0]] if len(m) == 1 else product(self.x[m[0]], self.x[m[1]])
        return self._monomials[m]
