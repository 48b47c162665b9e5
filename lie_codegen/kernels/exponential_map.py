"""exp(x) = exp(hat(x)) and its Jacobians, in closed form where the spectrum allows it.

    ljac(x) = sum_k ad_x^k / (k + 1)!,  rjac(x) = ljac(-x),  ljac(x) = Ad(exp x) rjac(x),
    d/dt exp(x) = hat(ljac(x) x') exp(x) = exp(x) hat(rjac(x) x').

Rossmann, Lie Groups (2002), 1.2, Theorem 5; Chirikjian, Stochastic Models, Information Theory and Lie Groups 2 (2012), 10.7.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from lie_codegen.kernels.arithmetic import Arithmetic, Scalar
from lie_codegen.kernels.block_solve import add, is_zero, product, solve
from lie_codegen.kernels.complex_scalar import Complex
from lie_codegen.kernels.dense_functions import EvenOddExponentials, exponential, symmetric_nodes
from lie_codegen.kernels.group_derivation import GroupDerivation
from lie_codegen.kernels.group_matrices import real_rows
from lie_codegen.kernels.linear import Matrix, Vector, dot, identity, matadd, matmul, number
from lie_codegen.kernels.matrix_function import (
    EXP,
    LEFT_JACOBIAN,
    LEFT_JACOBIAN_INVERSE,
    RIGHT_JACOBIAN,
    RIGHT_JACOBIAN_INVERSE,
    FunctionOfMatrix,
    LinearFamily,
    MatrixFunction,
)
from lie_codegen.kernels.rkmk import hat_body

_FUNCTIONS: dict[tuple[str, bool], MatrixFunction] = {
    ("left", False): LEFT_JACOBIAN,
    ("right", False): RIGHT_JACOBIAN,
    ("left", True): LEFT_JACOBIAN_INVERSE,
    ("right", True): RIGHT_JACOBIAN_INVERSE,
}


def exp_matrix(ops: Arithmetic, data: GroupDerivation, x: Sequence[Scalar]) -> list[list[Any]]:
    """exp(hat(x)); Complex entries for a complex group."""
    group = data.group
    if data.matrix_pattern is None:
        return exponential(ops, hat_body(group, ops, x))
    d = group.degree
    function = FunctionOfMatrix(LinearFamily(ops, data.real.basis, x), data.matrix_pattern, EXP)
    columns = [function.column(j) for j in range(d)]
    if not group.is_complex:
        return [[column.get(i, 0) for column in columns] for i in range(d)]
    return [[Complex(column.get(i, 0), column.get(i + d, 0)) for column in columns] for i in range(d)]


def jacobian(ops: Arithmetic, data: GroupDerivation, x: Sequence[Scalar], side: str, *, inverse: bool) -> Matrix:
    """(n, n) ljac or rjac of x, or its inverse; singular where ad x has an eigenvalue 2 pi i k, k != 0."""
    if data.adjoint_pattern is None:
        return _by_quadrature(ops, data, [product(-1, c) for c in x] if side == "right" else x, inverse=inverse)
    family = LinearFamily(ops, data.ads, x)
    function = FunctionOfMatrix(family, data.adjoint_pattern, _FUNCTIONS[side, inverse])
    n = data.group.dim
    columns = [function.column(j) for j in range(n)]
    return [[column.get(i, 0) for column in columns] for i in range(n)]


def _by_quadrature(ops: Arithmetic, data: GroupDerivation, x: Sequence[Scalar], *, inverse: bool) -> Matrix:
    """ljac(x) = Ad(H) S with S = int_{-1/2}^{1/2} Ad(exp(s x)) ds and H = exp(x/2); the inverse is S^{-1} Ad(H^{-1})."""
    n = data.group.dim
    functions = EvenOddExponentials(ops, hat_body(data.group, ops, x))
    even, odd = functions.cosh(Fraction(1, 2)), functions.sinh(Fraction(1, 2))
    forward, backward = matadd(even, odd), matadd(even, odd, -1)
    averaged = _averaged(ops, data, functions)
    if not inverse:
        columns = [_conjugate(ops, data, forward, [row[j] for row in averaged], backward) for j in range(n)]
        return [[column[i] for column in columns] for i in range(n)]
    sides = [_conjugate(ops, data, backward, unit, forward) for unit in identity(n)]
    sparse = {(i, j): value for i, row in enumerate(averaged) for j, value in enumerate(row) if not is_zero(value)}
    right = [{i: value for i, value in enumerate(column) if not is_zero(value)} for column in sides]
    columns = [[solution.get(i, 0) for i in range(n)] for solution in solve(ops, sparse, right, n)]
    return [[column[i] for column in columns] for i in range(n)]


def _conjugate(ops: Arithmetic, data: GroupDerivation, X: Matrix, x: Sequence[Scalar], X_inverse: Matrix) -> Vector:
    """Coordinates of X hat(x) X^{-1}."""
    return coordinates(ops, data, matmul(X, matmul(hat_body(data.group, ops, x), X_inverse)))


def coordinates(ops: Arithmetic, data: GroupDerivation, A: Matrix) -> Vector:
    """The x with hat(x) = A, from as few entries as determine it; A real or Complex, in the algebra."""
    return real_coordinates(ops, data, real_rows(A) if data.group.is_complex else A)


def real_coordinates(ops: Arithmetic, data: GroupDerivation, A: Matrix) -> Vector:
    """The x with hat(x) = A, for A in its real form."""
    return [dot([number(ops, c) for c in row.values()], [A[i][j] for i, j in row]) for row in data.real.coordinates]


def _averaged(ops: Arithmetic, data: GroupDerivation, functions: EvenOddExponentials) -> Matrix:
    """int_{-1/2}^{1/2} Ad(exp(s x)) ds: the pair +-s gives 2 (C B C - S B S) with C = cosh(s A), S = sinh(s A)."""
    n, size = data.group.dim, data.real.size
    pairs = []
    for s, weight in symmetric_nodes():
        even, odd = functions.cosh(s), functions.sinh(s)
        if data.group.is_complex:
            even, odd = real_rows(even), real_rows(odd)
        pairs.append((ops.constant(2 * weight), even, odd))
    kernel: dict[tuple[int, int], Scalar] = {}

    def moved(first: int, second: int) -> Scalar:
        """sum of weight (C C - S S) at two flat positions; symmetric in them."""
        key = (min(first, second), max(first, second))
        if key not in kernel:
            (p, a), (b, q) = divmod(key[0], size), divmod(key[1], size)
            total: Scalar = 0
            for weight, even, odd in pairs:
                value = add(product(even[p][a], even[b][q]), product(-1, product(odd[p][a], odd[b][q])))
                total = add(total, product(weight, value))
            kernel[key] = total
        return kernel[key]

    result: Matrix = [[0] * n for _ in range(n)]
    for j, matrix in enumerate(data.real.basis):
        entries = [(a, b, matrix[a, b]) for a in range(size) for b in range(size) if matrix[a, b] != 0]
        for k, row in enumerate(data.real.coordinates):
            total: Scalar = 0
            for (p, q), c in row.items():
                for a, b, value in entries:
                    total = add(total, product(number(ops, c * value), moved(p * size + a, b * size + q)))
            result[k][j] = total
    return result
