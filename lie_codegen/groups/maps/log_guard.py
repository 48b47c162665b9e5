"""Membership in few operations, where the diagonal blocks are rotations and phases: a sum of squares instead of a maximum of moduli.

A rotation of space is told by R e_1 x R e_2 = R e_3 with R e_1, R e_2 orthonormal: no determinant is left to look at.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

from lie_codegen.groups.derivation import GroupDerivation
from lie_codegen.groups.maps.log_structure import LogBlock
from lie_codegen.groups.maps.membership import blocks_suffice, membership
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.linear import cross, dot, minus, number, total
from lie_codegen.kernel.structural_zeros import add, product

_KINDS = ("space", "plane", "phase", "spin")


def off_group_square(ops: Arithmetic, data: GroupDerivation, X: Sequence[Sequence[Any]]) -> Scalar | None:
    """The squares of what X violates, summed; None where blocks are of other kinds."""
    if not _applies(data):
        return None
    group, d = data.group, data.group.degree
    flat = [Complex.of(entry) if group.is_complex else entry for row in X for entry in row]
    parts = [z.re for z in flat] + [z.im for z in flat] if group.is_complex else flat
    values: list[Scalar] = []
    # What a block looks at itself: of real blocks beside complex ones not the imaginary parts, which are zero.
    inside = {
        part * d * d + i * d + j
        for block in data.log_structure.blocks
        for part in range(2 if block.is_complex else 1)
        for i in block.indices
        for j in block.indices
    }
    for row in membership(group).linear:
        if inside.issuperset(row):
            continue
        terms = [
            product(number(ops, weight), add(parts[k], -1) if k < d * d and k % (d + 1) == 0 else parts[k])
            for k, weight in row.items()
        ]
        values.append(total(terms))
    for block in data.log_structure.blocks:
        values += _block(block, block.part(X))
    return total(value * value for value in values) if values else 0 * parts[0]


@lru_cache(maxsize=64)
def _applies(data: GroupDerivation) -> bool:
    blocks = data.log_structure.blocks
    known = all(block.kind in _KINDS and not block.scaled for block in blocks)
    return known and all(_is_full(block) for block in blocks) and _suffices(data.group)


def _is_full(block: LogBlock) -> bool:
    return block.kind != "space" or len(block.indices) == 3


def _suffices(group: MatrixGroup) -> bool:
    return blocks_suffice(group, scaled=False)


def _block(block: LogBlock, X: Sequence[Sequence[Any]]) -> list[Scalar]:
    if block.kind == "space":
        first, second, third = zip(*X, strict=True)
        return [*minus(cross(first, second), third), dot(first, first) - 1, dot(second, second) - 1, dot(first, second)]
    if block.kind == "plane":
        cosine, sine = X[0][0], X[1][0]
        return [cosine - X[1][1], sine + X[0][1], cosine * cosine + sine * sine - 1]
    if block.kind == "phase":
        z = Complex.of(X[0][0])
        return [z.re * z.re + z.im * z.im - 1]
    (a, b), (c, d) = ([Complex.of(entry) for entry in row] for row in X)
    norm = a.re * a.re + a.im * a.im + b.re * b.re + b.im * b.im - 1
    return [a.re - d.re, a.im + d.im, b.re + c.re, b.im - c.im, norm]
