"""One step back to the group for flight code: quadratically convergent, without iteration, decomposition or allocation.

    1. entries that are linear in X (fixed rows, columns and relations) are put right,
    2. X <- X (3 - X* X)/2 on blocks that keep a form S, X* = S^{-1} X^H S (for S = 1 the step of Newton and Schulz, whose limit is the polar factor);
       with a scale, X* X over its mean,
    3. X <- X det^{-1/n} where the determinant is 1; only its phase on SU(n).
    Other groups: exp(log X), whose logarithm is that of the nearest element.
The error falls to its square: 1e-3 to 1e-6 to 1e-12. The step 2 diverges from |R| > sqrt 3: look at defect(X) where that can happen.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lie_codegen.exact.block_structure import diagonal_blocks
from lie_codegen.groups.derivation import GroupDerivation
from lie_codegen.groups.maps.defect import determinant
from lie_codegen.groups.maps.exponential import exp_matrix
from lie_codegen.groups.maps.kept_forms import Form
from lie_codegen.groups.maps.log_routine import far_log
from lie_codegen.groups.maps.matrices import GroupMatrices
from lie_codegen.groups.maps.membership import Membership, blocks_suffice, membership
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.linear import (
    Matrix,
    constant_matrix,
    identity,
    matadd,
    matmul,
    number,
    scaled,
    total,
    transpose,
)
from lie_codegen.kernel.structural_zeros import add, product
from lie_codegen.on_demand import sympy as sp


def renormalised(ops: Arithmetic, data: GroupDerivation, X: Sequence[Sequence[Any]]) -> Matrix:
    """The port's form of the element that one step leads to."""
    conditions = membership(data.group)
    matrices = GroupMatrices(ops, data.real)
    element = matrices.read(X)
    relations = [row for row in conditions.linear if len(row) > 1]
    if relations:
        element = _on_the_envelope(ops, data, element)
    blocks = [block for block, _ in data.real.blocks if len(block) > 1]
    forms = conditions.forms
    if conditions.normaliser or conditions.logarithm:
        return exp_matrix(ops, data, far_log(ops, data, X))
    if not forms:
        pass
    elif _all_orthogonal(data) and blocks_suffice(data.group, scaled=False):
        for block in blocks:
            element = _replaced(element, block, _step(ops, _part(element, block), identity(len(block)), 1))
    elif all(_conformal(data, block) for block in blocks) and blocks_suffice(data.group, scaled=True):
        for block in blocks:
            part = _part(element, block)
            mean = total(entry * entry for row in part for entry in row if not isinstance(entry, int)) / len(block)
            element = _replaced(element, block, _step(ops, part, identity(len(block)), mean))
    elif len(forms) == 1 and not forms[0].semi and (S := _real_form(data, forms[0])).det() != 0:
        inverse = constant_matrix(ops, S.inv())
        star = matmul(inverse, matmul(transpose(element), constant_matrix(ops, S)))
        if forms[0].dual:
            star = matmul(constant_matrix(ops, S), matmul(transpose(element), inverse))
        element = _corrected(ops, element, matmul(star, element), 1)
    else:
        return exp_matrix(ops, data, far_log(ops, data, X))
    return _of_determinant_one(ops, data, conditions, matrices.write(element))


def _part(X: Matrix, block: Sequence[int]) -> Matrix:
    return [[X[i][j] for j in block] for i in block]


def _replaced(X: Matrix, block: Sequence[int], part: Matrix) -> Matrix:
    result = [list(row) for row in X]
    for i, row in zip(block, part, strict=True):
        for j, entry in zip(block, row, strict=True):
            result[i][j] = entry
    return result


def _step(ops: Arithmetic, X: Matrix, S: Matrix, mean: Scalar) -> Matrix:
    """X (3 - X^T S X / mean)/2."""
    return _corrected(ops, X, matmul(transpose(X), matmul(S, X)), mean)


def _corrected(ops: Arithmetic, X: Matrix, square: Matrix, mean: Scalar) -> Matrix:
    if not (isinstance(mean, int) and mean == 1):
        square = [scaled(1 / mean, row) for row in square]
    # X + X (1 - X* X)/2 rather than X (3 - X* X)/2: X on the group comes back to its last digit.
    half = ops.constant(sp.Rational(1, 2))
    rest = [
        [product(half, add(int(i == j), product(-1, e))) for j, e in enumerate(row)] for i, row in enumerate(square)
    ]
    return matadd(X, matmul(X, rest))


def _all_orthogonal(data: GroupDerivation) -> bool:
    return all(orthogonal for block, orthogonal in data.real.blocks if len(block) > 1)


def _conformal(data: GroupDerivation, block: Sequence[int]) -> bool:
    """Whether the block is a scale times a rotation, in the real form."""
    for matrix in data.real.basis:
        part = matrix.extract(list(block), list(block))
        even = (part + part.T) / 2
        if not (even - sp.eye(len(block)) * even[0, 0]).applyfunc(sp.expand).is_zero_matrix:
            return False
    return True


def _real_form(data: GroupDerivation, form: Form) -> sp.Matrix:
    """The form on the real matrices [[Re, -Im], [Im, Re]]: of a hermitian one its own real form, of a bilinear one Re (S z z)."""
    S = form.matrix
    if not data.group.is_complex:
        return sp.Matrix(S)
    re, im = S.applyfunc(sp.re), S.applyfunc(sp.im)
    if form.conjugate:
        return sp.Matrix.vstack(sp.Matrix.hstack(re, -im), sp.Matrix.hstack(im, re))
    return sp.Matrix.vstack(sp.Matrix.hstack(re, -im), sp.Matrix.hstack(-im, -re))


def _on_the_envelope(ops: Arithmetic, data: GroupDerivation, X: Matrix) -> Matrix:
    """The orthogonal projection of X to 1 + (the span of all products of the A_i)."""
    conditions = membership(data.group)
    d = data.group.degree
    width = d * d * (2 if data.group.is_complex else 1)
    rows = np.array([[float(row.get(k, 0)) for k in range(width)] for row in conditions.linear])
    Q = np.linalg.svd(rows, full_matrices=False)[2]
    P = Q.T @ Q
    P[np.abs(P) < 1e-14] = 0.0
    places = [(i, j) for i in range(d) for j in range(d)]
    if data.group.is_complex:
        places += [(i + d, j) for i in range(d) for j in range(d)]
    moved = [add(X[i][j], -1) if i == j else X[i][j] for i, j in places]
    found = [
        add(X[i][j], total(product(ops.constant(-float(w)), m) for w, m in zip(P[k], moved, strict=True) if w))
        for k, (i, j) in enumerate(places)
    ]
    result = [list(row) for row in X]
    for (i, j), value in zip(places, found, strict=True):
        result[i][j] = value
        if data.group.is_complex:
            # [[Re, -Im], [Im, Re]]
            if i < d:
                result[i + d][j + d] = value
            else:
                result[i - d][j + d] = product(-1, value)
    return result


def _of_determinant_one(ops: Arithmetic, data: GroupDerivation, conditions: Membership, X: Matrix) -> Matrix:
    """The diagonal blocks that vary times det^{-1/n}, n their size together; the phase alone where a form holds |det|."""
    result = [list(row) for row in X]
    for rows, kind in conditions.determinants:
        if kind == "unit modulus" and conditions.forms:
            continue
        varying = [
            block
            for block in diagonal_blocks(data.group.exact_basis)
            if set(block) <= set(rows)
            and (any(matrix[i, i] != 0 for matrix in data.group.exact_basis for i in block) or len(block) > 1)
        ]
        share = number(ops, sp.Rational(-1, sum(map(len, varying))))
        z = Complex.of(determinant([[result[i][j] for j in rows] for i in rows]))
        factor: Any = (
            _root(ops, conditions, kind, z, share) if data.group.is_complex else ops.exp(share * ops.log(z.re))
        )
        for block in varying:
            for i in block:
                for j in block:
                    entry = result[i][j]
                    result[i][j] = entry if isinstance(entry, int) and entry == 0 else entry * factor
    return result


def _root(ops: Arithmetic, conditions: Membership, kind: str, z: Complex, share: Scalar) -> Any:
    size: Scalar = 1 if conditions.forms else ops.exp(share * ops.log(z.re * z.re + z.im * z.im) / 2)
    if kind == "unit modulus":
        return size
    angle = share * ops.atan2(z.im, z.re)
    return Complex(product(size, ops.cos(angle)), product(size, ops.sin(angle)))
