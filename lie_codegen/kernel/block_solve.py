"""Solving A x = b over any arithmetic: block-triangular form, adjugates for blocks up to 4, QR above.

Symmetric permutation to block-triangular form needs only a zero-free diagonal, which the Wei-Norman matrices
have (they are the identity at g = 0). Adjugates divide by the determinant of the block alone, so a solution is
singular only where the block is: no spurious pivots (shared by design with the chart's own edge).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lie_codegen.kernel.arithmetic import Scalar
from lie_codegen.kernel.structural_zeros import add, is_zero, product
from lie_codegen.on_demand import sympy as sp

#: (row, column) -> entry; what is not there is zero.
SparseMatrix = Mapping[tuple[int, int], Scalar]

#: Blocks up to this size divide once, by their determinant.
_LARGEST_ADJUGATE = 4


def blocks_of(matrix: SparseMatrix, size: int) -> list[list[int]]:
    """Diagonal blocks in the order in which A x = b is solved: each needs only those before it."""
    edges = [(i, j) for (i, j) in matrix if i != j]
    components = sp.utilities.iterables.strongly_connected_components((list(range(size)), edges))
    return [sorted(component) for component in components]


def solve(matrix: SparseMatrix, right_hand_sides: Sequence[Mapping[int, Scalar]], size: int) -> list[dict[int, Scalar]]:
    """For each right-hand side (sparse) the sparse solution x of A x = b."""
    solutions: list[dict[int, Scalar]] = [{} for _ in right_hand_sides]
    rows: dict[int, dict[int, Scalar]] = {}
    for (i, j), value in matrix.items():
        rows.setdefault(i, {})[j] = value
    for block in blocks_of(matrix, size):
        inside = set(block)
        dense = [[rows[i].get(j, 0) for j in block] for i in block]
        factor = _BlockSolver(dense)
        for b, x in zip(right_hand_sides, solutions, strict=True):
            residual = []
            for i in block:
                value = b.get(i, 0)
                for j, entry in rows[i].items():
                    if j not in inside and j in x:
                        value = value - product(entry, x[j])
                residual.append(value)
            if all(is_zero(value) for value in residual):
                continue
            x.update((i, value) for i, value in zip(block, factor.solve(residual), strict=True) if not is_zero(value))
    return solutions


def determinant(matrix: Sequence[Sequence[Scalar]]) -> Scalar:
    """Determinant by expansion along the first row, for small blocks; no division."""
    if len(matrix) == 1:
        return matrix[0][0]
    total: Scalar = 0
    for j, entry in enumerate(matrix[0]):
        if is_zero(entry):
            continue
        term = product(entry, determinant([[*row[:j], *row[j + 1 :]] for row in matrix[1:]]))
        total = add(total, term if j % 2 == 0 else product(-1, term))
    return total


class _BlockSolver:
    """One diagonal block, factored once for all right-hand sides."""

    def __init__(self, dense: list[list[Scalar]]) -> None:
        self.size = len(dense)
        self.dense = dense
        if self.size <= _LARGEST_ADJUGATE:
            self.adjugate = _adjugate(dense)
            self.determinant = determinant(dense)
        else:
            self.q, self.r = _gram_schmidt(dense)

    def solve(self, b: list[Scalar]) -> list[Scalar]:
        if self.size <= _LARGEST_ADJUGATE:
            values = [_dot(row, b) for row in self.adjugate]
            if isinstance(self.determinant, int) and self.determinant == 1:
                return values
            return [0 if is_zero(value) else value / self.determinant for value in values]
        return self._back_substitute(b)

    def _back_substitute(self, b: list[Scalar]) -> list[Scalar]:
        projected = [product(_dot(q, b), 1) for q, _ in self.q]
        x: list[Scalar] = [0] * self.size
        for i in reversed(range(self.size)):
            value = projected[i]
            if not is_zero(value):
                value = value / self.q[i][1]
            for j in range(i + 1, self.size):
                value = add(value, product(-1, product(self.r[i][j], x[j])))
            x[i] = value
        return x


def _dot(a: Sequence[Scalar], b: Sequence[Scalar]) -> Scalar:
    total: Scalar = 0
    for x, y in zip(a, b, strict=True):
        total = add(total, product(x, y))
    return total


def _adjugate(m: list[list[Scalar]]) -> list[list[Scalar]]:
    size = len(m)
    if size == 1:
        return [[1]]
    rows = range(size)
    return [
        [
            product((-1) ** (i + j), determinant([[m[r][k] for k in rows if k != i] for r in rows if r != j]))
            for j in rows
        ]
        for i in rows
    ]


def _gram_schmidt(m: list[list[Scalar]]) -> tuple[list[tuple[list[Scalar], Scalar]], list[list[Scalar]]]:
    """A = Q R with orthogonal columns q_i (kept with |q_i|^2) and unit upper triangular R; no square roots."""
    size = len(m)
    q: list[tuple[list[Scalar], Scalar]] = []
    r: list[list[Scalar]] = [[0] * size for _ in range(size)]
    for j in range(size):
        column = [row[j] for row in m]
        for i, (direction, norm) in enumerate(q):
            overlap = _dot(direction, column)
            if is_zero(overlap):
                continue
            r[i][j] = overlap / norm
            column = [add(c, product(-1, product(r[i][j], d))) for c, d in zip(column, direction, strict=True)]
        q.append((column, _dot(column, column)))
    return q, r
