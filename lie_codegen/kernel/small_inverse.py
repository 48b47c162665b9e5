"""The inverse of a full matrix over any arithmetic: adjugates up to 4 x 4, orthogonal factors above."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any

from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.block_solve import solve
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.linear import Matrix
from lie_codegen.kernel.structural_zeros import add, is_zero, product


def inverse(ops: Arithmetic, matrix: Sequence[Sequence[Scalar]]) -> Matrix:
    """A^{-1}; real or Complex entries."""
    size = len(matrix)
    if size == 4 and sum(not is_zero(entry) for row in matrix for entry in row) > 12:
        return inverse_4(matrix)
    if size > 3 and any(isinstance(entry, Complex) for row in matrix for entry in row):
        return _through_reals(ops, matrix)
    sparse = {(i, j): entry for i, row in enumerate(matrix) for j, entry in enumerate(row) if not is_zero(entry)}
    columns = solve(sparse, [{j: 1} for j in range(size)], size)
    return [[column.get(i, 0) for column in columns] for i in range(size)]


def inverse_4(m: Sequence[Sequence[Scalar]]) -> Matrix:
    """The adjugate of a 4 x 4 matrix by Laplace's expansion in 2 x 2 minors, over the determinant."""

    def minors(upper: Sequence[Scalar], lower: Sequence[Scalar]) -> dict[tuple[int, int], Scalar]:
        return {
            (i, j): _minus(product(upper[i], lower[j]), product(upper[j], lower[i]))
            for i, j in combinations(range(4), 2)
        }

    s, c = minors(m[0], m[1]), minors(m[2], m[3])
    pairs = (((0, 1), (2, 3), 1), ((0, 2), (1, 3), -1), ((0, 3), (1, 2), 1))
    det: Scalar = 0
    for a, b, sign in pairs:
        det = add(det, product(sign, add(product(s[a], c[b]), product(s[b], c[a]))))
    result: Matrix = [[0] * 4 for _ in range(4)]
    for row in range(4):
        # Cofactors of a row of the upper half use the minors of the lower half, and the other way round.
        partner, other = (m[1 - row], c) if row < 2 else (m[5 - row], s)
        for column in range(4):
            i, j, k = (index for index in range(4) if index != column)
            value = add(
                _minus(product(partner[i], other[j, k]), product(partner[j], other[i, k])),
                product(partner[k], other[i, j]),
            )
            result[column][row] = product(-1, value) if (row + column) % 2 else value
    return [[0 if is_zero(value) else value / det for value in row] for row in result]


def _minus(a: Scalar, b: Scalar) -> Scalar:
    return add(a, product(-1, b))


def _through_reals(ops: Arithmetic, matrix: Sequence[Sequence[Any]]) -> Matrix:
    """A complex inverse through [[Re, -Im], [Im, Re]]."""
    size = len(matrix)
    sparse: dict[tuple[int, int], Scalar] = {}
    for i, row in enumerate(matrix):
        for j, entry in enumerate(row):
            z = Complex.of(entry)
            for place, value in (
                ((i, j), z.re), ((i + size, j + size), z.re), ((i + size, j), z.im), ((i, j + size), product(-1, z.im)),
            ):  # fmt: skip
                if not is_zero(value):
                    sparse[place] = value
    columns = solve(sparse, [{j: 1} for j in range(size)], 2 * size)
    return [[Complex(column.get(i, 0), column.get(i + size, 0)) for column in columns] for i in range(size)]
