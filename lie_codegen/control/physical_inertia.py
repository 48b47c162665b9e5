"""Keeping an estimate of the inertia among those that rigid bodies have.

A body's inertia I comes from a covariance of its mass, S = tr(I)/2 1 - I, which is positive: I itself is positive then, and its moments satisfy the
triangle inequality. The least eigenvalue of S is concave in a, so {least >= delta} is convex: taking from a' the part that leaves it, in the
metric of Gamma, never raises |a - a^|^2 for an a within.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lie_codegen.errors import InputError
from lie_codegen.exact.positive_matrix import eigenvalues
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.linear import Matrix, Vector, constant_matrix, cross, dot, matvec, minus, number, scaled
from lie_codegen.on_demand import sympy as sp

#: The least eigenvalue that is kept, relative to that of the first guess.
_MARGIN = 0.01


def kept_physical(
    ops: Arithmetic,
    basis: Sequence[sp.ImmutableMatrix],
    Gamma: Matrix,
    a: Vector,
    drift: Vector,
    start: Sequence[sp.Expr],
) -> Vector:
    """a' with the part that leaves the physical inertias taken off.

    Raises:
        InputError: the first guess is none of them.
    """
    eye = sp.eye(3)
    covariances = [sp.ImmutableMatrix(B.trace() * eye / 2 - B) for B in basis]
    first = sum((x * S for x, S in zip(start, covariances, strict=True)), sp.zeros(3, 3))
    least = eigenvalues(first)[0]
    if not least > 0:
        raise InputError(
            "adaptive_law: the inertia of start belongs to no rigid body (its moments violate the triangle inequality); project=False "
            "takes it all the same"
        )
    S = [[dot([number(ops, C[i, j]) for C in covariances], a) for j in range(3)] for i in range(3)]
    value, v = least_eigenvector(ops, S)
    slope = [dot(v, matvec(constant_matrix(ops, C), v)) for C in covariances]
    turned = matvec(Gamma, slope)
    outward = dot(slope, drift)
    bound = float(least) * _MARGIN
    # From twice the bound on a growing part is taken off, all of it at the bound: a' stays continuous.
    part = (ops.constant(2 * bound) - value) / ops.constant(bound)
    part = ops.where(ops.less(part, 0), 0, ops.where(ops.less(1, part), 1, part))
    leaving = part * ops.where(ops.less(outward, 0), outward, 0)
    return minus(drift, scaled(leaving / (dot(slope, turned) + ops.constant(1e-300)), turned))


def least_eigenvector(ops: Arithmetic, S: Matrix) -> tuple[Scalar, Vector]:
    """The least eigenvalue of a symmetric (3, 3) matrix and its unit eigenvector, in closed form.

    lambda = q + 2 p cos(angle + 2 pi/3), q = tr S/3, p^2 = |S - q|^2/6, cos 3 angle = det((S - q)/p)/2; the eigenvector is the largest product of
    two rows of S - lambda.
    """
    q = (S[0][0] + S[1][1] + S[2][2]) / 3
    D = [[S[i][j] - (q if i == j else 0) for j in range(3)] for i in range(3)]
    flat = [x for row in D for x in row]
    square = dot(flat, flat) / 6
    # A multiple of the identity has no direction: q itself, and the first axis.
    spread = ops.less(ops.constant(1e-60), square)
    p = ops.where(spread, ops.sqrt(ops.where(spread, square, 1)), 0)
    safe = ops.where(spread, p, 1)
    half = dot(D[0], cross(D[1], D[2])) / (2 * safe * safe * safe)
    inside = ops.where(ops.less(half, -1), ops.constant(-1), ops.where(ops.less(1, half), ops.constant(1), half))
    value = q + 2 * p * ops.cos(ops.acos(inside) / 3 + ops.constant(2 * np.pi / 3))
    rows = [[S[i][j] - (value if i == j else 0) for j in range(3)] for i in range(3)]
    best: Vector = [ops.constant(1), 0, 0]
    size: Scalar = ops.constant(0)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        candidate = cross(rows[i], rows[j])
        length = dot(candidate, candidate)
        better = ops.less(size, length)
        best = [ops.where(better, new, old) for new, old in zip(candidate, best, strict=True)]
        size = ops.where(better, length, size)
    return value, scaled(1 / ops.sqrt(ops.where(ops.less(0, size), size, 1)), best)
