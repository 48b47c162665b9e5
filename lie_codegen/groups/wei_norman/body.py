"""The Wei-Norman equations g' = M(g) u over any arithmetic.

    X = exp(g_1 A_1) ... exp(g_n A_n),  X' = X hat(u),
    M(g)^{-1} e_j = exp(-g_n ad_n) ... exp(-g_{j+1} ad_{j+1}) e_j.

Each g_k occurs once in a column, so entries are multilinear in the modes and nothing needs simplifying.
Wei and Norman, Proc. AMS 15 (1964) 327; Leonard and Krishnaprasad, TR 93-59, (12)-(15).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

from lie_codegen.groups.wei_norman.conjugation import Conjugation
from lie_codegen.groups.wei_norman.data import WeiNormanData
from lie_codegen.groups.wei_norman.exponential_entries import ExponentialEntries
from lie_codegen.groups.wei_norman.frames import Factors, Frames
from lie_codegen.groups.wei_norman.products import times_matrix, times_vector
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.block_solve import SparseMatrix
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.structural_zeros import add


def inverse_columns(ops: Arithmetic, data: WeiNormanData, g: Sequence[Scalar]) -> SparseMatrix:
    """M(g)^{-1} as (row, column) -> entry, in the textbook form of its entries, for exact display."""
    n = data.group.dim
    exponentials: dict[int, Mapping[tuple[int, int], Scalar]] = {}
    matrix: dict[tuple[int, int], Scalar] = {}
    for j in range(n):
        column: dict[int, Scalar] = {j: 1}
        for k in range(j + 1, n):
            if k not in exponentials:
                exponentials[k] = ExponentialEntries(ops, -g[k], data.adjoint[k], printed=True).sparse()
            column = times_vector(exponentials[k], column)
        matrix.update({(i, j): value for i, value in column.items()})
    return matrix


def rate(ops: Arithmetic, data: WeiNormanData, g: Sequence[Scalar], u: Sequence[Scalar]) -> list[Scalar]:
    """M(g) u."""
    solution = _frames(ops, data, g).solve(data.steps, dict(enumerate(u)))
    return [solution.get(i, 0) for i in range(data.group.dim)]


def matrix(ops: Arithmetic, data: WeiNormanData, g: Sequence[Scalar]) -> list[list[Scalar]]:
    """M(g), row by row."""
    frames, n = _frames(ops, data, g), data.group.dim
    columns = [frames.solve(data.steps, {j: 1}) for j in range(n)]
    return [[column.get(i, 0) for column in columns] for i in range(n)]


def body_velocity(ops: Arithmetic, data: WeiNormanData, g: Sequence[Scalar], rates: Sequence[Scalar]) -> list[Scalar]:
    """u = M(g)^{-1} g': E_n (... E_2 (e_1 g_1') + e_2 g_2' ...) + e_n g_n'."""
    factors, n = _factors(ops, data, g), data.group.dim
    velocity: dict[int, Scalar] = {}
    for k in range(n):
        velocity = times_vector(factors(k, False), velocity)
        velocity[k] = add(velocity.get(k, 0), rates[k])
    return [velocity.get(i, 0) for i in range(n)]


def _frames(ops: Arithmetic, data: WeiNormanData, g: Sequence[Scalar]) -> Frames:
    return Frames(_factors(ops, data, g), data.group.dim)


def _factors(ops: Arithmetic, data: WeiNormanData, g: Sequence[Scalar]) -> Factors:
    @cache
    def factor(k: int, forward: bool) -> SparseMatrix:
        exponential = data.turns[k]
        if isinstance(exponential, Conjugation):
            return exponential.values(ops, data.real, g[k], forward)
        return ExponentialEntries(ops, g[k], exponential if forward else exponential.reflected).sparse()

    return factor


def product_exp(ops: Arithmetic, data: WeiNormanData, g: Sequence[Scalar]) -> list[list[Any]]:
    """exp(g_1 A_1) ... exp(g_n A_n), row by row; Complex entries for a complex group."""
    size = data.group.degree * (2 if data.group.is_complex else 1)
    columns = data.group.degree
    product_: dict[tuple[int, int], Scalar] = {(i, i): 1 for i in range(columns)}
    for k in reversed(range(data.group.dim)):
        factor = ExponentialEntries(ops, g[k], data.defining[k]).sparse()
        product_ = times_matrix(factor, product_)
    if not data.group.is_complex:
        return [[product_.get((i, j), 0) for j in range(columns)] for i in range(size)]
    return [
        [Complex(product_.get((i, j), 0), product_.get((i + columns, j), 0)) for j in range(columns)]
        for i in range(columns)
    ]
