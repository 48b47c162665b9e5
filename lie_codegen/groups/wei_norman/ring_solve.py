"""Determinants and inverses of matrices over a `TrigonometricRing`: no division but by determinants of blocks."""

from __future__ import annotations

from collections.abc import Sequence

from lie_codegen.groups.wei_norman.ring_fractions import fraction
from lie_codegen.groups.wei_norman.trigonometric_ring import Element, TrigonometricRing
from lie_codegen.kernel.block_solve import SparseMatrix, blocks_of

#: Numerator and denominator.
Fraction = tuple[Element, Element]


def dense(
    ring: TrigonometricRing, matrix: SparseMatrix, rows: Sequence[int], columns: Sequence[int]
) -> list[list[Element]]:
    """Some rows and columns of a sparse matrix."""
    return [[matrix.get((i, j), ring.ring.zero) for j in columns] for i in rows]


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


def inverse_rows(ring: TrigonometricRing, matrix: SparseMatrix, size: int) -> list[list[Fraction]]:
    """A^{-1} row by row, by substitution over the block-triangular form of A."""
    zero, one = ring.ring.zero, ring.ring.one
    rows: list[list[Fraction]] = [[(zero, one)] * size for _ in range(size)]
    solved: list[int] = []
    for block in blocks_of(matrix, size):
        inside = dense(ring, matrix, block, block)
        coupling = dense(ring, matrix, block, solved)
        cofactors, det = adjugate(ring, inside), determinant(ring, inside)
        for column in range(size):
            residual = []
            for i, row in zip(block, coupling, strict=True):
                numerator, denominator = combination(ring, row, [rows[j][column] for j in solved])
                residual.append(((denominator if i == column else zero) - numerator, denominator))
            for i, row in zip(block, cofactors, strict=True):
                numerator, denominator = combination(ring, row, residual)
                rows[i][column] = fraction(ring, numerator, ring.reduce(denominator * det))
        solved += block
    return rows


def combination(ring: TrigonometricRing, row: Sequence[Element], fractions: Sequence[Fraction]) -> Fraction:
    """sum of row[j] * fractions[j] over a common denominator."""
    numerator, denominator = ring.ring.zero, ring.ring.one
    for entry, (above, below) in zip(row, fractions, strict=True):
        if not entry or not above:
            continue
        term = ring.reduce(entry * above)
        if below == denominator:
            numerator = numerator + term
        elif below == ring.ring.one:
            numerator = numerator + ring.reduce(term * denominator)
        else:
            total = ring.reduce(numerator * below + term * denominator)
            numerator, denominator = fraction(ring, total, ring.reduce(denominator * below))
    return numerator, denominator
