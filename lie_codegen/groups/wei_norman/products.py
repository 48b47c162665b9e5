"""Sparse products, (row, column) -> entry, over any arithmetic."""

from __future__ import annotations

from collections.abc import Mapping

from lie_codegen.kernel.arithmetic import Scalar
from lie_codegen.kernel.block_solve import SparseMatrix
from lie_codegen.kernel.structural_zeros import add, product


def times_vector(matrix: SparseMatrix, vector: Mapping[int, Scalar]) -> dict[int, Scalar]:
    """A matrix and a vector."""
    result: dict[int, Scalar] = {}
    for (i, j), entry in matrix.items():
        if j in vector:
            result[i] = add(result.get(i, 0), product(entry, vector[j]))
    return result


def times_matrix(left: SparseMatrix, right: SparseMatrix) -> dict[tuple[int, int], Scalar]:
    """Two matrices."""
    rows: dict[int, list[tuple[int, Scalar]]] = {}
    for (m, j), value in right.items():
        rows.setdefault(m, []).append((j, value))
    result: dict[tuple[int, int], Scalar] = {}
    for (i, m), entry in left.items():
        for j, value in rows.get(m, []):
            result[i, j] = add(result.get((i, j), 0), product(entry, value))
    return result
