"""Covariance on board: compound, inverse and flow as kernels, and the term of one estimate in a mean or a fusion.

    compound(X1, S1, X2, S2) -> X, S, mean_shift     to second or fourth order (`groups.maps.covariance`)
    inverse_covariance(X, S) -> Y, S_inverse          X^-1 and Ad_X S Ad_X^T
    flow_covariance(X, S, u, duration, Q) -> Y, S_end X exp(T u) and its covariance
    mean_term(X, Z) -> e                              log(X^-1 Z): a step of the mean is X exp(sum w e / sum w)
    fuse_term(X, Z, information) -> slope, normal     J^T W e and J^T W J of one estimate, e = log(Z^-1 X), J = rjac_inv(e)

A loop over the data is the caller's: nothing here grows with their number.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.errors import InputError
from lie_codegen.groups.catalogue_load import as_group
from lie_codegen.groups.derivation import GroupDerivation, derivation_of
from lie_codegen.groups.kernels import group_kernel
from lie_codegen.groups.maps.checked_log import log_coordinates
from lie_codegen.groups.maps.exponential import exp_matrix, jacobian
from lie_codegen.groups.maps.matrices import GroupMatrices, matrix_port
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.brackets import ad
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Matrix, Vector, identity, matadd, matmul, matvec, number, scaled, transpose
from lie_codegen.kernel.renaming import in_namespace

#: Doublings of the step and terms of its series: exact to rounding for |ad_u| T up to 16.
_DOUBLINGS = 4
_DEGREE = 18
_COVARIANCE = "sums of products of structure constants: Baker, Campbell, Hausdorff to fourth order; see covariance.py"
_BARYCENTRE = "Pennec and Arsigny, exponential barycentres (2013)"


@kernel_factory(group=as_group)
def covariance_kernels(
    group: MatrixGroup | str | Path, order: Literal[2, 4] = 4, *, name: str | None = None
) -> tuple[Kernel, ...]:
    """The kernels of this page for a group.

    Args:
        group: object, catalogue name or file.
        order: of `compound`, 2 or 4.
        name: C identifier that begins every symbol; the group's name if None.

    Raises:
        InputError: another order.
        IdentifierError: the name is no C identifier.
    """
    if order not in (2, 4):
        raise InputError(f"covariance_kernels: order is 2 or 4, given {order!r}")
    data = derivation_of(as_group(group))
    kernels = (_compound(data, order), _inverse(data), _flow(data), _mean_term(data), _fuse_term(data))
    return in_namespace(kernels, name)


def _compound(data: GroupDerivation, order: int) -> Kernel:
    algebra, n = data.group.algebra, data.group.dim

    def body(ops: Arithmetic, X1: Any, S1: Any, X2: Any, S2: Any) -> tuple[Any, ...]:
        matrices = GroupMatrices(ops, data.real)
        right = matrices.read(X2)
        back = _adjoint(matrices, matrices.inverse(right), right)
        first = _transported(back, S1)
        product_of_both = matrices.write(matmul(matrices.read(X1), [row[: data.group.degree] for row in right]))
        total = matadd(first, S2)
        if order == 2:
            return product_of_both, total, [0] * n
        a1, a2 = _second_moments(ops, algebra, first), _second_moments(ops, algebra, S2)
        mixed = matadd(matmul(a1, S2), matmul(a2, first))
        total = matadd(total, _sandwich(ops, algebra, first, S2), ops.constant(1) / 4)
        twelfth = ops.constant(1) / 12
        total = matadd(matadd(total, mixed, twelfth), transpose(mixed), twelfth)
        # -1/24 sum_lm S2_lm ad_l (A1 e_m): the bracket of row sums of S2 with the columns of A1.
        shift: Vector = [0] * n
        for i, j, k, c in algebra.constants():
            weight = matvec([S2[i]], a1[j])[0]
            shift[k] = shift[k] + number(ops, c) * weight
        return product_of_both, total, scaled(ops.constant(-1) / 24, shift)

    inputs = (
        _given_element(data, "X1"),
        _given_covariance(n, "S1"),
        _given_element(data, "X2"),
        _given_covariance(n, "S2"),
    )
    outputs = (_element(data, "X"), _square(n, "S"), Port("mean_shift", (n,)))
    formula = f"X1 exp(hat a) X2 exp(hat b), a ~ (0, S1), b ~ (0, S2): element, covariance and mean to order {order}"
    return _kernel(data, "compound", inputs, outputs, body, formula, _COVARIANCE)


def _inverse(data: GroupDerivation) -> Kernel:
    n = data.group.dim

    def body(ops: Arithmetic, X: Any, S: Any) -> tuple[Any, ...]:
        matrices = GroupMatrices(ops, data.real)
        element = matrices.read(X)
        inverse = matrices.inverse(element)
        return matrices.write(inverse), _transported(_adjoint(matrices, element, inverse), S)

    inputs, outputs = (
        (_given_element(data, "X"), _given_covariance(n, "S")),
        (_element(data, "Y"), _square(n, "S_inverse")),
    )
    return _kernel(
        data, "inverse_covariance", inputs, outputs, body, "Y = X^-1, S_inverse = Ad_X S Ad_X^T", _COVARIANCE
    )


def _flow(data: GroupDerivation) -> Kernel:
    n = data.group.dim

    def body(ops: Arithmetic, X: Any, S: Any, u: Any, duration: Any, Q: Any) -> tuple[Any, ...]:
        matrices = GroupMatrices(ops, data.real)
        moved = exp_matrix(ops, data, scaled(duration, u))
        end = matmul(matrices.read(X), [row[: data.group.degree] for row in matrices.read(moved)])
        h = duration / 2**_DOUBLINGS
        A = [scaled(-1, row) for row in ad(ops, data.group.algebra, scaled(h, u))]
        # Over a short step: F = sum A^k / k!, and the noise sum L^k(h Q) / (k + 1)! with L(P) = A P + P A^T.
        F, power = identity(n), identity(n)
        added = term = [scaled(h, row) for row in Q]
        for k in range(1, _DEGREE + 1):
            power = [scaled(ops.constant(1) / k, row) for row in matmul(A, power)]
            F = matadd(F, power)
            half = matmul(A, term)
            term = [scaled(ops.constant(1) / (k + 1), row) for row in matadd(half, transpose(half))]
            added = matadd(added, term)
        for _ in range(_DOUBLINGS):
            added = matadd(added, _transported(F, added))
            F = matmul(F, F)
        return matrices.write(end), matadd(_transported(F, S), added)

    inputs = (
        _given_element(data, "X"),
        _given_covariance(n, "S"),
        _Given(
            Port("u", (n,), description="constant body velocity"), lambda rng: [rng.uniform(-1, 1) for _ in range(n)]
        ),
        _Given(Port("duration", ()), lambda rng: rng.uniform(0, 1)),
        _given_covariance(n, "Q"),
    )
    outputs = (_element(data, "Y"), _square(n, "S_end"))
    formula = "S' = -ad_u S - S ad_u^T + Q over the duration; to rounding for |ad_u| duration up to 16"
    return _kernel(data, "flow_covariance", inputs, outputs, body, formula, _COVARIANCE)


def _mean_term(data: GroupDerivation) -> Kernel:
    n = data.group.dim

    def body(ops: Arithmetic, X: Any, Z: Any) -> tuple[Any, ...]:
        return (_relative_log(ops, data, X, Z),)

    inputs, outputs = (_given_element(data, "X"), _given_element(data, "Z")), (Port("e", (n,)),)
    return _kernel(data, "mean_term", inputs, outputs, body, "e = log(X^-1 Z)", _BARYCENTRE)


def _fuse_term(data: GroupDerivation) -> Kernel:
    n = data.group.dim

    def body(ops: Arithmetic, X: Any, Z: Any, information: Any) -> tuple[Any, ...]:
        e = _relative_log(ops, data, Z, X)
        J = jacobian(ops, data, e, "right", inverse=True)
        weighted = matmul(transpose(J), information)
        return matvec(weighted, e), matmul(weighted, J)

    inputs = (_given_element(data, "X"), _given_element(data, "Z"), _given_covariance(n, "information"))
    outputs = (Port("slope", (n,)), _square(n, "normal"))
    formula = "slope = J^T W e, normal = J^T W J with e = log(Z^-1 X), J = rjac_inv(e), W = S^-1: a Gauss-Newton step is -normal^-1 slope"
    return _kernel(data, "fuse_term", inputs, outputs, body, formula, "Gauss-Newton for the most probable element")


def _relative_log(ops: Arithmetic, data: GroupDerivation, X: Any, Z: Any) -> Vector:
    matrices = GroupMatrices(ops, data.real)
    columns = data.group.degree
    relative = matmul(matrices.inverse(matrices.read(X)), [row[:columns] for row in matrices.read(Z)])
    return list(log_coordinates(ops, data, matrices.write(relative)))


def _adjoint(matrices: GroupMatrices, element: Matrix, inverse: Matrix) -> Matrix:
    """The matrix of Ad, column by column."""
    return transpose([matrices.Ad(element, inverse, unit) for unit in identity(matrices.real.group.dim)])


def _transported(A: Matrix, S: Matrix) -> Matrix:
    """A S A^T."""
    return matmul(matmul(A, S), transpose(A))


def _second_moments(ops: Arithmetic, algebra: LieAlgebra, S: Matrix) -> Matrix:
    """sum_jk S_jk ad_j ad_k: column c is sum over k, b of ad_k's (b, c) times sum_j S_jk ad_j's column b."""
    n = algebra.dim
    weighted = _weighted(ops, algebra, S)  # [k][a][b] = sum_j S_jk (ad_j)_ab
    result: Matrix = [[0] * n for _ in range(n)]
    for k, c, b, value in algebra.constants():
        for a in range(n):
            if not _zero(weighted[k][a][b]):
                result[a][c] = result[a][c] + number(ops, value) * weighted[k][a][b]
    return result


def _sandwich(ops: Arithmetic, algebra: LieAlgebra, S: Matrix, P: Matrix) -> Matrix:
    """sum_jk S_jk ad_j P ad_k^T."""
    n = algebra.dim
    weighted = [matmul(each, P) for each in _weighted(ops, algebra, S)]
    result: Matrix = [[0] * n for _ in range(n)]
    for k, c, d, value in algebra.constants():
        for a in range(n):
            if not _zero(weighted[k][a][c]):
                result[a][d] = result[a][d] + number(ops, value) * weighted[k][a][c]
    return result


def _weighted(ops: Arithmetic, algebra: LieAlgebra, S: Matrix) -> list[Matrix]:
    """For each k the matrix sum_j S_jk ad_j."""
    return [ad(ops, algebra, column) for column in transpose(S)]


def _zero(x: Scalar) -> bool:
    return isinstance(x, int) and x == 0


def _element(data: GroupDerivation, name: str) -> Port:
    return matrix_port(data.group, name, "element of the group")


def _square(n: int, name: str) -> Port:
    return Port(name, (n, n))


@dataclass(frozen=True)
class _Given:
    """An input, and what draws an admissible value of it."""

    port: Port
    draw: Callable[[random.Random], Any]


def _given_element(data: GroupDerivation, name: str) -> _Given:
    return _Given(_element(data, name), lambda rng: group_kernel(data.group, "log").sample(rng)[0])


def _given_covariance(n: int, name: str) -> _Given:
    def positive(rng: random.Random) -> Matrix:
        root = [[rng.uniform(-0.2, 0.2) for _ in range(n)] for _ in range(n)]
        return matmul(root, transpose(root))

    return _Given(_square(n, name), positive)


def _kernel(
    data: GroupDerivation,
    name: str,
    inputs: Sequence[_Given],
    outputs: Sequence[Port],
    body: Callable[..., tuple[Any, ...]],
    formula: str,
    source: str,
) -> Kernel:
    ports = tuple(each.port for each in inputs)

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        return tuple(each.draw(rng) for each in inputs)

    return Kernel(name, data.group.name, ports, tuple(outputs), body, formula, source, sampler)
