"""How the logarithm of a group is taken, found exactly from its matrices.

Over their common block-triangular form every diagonal block of X = exp(hat(x)) depends on a linear image T x of x alone. Where
each block is of a kind with a logarithm of its own (a scale, a rotation of the plane or of space with or without a scale,
a spin, a real 2 x 2 matrix), T x is read off the blocks. What is left of x lies in the ideal ker T, whose matrices are strictly
block triangular; `logarithm` recovers it in finitely many steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import sympy as sp

from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.exact.block_structure import diagonal_blocks, is_block_diagonal
from lie_codegen.exact.numbers import Number, domain_matrix, to_numbers
from lie_codegen.groups.matrix_group import MatrixGroup


@dataclass(frozen=True)
class LogBlock:
    """One diagonal block of a known kind.

    Attributes:
        kind: scale, phase, plane, space, spin, real2.
        indices: the rows and columns of the block.
        rows: the linear forms in x that the block's logarithm gives, in the kind's own order.
        scaled: whether the last row is the block's scale, log |det X|^(1/size).
    """

    kind: str
    indices: tuple[int, ...]
    rows: tuple[tuple[Number, ...], ...]
    scaled: bool = False


@dataclass(frozen=True)
class LogStructure:
    """The blocks of a group and how x follows from their logarithms.

    Attributes:
        group: the group.
        blocks: one for each diagonal block that is not constant.
    """

    group: MatrixGroup
    blocks: tuple[LogBlock, ...]

    @cached_property
    def rows(self) -> tuple[tuple[Number, ...], ...]:
        """T, the linear forms of all blocks."""
        return tuple(row for block in self.blocks for row in block.rows)

    @cached_property
    def order(self) -> tuple[int, ...]:
        """Basis elements, those with block-diagonal matrices first."""
        blocks = diagonal_blocks(self.group.exact_basis)
        split = [is_block_diagonal(matrix, blocks) for matrix in self.group.exact_basis]
        return tuple(sorted(range(self.group.dim), key=lambda i: not split[i]))

    @cached_property
    def pivots(self) -> tuple[int, ...]:
        """Basis elements whose coordinates T determines when all others are zero."""
        if not self.rows:
            return ()
        _, found = domain_matrix([[row[i] for i in self.order] for row in self.rows]).rref()
        return tuple(self.order[p] for p in found)

    @cached_property
    def section(self) -> tuple[tuple[int, dict[int, Number]], ...]:
        """(i, {row: weight}): x_i as a combination of the blocks' logarithms, for the pivots; the other x_i are zero."""
        if not self.pivots:
            return ()
        columns = [[row[i] for row in self.rows] for i in self.pivots]
        _, independent = domain_matrix(columns).rref()
        square = domain_matrix([[self.rows[r][i] for i in self.pivots] for r in independent])
        inverse = to_numbers(square.inv())
        return tuple(
            (i, {r: value for r, value in zip(independent, weights, strict=True) if value != 0})
            for i, weights in zip(self.pivots, inverse, strict=True)
        )

    @cached_property
    def splits(self) -> bool:
        """Whether exp of the section is the block-diagonal part of X."""
        blocks = diagonal_blocks(self.group.exact_basis)
        return all(is_block_diagonal(self.group.exact_basis[i], blocks) for i in self.pivots)

    @cached_property
    def steps(self) -> int:
        """Corrections that find the rest of x: each doubles the depth in the lower central series of ker T."""
        if len(self.pivots) == self.group.dim:
            return 0
        if not self.pivots:
            return 1
        return nilpotency_class(self.group.algebra, self._kernel()).bit_length()

    def _kernel(self) -> list[dict[int, Number]]:
        vectors = to_numbers(domain_matrix(self.rows).nullspace().to_dense())
        return [{i: value for i, value in enumerate(vector) if value != 0} for vector in vectors]


def nilpotency_class(algebra: LieAlgebra, ideal: list[dict[int, Number]]) -> int:
    """The length of the lower central series of a nilpotent ideal: 1 for an abelian one."""
    level, length = ideal, 1
    while True:
        products = [algebra.bracket(x, y) for x in ideal for y in level]
        level = [p for p in products if p]
        if not level:
            return length
        dense = [[p.get(i, sp.S.Zero) for i in range(algebra.dim)] for p in level]
        reduced = to_numbers(domain_matrix(dense).rref()[0])
        level = [{i: v for i, v in enumerate(row) if v != 0} for row in reduced if any(row)]
        length += 1


def log_structure(group: MatrixGroup) -> LogStructure | None:
    """The structure of the logarithm, or None when a block is of no known kind."""
    blocks = []
    for indices in diagonal_blocks(group.exact_basis):
        parts = tuple(matrix.extract(list(indices), list(indices)) for matrix in group.exact_basis)
        if all(part.is_zero_matrix for part in parts):
            continue
        block = _block(indices, parts)
        if block is None:
            return None
        blocks.append(block)
    return LogStructure(group, tuple(blocks))


def _block(indices: tuple[int, ...], parts: tuple[sp.Matrix, ...]) -> LogBlock | None:
    is_real = all(entry.is_real for part in parts for entry in part.flat())
    size = len(indices)
    if size == 1:
        return _one_by_one(indices, parts, is_real)
    if not is_real:
        return _spin(indices, parts) if size == 2 else None
    scale = tuple(sp.expand(part.trace()) / size for part in parts)
    rest = [(part - s * sp.eye(size)).applyfunc(sp.expand) for part, s in zip(parts, scale, strict=True)]
    rows: tuple[tuple[Number, ...], ...]
    if size in (2, 3) and all((part + part.T).is_zero_matrix for part in rest):
        places = ((1, 0),) if size == 2 else ((2, 1), (0, 2), (1, 0))
        rows = tuple(tuple(part[place] for part in rest) for place in places)
        kind = "plane" if size == 2 else "space"
    elif size == 2:
        rows = tuple(tuple(part[place] for part in rest) for place in ((0, 0), (0, 1), (1, 0)))
        kind = "real2"
    else:
        return None
    scaled = any(scale)
    return LogBlock(kind, indices, (*rows, scale) if scaled else rows, scaled)


def _one_by_one(indices: tuple[int, ...], parts: tuple[sp.Matrix, ...], is_real: bool) -> LogBlock:
    if is_real:
        return LogBlock("scale", indices, (tuple(part[0, 0] for part in parts),), scaled=True)
    entries = [part[0, 0].expand().as_real_imag() for part in parts]
    angle, scale = tuple(im for _, im in entries), tuple(re for re, _ in entries)
    scaled = any(scale)
    return LogBlock("phase", indices, (angle, scale) if scaled else (angle,), scaled)


def _spin(indices: tuple[int, ...], parts: tuple[sp.Matrix, ...]) -> LogBlock | None:
    """-i (v . sigma) / 2."""
    for part in parts:
        if not (part + part.H).applyfunc(sp.expand).is_zero_matrix or sp.expand(part.trace()) != 0:
            return None
    lower = [part[1, 0].expand().as_real_imag() for part in parts]
    rows = (
        tuple(-2 * im for _, im in lower),
        tuple(2 * re for re, _ in lower),
        tuple(-2 * part[0, 0].expand().as_real_imag()[1] for part in parts),
    )
    return LogBlock("spin", indices, rows)
