"""exp(x) = exp(hat(x)) and its Jacobians, in closed form where the spectrum allows it.

    ljac(x) = sum_k ad_x^k / (k + 1)!,  rjac(x) = ljac(-x),  ljac(x) = Ad(exp x) rjac(x),
    d/dt exp(x) = hat(ljac(x) x') exp(x) = exp(x) hat(rjac(x) x').

Both sides of the second line are differenced in the tests. Closed forms: `matrix_function`; the rest: `spectral_functions`, and beyond its
reach `far_routine`. Either is imported by the first matrix that it is derived for, since compiled kernels are found in the cache without.
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
        from lie_codegen.groups.maps.far_routine import chosen, far_exponential
        from lie_codegen.groups.maps.rkmk import hat_body
        from lie_codegen.groups.maps.spectral_functions import exponential

        traceless = all(matrix.trace() == 0 for matrix in group.exact_basis)
        A = hat_body(group, ops, x)
        normal = data.is_unitary or data.is_antisymmetric
        X, near = exponential(ops, A, data.matrix_spectrum, data.matrix_relation, normal=normal, traceless=traceless)
        return chosen(ops, near, X, lambda: far_exponential(data), x)
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
    if data.adjoint_pattern is None:
        from lie_codegen.groups.maps.far_routine import chosen, far_jacobian

        sign = 1 if side == "left" else -1
        J, near = _spectral(ops, data, x, sign, inverse=inverse)
        return chosen(ops, near, J, lambda: far_jacobian(data, sign, inverse=inverse), x)
    from lie_codegen.groups.maps.analytic_functions import JACOBIANS
    from lie_codegen.groups.maps.linear_family import LinearFamily
    from lie_codegen.groups.maps.matrix_function import FunctionOfMatrix

    family = LinearFamily(ops, data.ads, x)
    closed = FunctionOfMatrix(family, data.adjoint_pattern, JACOBIANS[side, inverse])
    n = data.group.dim
    columns = [closed.column(j) for j in range(n)]
    return [[column.get(i, 0) for column in columns] for i in range(n)]


def _spectral(
    ops: Arithmetic, data: GroupDerivation, x: Sequence[Scalar], sign: int, *, inverse: bool
) -> tuple[Matrix, Any]:
    """The Jacobian modulo the characteristic polynomial of ad, and where it is right; without pairs of eigenvalues its inverse by blocks."""
    from lie_codegen.groups.maps import spectral_functions

    n, a = data.group.dim, ad(ops, data.group.algebra, x)
    if data.adjoint_spectrum is not None:
        function = spectral_functions.inverse_jacobian_of_exp if inverse else spectral_functions.jacobian_of_exp
        normal = data.adjoint_is_antisymmetric
        return function(ops, a, data.adjoint_spectrum, data.adjoint_relation, sign, normal=normal)
    traceless = all(matrix.trace() == 0 for matrix in data.ads)
    J, near = spectral_functions.plain_jacobian_of_exp(ops, a, traceless=traceless, sign=sign)
    if not inverse:
        return J, near
    if getattr(ops, "differentiated", False):  # what is not taken has to be finite
        J = [[_regular(ops, near, entry, int(i == j)) for j, entry in enumerate(row)] for i, row in enumerate(J)]
    sparse = {(i, j): value for i, row in enumerate(J) for j, value in enumerate(row) if not is_zero(value)}
    columns = solve(sparse, [{j: 1} for j in range(n)], n)
    return [[column.get(i, 0) for column in columns] for i in range(n)], near


def _regular(ops: Arithmetic, near: Any, entry: Scalar, one: int) -> Scalar:
    return entry if is_zero(entry) else ops.where(near, entry, one)


def coordinates(ops: Arithmetic, data: GroupDerivation, A: Matrix) -> Vector:
    """The x with hat(x) = A, from as few entries as determine it; A real or Complex, in the algebra."""
    return real_coordinates(ops, data, real_rows(A) if data.group.is_complex else A)


def real_coordinates(ops: Arithmetic, data: GroupDerivation, A: Matrix) -> Vector:
    """The x with hat(x) = A, for A in its real form."""
    return [dot([number(ops, c) for c in row.values()], [A[i][j] for i, j in row]) for row in data.real.coordinates]
