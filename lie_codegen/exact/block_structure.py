"""The block-triangular form of a family of matrices, from the places where they are zero."""

from __future__ import annotations

from collections.abc import Sequence

from lie_codegen.on_demand import sympy as sp


def diagonal_blocks(matrices: Sequence[sp.MatrixBase]) -> tuple[tuple[int, ...], ...]:
    """Index sets of the irreducible diagonal blocks common to all matrices."""
    size = int(matrices[0].rows)
    edges = {(i, j) for m in matrices for i in range(size) for j in range(size) if i != j and m[i, j] != 0}
    parts = sp.utilities.iterables.strongly_connected_components((list(range(size)), sorted(edges)))
    return tuple(sorted(tuple(sorted(part)) for part in parts))


def is_block_diagonal(matrix: sp.MatrixBase, blocks: Sequence[Sequence[int]]) -> bool:
    """Whether a matrix vanishes outside the diagonal blocks."""
    inside = {(i, j) for block in blocks for i in block for j in block}
    size = int(matrix.rows)
    return all(matrix[i, j] == 0 or (i, j) in inside for i in range(size) for j in range(size))
