"""How the logarithm of a group is taken, found exactly from its matrices.

Over their common block-triangular form every diagonal block of X = exp(hat(x)) depends on a linear image T x of x alone, which is read off
the logarithms of the blocks. A scale, a rotation of the plane, of space or of R^4, with or without a scale, a spin, a real or complex 2 x 2
matrix, a Lorentz transformation have a closed form; other unitary, orthogonal and general blocks are iterated (see `log_routine`). What is left of
x lies in the ideal ker T, whose matrices are strictly block triangular; `logarithm` recovers it in finitely many steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.exact.block_structure import diagonal_blocks, is_block_diagonal
from lie_codegen.exact.numbers import Number, domain_matrix, real_coordinates, to_numbers
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.on_demand import sympy as sp

#: The entries of a 4 x 4 matrix that the closed forms of SO(4) and SO(3, 1) give.
PLANES = ((1, 0), (2, 0), (3, 0), (2, 1), (3, 1), (3, 2))


@dataclass(frozen=True)
class LogBlock:
    """One diagonal block of a known kind.

    Attributes:
        kind: scale, phase, plane, space, spin, real2, space4, complex2, lorentz; iterated: unitary, rotation, matrix.
        indices: the rows and columns of the block.
        rows: the linear forms in x that the block's logarithm gives, in the kind's own order.
        special: whether a unitary block has determinant 1.
        scaled: whether the last row is the block's scale, log |det X|^(1/size).
    """

    kind: str
    indices: tuple[int, ...]
    rows: tuple[tuple[Number, ...], ...]
    scaled: bool = False
    special: bool = False

    @property
    def is_iterated(self) -> bool:
        """Whether its logarithm needs a loop."""
        return self.kind in ("unitary", "rotation", "matrix")

    @property
    def is_complex(self) -> bool:
        """Whether its entries are complex."""
        return self.kind in ("phase", "spin", "complex2")

    def part(self, X: Sequence[Sequence[Any]]) -> list[list[Any]]:
        """The block of X; real where its kind is, beside complex ones as in SO(3) x SU(2)."""
        part = [[X[i][j] for j in self.indices] for i in self.indices]
        if self.is_complex:
            return part
        return [[entry.re if isinstance(entry, Complex) else entry for entry in row] for row in part]


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

    @property
    def iterated(self) -> tuple[LogBlock, ...]:
        """The blocks whose logarithm needs a loop."""
        return tuple(block for block in self.blocks if block.is_iterated)

    @cached_property
    def is_closed(self) -> bool:
        """Whether closed forms say it all: no loops, and blocks that do not depend on each other.

        Blocks that do may each take a logarithm that is no common one, as the phases exp(i t), exp(2 i t) at t = 3.
        """
        return not self.iterated and (not self.rows or int(domain_matrix(self.rows).rank()) == len(self.rows))

    @cached_property
    def is_onto(self) -> bool:
        """Whether the blocks' logarithms find one of every element that has one: all of SU(k), U(k), SO(k), or closed, and independent."""
        if self.is_closed:
            return True
        full = 0
        for block in self.blocks:
            k = len(block.indices)
            if block.kind == "matrix":
                return False
            sizes = {"unitary": k * k - block.special, "rotation": k * (k - 1) // 2}
            full += sizes.get(block.kind, len(block.rows))
        return int(domain_matrix(self.rows).rank()) == full

    @cached_property
    def order(self) -> tuple[int, ...]:
        """Basis elements, those with block-diagonal matrices first."""
        blocks = diagonal_blocks(self.group.exact_basis)
        # With these first the pivots are found among them where they can be: the section is then block-diagonal, as its exponential.
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
        # Scales first: of forms that depend on each other those that no whole turn makes ambiguous.
        places = sorted(range(len(self.rows)), key=lambda r: not self._is_scale(r))
        columns = [[self.rows[r][i] for r in places] for i in self.pivots]
        _, found = domain_matrix(columns).rref()
        independent = [places[p] for p in found]
        square = domain_matrix([[self.rows[r][i] for i in self.pivots] for r in independent])
        inverse = to_numbers(square.inv())
        return tuple(
            (i, {r: value for r, value in zip(independent, weights, strict=True) if value != 0})
            for i, weights in zip(self.pivots, inverse, strict=True)
        )

    def _is_scale(self, row: int) -> bool:
        ends = [(len(block.rows), block) for block in self.blocks]
        for length, block in ends:
            if row < length:
                return block.scaled and row == length - 1
            row -= length
        return False

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
        # x = section + rest, the rest in ker T, a nilpotent ideal. exp(-section) X = exp(rest) up to brackets of the two: taken
        # off, the error lies as deep again in the lower central series, so that log2 of its length many corrections do.
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


def log_structure(group: MatrixGroup) -> LogStructure:
    """The structure of the logarithm."""
    blocks = []
    for indices in diagonal_blocks(group.exact_basis):
        parts = tuple(matrix.extract(list(indices), list(indices)) for matrix in group.exact_basis)
        if all(part.is_zero_matrix for part in parts):
            continue
        blocks.append(_block(indices, parts, group.is_complex))
    return LogStructure(group, tuple(blocks))


def _block(indices: tuple[int, ...], parts: tuple[sp.Matrix, ...], is_complex: bool) -> LogBlock:
    return _closed_block(indices, parts) or _iterated_block(indices, parts, is_complex)


def _iterated_block(indices: tuple[int, ...], parts: tuple[sp.Matrix, ...], is_complex: bool) -> LogBlock:
    """All entries of the block's logarithm, real and imaginary parts of a complex group."""
    skew = all((part + part.H).applyfunc(sp.expand).is_zero_matrix for part in parts)
    kind = "matrix" if not skew else "unitary" if is_complex else "rotation"
    special = all(sp.expand(part.trace()) == 0 for part in parts)
    flat = [real_coordinates(part) for part in parts]
    step = 1 if is_complex else 2
    rows = tuple(tuple(entries[k] for entries in flat) for k in range(0, len(flat[0]), step))
    return LogBlock(kind, indices, rows, special=special)


def _closed_block(indices: tuple[int, ...], parts: tuple[sp.Matrix, ...]) -> LogBlock | None:
    is_real = all(entry.is_real for part in parts for entry in part.flat())
    size = len(indices)
    if size == 1:
        return _one_by_one(indices, parts, is_real)
    if not is_real:
        return (_spin(indices, parts) or _complex2(indices, parts)) if size == 2 else None
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
    elif size == 4:
        return _rotations_of_space4(indices, parts) or _lorentz(indices, parts)
    else:
        return None
    scaled = any(scale)
    return LogBlock(kind, indices, (*rows, scale) if scaled else rows, scaled)


def _rotations_of_space4(indices: tuple[int, ...], parts: tuple[sp.Matrix, ...]) -> LogBlock | None:
    """All of so(4): the entries below the diagonal."""
    if not all((part + part.T).is_zero_matrix for part in parts):
        return None
    rows = tuple(tuple(part[place] for part in parts) for place in PLANES)
    return LogBlock("space4", indices, rows) if int(domain_matrix(rows).rank()) == 6 else None


def _lorentz(indices: tuple[int, ...], parts: tuple[sp.Matrix, ...]) -> LogBlock | None:
    """All of so(3, 1) with one of the four coordinates as time, last in the block's order."""
    for time in range(4):
        order = [i for i in range(4) if i != time] + [time]
        S = sp.diag(*[-1 if i == time else 1 for i in range(4)])
        if all((part.T * S + S * part).applyfunc(sp.expand).is_zero_matrix for part in parts):
            rows = tuple(tuple(part[order[i], order[j]] for part in parts) for i, j in PLANES)
            if int(domain_matrix(rows).rank()) == 6:
                return LogBlock("lorentz", tuple(indices[i] for i in order), rows)
    return None


def _complex2(indices: tuple[int, ...], parts: tuple[sp.Matrix, ...]) -> LogBlock | None:
    """All of sl(2, C): real and imaginary parts of the entries (0, 0), (0, 1), (1, 0)."""
    if any(sp.expand(part.trace()) != 0 for part in parts):
        return None
    entries = [[part[place].expand().as_real_imag() for place in ((0, 0), (0, 1), (1, 0))] for part in parts]
    rows = tuple(tuple(each[k][side] for each in entries) for k in range(3) for side in range(2))
    return LogBlock("complex2", indices, rows) if int(domain_matrix(rows).rank()) == 6 else None


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
