"""Which entries of a group element vary: the others are those of the identity, and are not stored."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.complex_scalar import Complex


@lru_cache(maxsize=128)
def varying_entries(group: MatrixGroup) -> tuple[tuple[int, int], ...]:
    """Positions (i, j), row by row, of the entries of X that can differ from those of the identity.

    X = I + products of basis matrices, so the pattern is the closure of theirs under multiplication.
    """
    matrices = group.definition["parameters"]["matrices"]
    basis = {(i, j) for rows in matrices for i, row in enumerate(rows) for j, entry in enumerate(row) if entry != 0}
    pattern = set(basis)
    while True:
        more = {(i, j) for i, k in pattern for m, j in basis if k == m} - pattern
        if not more:
            return tuple(sorted(pattern))
        pattern |= more


def packed_size(group: MatrixGroup) -> int:
    """Number of doubles of a packed element."""
    return len(varying_entries(group)) * (2 if group.is_complex else 1)


def unpack(group: MatrixGroup, packed: Sequence[Any]) -> list[list[Any]]:
    """The matrix of a packed element: its varying entries, and elsewhere the identity."""
    matrix: list[list[Any]] = [[1 if i == j else 0 for j in range(group.degree)] for i in range(group.degree)]
    for number, (i, j) in enumerate(varying_entries(group)):
        matrix[i][j] = Complex(packed[2 * number], packed[2 * number + 1]) if group.is_complex else packed[number]
    return matrix


def pack(group: MatrixGroup, matrix: Sequence[Sequence[Any]]) -> list[Any]:
    """The varying entries of a matrix, complex ones as re, im."""
    entries = [matrix[i][j] for i, j in varying_entries(group)]
    if not group.is_complex:
        return entries
    return [part for entry in entries for part in (Complex.of(entry).re, Complex.of(entry).im)]
