"""Determinants and adjugates of matrices over a `TrigonometricRing`, without division."""

from __future__ import annotations

from collections.abc import Sequence

from lie_codegen.kernels.trigonometric_ring import Element, TrigonometricRing


def determinant(ring: TrigonometricRing, matrix: Sequence[Sequence[Element]]) -> Element:
    """det A by expansion along the rows, each minor computed once (2^n minors at most)."""
    minors: dict[tuple[int, ...], Element] = {(): ring.ring.one}

    def minor(columns: tuple[int, ...]) -> Element:
        """The determinant of the last len(columns) rows and these columns."""
        if columns not in minors:
            row = matrix[len(matrix) - len(columns)]
            total = ring.ring.zero
            for place, column in enumerate(columns):
                if row[column]:
                    term = row[column] * minor(columns[:place] + columns[place + 1 :])
                    total = total + term if place % 2 == 0 else total - term
            minors[columns] = ring.reduce(total)
        return minors[columns]

    return minor(tuple(range(len(matrix))))


def adjugate(ring: TrigonometricRing, matrix: Sequence[Sequence[Element]]) -> list[list[Element]]:
    """The transposed cofactors: adjugate(A) A = det(A) I."""
    size = range(len(matrix))
    result = []
    for i in size:
        row = []
        for j in size:
            kept = [[matrix[r][k] for k in size if k != i] for r in size if r != j]
            value = determinant(ring, kept)
            row.append(value if (i + j) % 2 == 0 else -value)
        result.append(row)
    return result
