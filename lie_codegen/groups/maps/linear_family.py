"""A(x) = sum_i x_i A_i at one x: its columns, its square and its quadratic forms, with equal entries and products computed once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lie_codegen.exact.quadratic_form import QuadraticForm
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.linear import number
from lie_codegen.kernel.structural_zeros import add, is_zero, product
from lie_codegen.on_demand import sympy as sp

Sparse = dict[int, Scalar]


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
                        polynomial[key] = sp.expand(polynomial.get(key, 0) + a * b)
        result = {}
        for r, polynomial in squares.items():
            left = {key: value for key, value in polynomial.items() if value != 0}
            if left:
                result[r] = self._polynomial(left)
        return result

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
                ratio = sp.radsimp(value / scale)
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
