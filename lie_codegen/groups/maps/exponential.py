"""exp(x) = exp(hat(x)) and its Jacobians, in closed form where the spectrum allows it.

    ljac(x) = sum_k ad_x^k / (k + 1)!,  rjac(x) = ljac(-x),  ljac(x) = Ad(exp x) rjac(x),
    d/dt exp(x) = hat(ljac(x) x') exp(x) = exp(x) hat(rjac(x) x').

Both sides of the second line are differenced in the tests. Closed forms: `matrix_function`; the rest: `spectral_functions`. Either is
imported by the first matrix that it is derived for, since compiled kernels are found in the cache without.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lie_codegen.groups.derivation import GroupDerivation
from lie_codegen.groups.maps.matrices import real_rows
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.block_solve import solve
from lie_codegen.kernel.brackets import ad
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.linear import Matrix, Vector, dot, number
from lie_codegen.kernel.structural_zeros import is_zero


def exp_matrix(ops: Arithmetic, data: GroupDerivation, x: Sequence[Scalar]) -> list[list[Any]]:
    """exp(hat(x)); Complex entries for a complex group."""
    group = data.group
    if data.matrix_pattern is None:
        from lie_codegen.groups.maps.rkmk import hat_body
        from lie_codegen.groups.maps.spectral_functions import exponential

        traceless = all(matrix.trace() == 0 for matrix in group.exact_basis)
        A = hat_body(group, ops, x)
        return exponential(
            ops, A, data.matrix_spectrum, data.matrix_relation, unitary=data.is_unitary, traceless=traceless
        )
    from lie_codegen.groups.maps.analytic_functions import EXP
    from lie_codegen.groups.maps.linear_family import LinearFamily
    from lie_codegen.groups.maps.matrix_function import FunctionOfMatrix

    d = group.degree
    function = FunctionOfMatrix(LinearFamily(ops, data.real.basis, x), data.matrix_pattern, EXP)
    columns = [function.column(j) for j in range(d)]
    if not group.is_complex:
        return [[column.get(i, 0) for column in columns] for i in range(d)]
    return [[Complex(column.get(i, 0), column.get(i + d, 0)) for column in columns] for i in range(d)]


def jacobian(ops: Arithmetic, data: GroupDerivation, x: Sequence[Scalar], side: str, *, inverse: bool) -> Matrix:
    """(n, n) ljac or rjac of x, or its inverse; singular where ad x has an eigenvalue 2 pi i k, k != 0."""
    if data.adjoint_pattern is None and data.adjoint_spectrum is not None:
        from lie_codegen.groups.maps.spectral_functions import inverse_jacobian_of_exp, jacobian_of_exp

        function = inverse_jacobian_of_exp if inverse else jacobian_of_exp
        sign = 1 if side == "left" else -1
        return function(ops, ad(ops, data.group.algebra, x), data.adjoint_spectrum, data.adjoint_relation, sign)
    if data.adjoint_pattern is None:
        return _plain(ops, data, x, 1 if side == "left" else -1, inverse=inverse)
    from lie_codegen.groups.maps.analytic_functions import JACOBIANS
    from lie_codegen.groups.maps.linear_family import LinearFamily
    from lie_codegen.groups.maps.matrix_function import FunctionOfMatrix

    family = LinearFamily(ops, data.ads, x)
    closed = FunctionOfMatrix(family, data.adjoint_pattern, JACOBIANS[side, inverse])
    n = data.group.dim
    columns = [closed.column(j) for j in range(n)]
    return [[column.get(i, 0) for column in columns] for i in range(n)]


def _plain(ops: Arithmetic, data: GroupDerivation, x: Sequence[Scalar], sign: int, *, inverse: bool) -> Matrix:
    """The Jacobian modulo the characteristic polynomial of ad; its inverse by blocks."""
    from lie_codegen.groups.maps.spectral_functions import plain_jacobian_of_exp

    traceless = all(matrix.trace() == 0 for matrix in data.ads)
    J = plain_jacobian_of_exp(ops, ad(ops, data.group.algebra, x), traceless=traceless, sign=sign)
    if not inverse:
        return J
    n = data.group.dim
    sparse = {(i, j): value for i, row in enumerate(J) for j, value in enumerate(row) if not is_zero(value)}
    columns = solve(sparse, [{j: 1} for j in range(n)], n)
    return [[column.get(i, 0) for column in columns] for i in range(n)]


def coordinates(ops: Arithmetic, data: GroupDerivation, A: Matrix) -> Vector:
    """The x with hat(x) = A, from as few entries as determine it; A real or Complex, in the algebra."""
    return real_coordinates(ops, data, real_rows(A) if data.group.is_complex else A)


def real_coordinates(ops: Arithmetic, data: GroupDerivation, A: Matrix) -> Vector:
    """The x with hat(x) = A, for A in its real form."""
    return [dot([number(ops, c) for c in row.values()], [A[i][j] for i, j in row]) for row in data.real.coordinates]
