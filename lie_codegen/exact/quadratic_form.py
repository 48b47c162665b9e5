"""Exact quadratic forms q(x) = sum_{i <= j} q_ij x_i x_j."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from lie_codegen.exact.numbers import Number
from lie_codegen.on_demand import sympy as sp


@dataclass(frozen=True)
class QuadraticForm:
    """sum over i <= j of coefficients[(i, j)] x_i x_j.

    Attributes:
        coefficients: sorted ((i, j), value) pairs with i <= j and no zeros.
    """

    coefficients: tuple[tuple[tuple[int, int], Number], ...]

    @cached_property
    def is_nonnegative(self) -> bool:
        """Whether q(x) >= 0 for every real x, decided exactly by symmetric elimination."""
        indices = sorted({i for pair, _ in self.coefficients for i in pair})
        place = {i: p for p, i in enumerate(indices)}
        size = len(indices)
        matrix = [[sp.S.Zero] * size for _ in range(size)]
        for (i, j), value in self.coefficients:
            matrix[place[i]][place[j]] += value / 2
            matrix[place[j]][place[i]] += value / 2
        return _is_nonnegative(matrix)


def _is_nonnegative(matrix: list[list[Number]]) -> bool:
    rest = list(range(len(matrix)))
    while rest:
        if any(matrix[i][i].is_negative for i in rest):
            return False
        pivot = next((i for i in rest if matrix[i][i].is_positive), None)
        if pivot is None:
            return all(matrix[i][j] == 0 for i in rest for j in rest)
        rest.remove(pivot)
        for i in rest:
            ratio = matrix[i][pivot] / matrix[pivot][pivot]
            if ratio == 0:
                continue
            for j in rest:
                matrix[i][j] = sp.radsimp(sp.expand(matrix[i][j] - ratio * matrix[pivot][j]))
    return True
