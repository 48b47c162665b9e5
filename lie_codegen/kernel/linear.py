"""Vectors and matrices of scalars over any arithmetic; plain zeros and ones stay plain."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.structural_zeros import add, product
from lie_codegen.on_demand import sympy as sp

Vector = list[Scalar]
Matrix = list[list[Scalar]]


def number(ops: Arithmetic, value: Any) -> Scalar:
    """An exact number as a scalar; integers stay Python integers."""
    if isinstance(value, int):
        return value
    return int(value) if getattr(value, "is_Integer", False) else ops.constant(value)


def total(terms: Iterable[Scalar]) -> Scalar:
    """The sum, zeros absorbed."""
    result: Scalar = 0
    for term in terms:
        result = add(result, term)
    return result


def dot(a: Sequence[Scalar], b: Sequence[Scalar]) -> Scalar:
    """sum a_i b_i."""
    return total(product(x, y) for x, y in zip(a, b, strict=True))


def plus(*vectors: Sequence[Scalar]) -> Vector:
    """The sum of vectors."""
    return [total(entries) for entries in zip(*vectors, strict=True)]


def minus(a: Sequence[Scalar], b: Sequence[Scalar]) -> Vector:
    """a - b."""
    return [add(x, product(-1, y)) for x, y in zip(a, b, strict=True)]


def negative(a: Sequence[Scalar]) -> Vector:
    """-a."""
    return [product(-1, x) for x in a]


def scaled(factor: Scalar, a: Sequence[Scalar]) -> Vector:
    """factor a."""
    return [product(factor, x) for x in a]


def cross(a: Sequence[Scalar], b: Sequence[Scalar]) -> Vector:
    """a x b in three dimensions."""
    return [add(product(a[j], b[k]), product(-1, product(a[k], b[j]))) for j, k in ((1, 2), (2, 0), (0, 1))]


def constant_matrix(ops: Arithmetic, matrix: sp.MatrixBase) -> Matrix:
    """An exact matrix as scalars."""
    return [[number(ops, entry) for entry in row] for row in matrix.tolist()]


def matvec(matrix: Sequence[Sequence[Scalar]], vector: Sequence[Scalar]) -> Vector:
    """matrix vector."""
    return [dot(row, vector) for row in matrix]


def matmul(a: Sequence[Sequence[Scalar]], b: Sequence[Sequence[Scalar]]) -> Matrix:
    """a b."""
    columns = list(zip(*b, strict=True))
    return [[dot(row, column) for column in columns] for row in a]


def matadd(a: Sequence[Sequence[Scalar]], b: Sequence[Sequence[Scalar]], factor: Scalar = 1) -> Matrix:
    """a + factor b."""
    return [plus(x, scaled(factor, y)) for x, y in zip(a, b, strict=True)]


def transpose(a: Sequence[Sequence[Scalar]]) -> Matrix:
    """The transpose."""
    return [list(row) for row in zip(*a, strict=True)]


def identity(size: int) -> Matrix:
    """The identity, in plain integers."""
    return [[int(i == j) for j in range(size)] for i in range(size)]
