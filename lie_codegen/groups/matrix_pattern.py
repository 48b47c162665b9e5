"""Complex groups as real ones, and the entries that are 0 or 1 in every element of a group."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from lie_codegen.algebra.constructions import _coordinate_map
from lie_codegen.exact.numbers import Number, domain_matrix, to_numbers
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.on_demand import sympy as sp


@dataclass(frozen=True)
class RealMatrices:
    """A matrix group as real m x m matrices; a complex X becomes [[Re X, -Im X], [Im X, Re X]].

    Attributes:
        group: the group, real or complex.
    """

    group: MatrixGroup

    @cached_property
    def basis(self) -> tuple[sp.ImmutableMatrix, ...]:
        """(n) real m x m basis matrices."""
        return tuple(sp.ImmutableMatrix(real_form(m, self.group.is_complex)) for m in self.group.exact_basis)

    @property
    def size(self) -> int:
        """m: d for a real group, 2 d for a complex one."""
        return self.group.degree * (2 if self.group.is_complex else 1)

    @cached_property
    def varying(self) -> frozenset[tuple[int, int]]:
        """Entries (i, j) that are not those of the identity in every element: the closure of the basis' own pattern."""
        return reached({(i, j) for m in self.basis for i in range(self.size) for j in range(self.size) if m[i, j] != 0})

    @cached_property
    def blocks(self) -> tuple[tuple[tuple[int, ...], bool], ...]:
        """Diagonal blocks in the order in which X Y = B is solved, and whether each is orthogonal."""
        edges = [(i, j) for (i, j) in self.varying if i != j]
        parts = sp.utilities.iterables.strongly_connected_components((list(range(self.size)), edges))
        return tuple((tuple(sorted(part)), self._orthogonal(sorted(part))) for part in parts)

    @cached_property
    def kept(self) -> tuple[sp.ImmutableMatrix | None, ...]:
        """For each block a form S with X^T S X = S whose rows and columns have one entry each, so that X^{-1} = S^{-1} X^T S is read off X:
        of SO(p, q), Sp(2 n) and their like. None where there is none."""
        return tuple(self._kept(sorted(block)) for block, _ in self.blocks)

    @cached_property
    def coordinates(self) -> tuple[dict[tuple[int, int], Number], ...]:
        """For each component the exact coefficients on matrix entries that read it off: x_k = sum c (i, j) A_ij."""
        columns = [list(m.flat()) for m in self.basis]
        pivots, inverse = _coordinate_map(self.group.name, self.group.labels, columns)
        return tuple(
            {divmod(p, self.size): value for p, value in zip(pivots, row, strict=True) if value != 0} for row in inverse
        )

    @cached_property
    def rigid(self) -> tuple[int, ...] | None:
        """Where w1 w2 w3 (and v1 v2 v3) of the usual SO(3) or SE(3) stand in the basis; None for other groups.

        There Ad has a closed form: Ad_R w = R w, Ad_(R, p) (w, v) = (R w, R v + p x R w).
        """
        if self.group.is_complex or (self.size, self.group.dim) not in ((3, 3), (4, 6)):
            return None
        place = {tuple(matrix.flat()): index for index, matrix in enumerate(self.basis)}
        found = [place.get(tuple(matrix.flat())) for matrix in _rigid_basis(self.size)]
        positions = tuple(index for index in found if index is not None)
        return positions if len(positions) == self.group.dim else None

    def _orthogonal(self, block: list[int]) -> bool:
        return all(m[i, j] == -m[j, i] for m in self.basis for i in block for j in block)

    def _kept(self, block: list[int]) -> sp.ImmutableMatrix | None:
        size = len(block)
        if size == 1 or not self._traceless(block):
            return None
        parts = [m.extract(block, block) for m in self.basis]
        if self._orthogonal(block):
            return sp.ImmutableMatrix(sp.eye(size))
        # A^T S + S A = 0, entry by entry.
        equations = []
        for A in parts:
            for i in range(size):
                for j in range(size):
                    row: list[Number] = [sp.S.Zero] * (size * size)
                    for k in range(size):
                        row[k * size + j] += A[k, i]
                        row[i * size + k] += A[k, j]
                    if any(row):
                        equations.append(row)
        found = to_numbers(domain_matrix(equations).nullspace().to_dense()) if equations else []
        for flat in found:
            S = sp.ImmutableMatrix(size, size, list(flat))
            single = all(sum(entry != 0 for entry in S.row(i)) == 1 for i in range(size))
            if single and all(sum(entry != 0 for entry in S.col(i)) == 1 for i in range(size)):
                return S
        return None

    def _traceless(self, block: list[int]) -> bool:
        return all(sp.expand(sum(m[i, i] for i in block)) == 0 for m in self.basis)


def reached(places: set[tuple[int, int]]) -> frozenset[tuple[int, int]]:
    """Where products of matrices with these entries may be other than zero."""
    reach = places
    while True:
        longer = {(i, k) for (i, j) in reach for (other, k) in reach if j == other} | reach
        if longer == reach:
            return frozenset(reach)
        reach = longer


def real_form(matrix: sp.MatrixBase, is_complex: bool) -> sp.MatrixBase:
    """[[Re, -Im], [Im, Re]] of a complex matrix; a real one as it is."""
    if not is_complex:
        return matrix
    re, im = matrix.applyfunc(sp.re), matrix.applyfunc(sp.im)
    return sp.Matrix.vstack(sp.Matrix.hstack(re, -im), sp.Matrix.hstack(im, re))


def _rigid_basis(size: int) -> list[sp.ImmutableMatrix]:
    """Rotations about the three axes, and for size 4 translations along them."""
    result = []
    for j, k in ((1, 2), (2, 0), (0, 1)):
        turn = sp.zeros(size, size)
        turn[k, j], turn[j, k] = 1, -1
        result.append(sp.ImmutableMatrix(turn))
    for i in range(3 if size == 4 else 0):
        shift = sp.zeros(size, size)
        shift[i, 3] = 1
        result.append(sp.ImmutableMatrix(shift))
    return result
