"""The candidate for log(X), and the blocks and steps it is made of.

1. The diagonal blocks give T x (see `log_structure`); x_0 is the section of T x. exp(x_0) is the block-diagonal part D of X
   when the section's matrices are block diagonal.
2. N = exp(x_k)^{-1} X is unipotent, and its logarithm u a finite series;
   x_{k+1} = x_k + rjac(x_k)^{-1} u.
   The error lies in ker T and its depth in the lower central series doubles, so finitely many steps are exact: one for
   SE(2), SE(3) and SE_2(3), where ker T is abelian; two for class 2 and 3.

Where a block has no closed form its logarithm is iterated: `log_routine`.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from lie_codegen.groups.derivation import GroupDerivation
from lie_codegen.groups.maps.analytic_functions import RIGHT_JACOBIAN_INVERSE
from lie_codegen.groups.maps.carried_quaternions import carried
from lie_codegen.groups.maps.exponential import exp_matrix, jacobian, real_coordinates
from lie_codegen.groups.maps.linear_family import LinearFamily
from lie_codegen.groups.maps.log_blocks import (
    Entries,
    complex2_log,
    determinant_3,
    full_quaternion_log,
    lorentz_log,
    plane_log,
    real2_log,
    space4_log,
    space_log,
    spin_log,
)
from lie_codegen.groups.maps.log_structure import LogBlock, LogStructure
from lie_codegen.groups.maps.matrices import GroupMatrices
from lie_codegen.groups.maps.matrix_function import FunctionOfMatrix
from lie_codegen.groups.maps.rotation_log import unit_log
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.linear import Matrix, Vector, matadd, matmul, matvec, number, plus
from lie_codegen.kernel.structural_zeros import add, is_zero, product


def candidate(ops: Arithmetic, data: GroupDerivation, X: Entries, iterated: Sequence[Scalar] = ()) -> Vector:
    """The x that the logarithms of the diagonal blocks give; those of iterated blocks one after another in `iterated`."""
    structure = data.log_structure
    logs: Vector = []
    left = list(iterated)
    for block in structure.blocks:
        if block.is_iterated:
            logs, left = logs + left[: len(block.rows)], left[len(block.rows) :]
        else:
            logs += block_log(ops, block, X)
    x: Vector = [0] * data.group.dim
    for i, weights in structure.section:
        for r, weight in weights.items():
            x[i] = add(x[i], product(number(ops, weight), logs[r]))
    for step in range(structure.steps):
        x = _corrected(ops, data, structure, x, X, first=step == 0)
    return x


def block_log(ops: Arithmetic, block: LogBlock, X: Entries) -> list[Scalar]:
    """The values of the block's linear forms."""
    known = carried(X, block.indices)
    if known is not None and not block.scaled:
        return unit_log(ops, known) if block.kind == "space" else full_quaternion_log(ops, known[0], known[1:])
    part = block.part(X)
    if block.kind == "scale":
        return [ops.log(part[0][0])]
    if block.kind == "phase":
        z = Complex.of(part[0][0])
        angle = ops.atan2(z.im, z.re)
        return [angle, ops.log(z.re * z.re + z.im * z.im) / 2] if block.scaled else [angle]
    if block.kind == "plane":
        angle, square = plane_log(ops, part)
        return [angle, ops.log(square) / 2] if block.scaled else [angle]
    if block.kind == "spin":
        return spin_log(ops, part)
    if block.kind == "space4":
        return space4_log(ops, part)
    if block.kind == "lorentz":
        return lorentz_log(ops, part)
    if block.kind == "complex2":
        return complex2_log(ops, part)
    if block.kind == "space":
        if not block.scaled:
            return space_log(ops, part)
        scale = ops.log(determinant_3(part)) / 3
        return [*space_log(ops, part, ops.exp(scale)), scale]
    if not block.scaled:
        return real2_log(ops, part)
    determinant = part[0][0] * part[1][1] - part[0][1] * part[1][0]
    return [*real2_log(ops, part, ops.sqrt(determinant)), ops.log(determinant) / 2]


def _corrected(
    ops: Arithmetic, data: GroupDerivation, structure: LogStructure, x: Vector, X: Entries, *, first: bool
) -> Vector:
    """x + rjac(x)^{-1} log(exp(x)^{-1} X)."""
    matrices = GroupMatrices(ops, data.real)
    element = matrices.read(X)
    if not structure.pivots:
        return _unipotent_log(ops, data, element)
    if first and structure.splits:
        block = data.real_block_of
        size = range(data.real.size)
        diagonal = [[element[i][j] if block[i] == block[j] else 0 for j in size] for i in size]
        inverse = matrices.inverse(diagonal)
    else:
        backward = exp_matrix(ops, data, [product(-1, c) for c in x])
        inverse = matrices.read(backward)
    rest = _unipotent_log(ops, data, matmul(inverse, element))
    return plus(x, _right_jacobian_inverse(ops, data, x, rest, restricted=first))


def _unipotent_log(ops: Arithmetic, data: GroupDerivation, N: Matrix) -> Vector:
    """Coordinates of log N = sum_k (-1)^{k+1} (N - I)^k / k; N - I is strictly block triangular."""
    block = data.real_block_of
    size = range(data.real.size)
    Z = [[0 if block[i] == block[j] else N[i][j] for j in size] for i in size]
    total, power, k = Z, Z, 1
    while True:
        power, k = matmul(power, Z), k + 1
        if all(is_zero(entry) for row in power for entry in row):
            return real_coordinates(ops, data, total)
        total = matadd(total, power, ops.constant(Fraction((-1) ** (k + 1), k)))


def _right_jacobian_inverse(
    ops: Arithmetic, data: GroupDerivation, x: Sequence[Scalar], u: Vector, *, restricted: bool
) -> Vector:
    """rjac(x)^{-1} u, for x in the section (restricted) or anywhere."""
    pattern = data.section_pattern if restricted else data.adjoint_pattern
    if pattern is None:
        return matvec(jacobian(ops, data, x, "right", inverse=True), u)
    function = FunctionOfMatrix(LinearFamily(ops, data.ads, x), pattern, RIGHT_JACOBIAN_INVERSE)
    image = function.apply({i: value for i, value in enumerate(u) if not is_zero(value)})
    return [image.get(i, 0) for i in range(data.group.dim)]
