"""Logarithms of the small matrices that groups are made of, right up to their cuts and with all derivatives.

One function serves all: atan(sqrt r) / sqrt r, analytic for r > -1, by two halvings of the angle and a series that then has the
ratio 0.047 at most. No arc cosine and no division by an angle: nothing cancels near the identity.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import sympy as sp

from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.linear import dot

#: The first term left out is below 1e-19.
TERMS = 15
#: Squares below this are taken as zero: the smallest with a normal square root and reciprocal.
_TINY = Fraction(1, 10**290)

Entries = list[list[Any]]


def atan_ratio(ops: Arithmetic, r: Scalar) -> Scalar:
    """atan(sqrt r) / sqrt r for -1/2 <= r <= 1; atanh(sqrt -r) / sqrt -r for r < 0."""
    first = 1 + ops.sqrt(1 + r)
    once = r / (first * first)
    second = 1 + ops.sqrt(1 + once)
    twice = once / (second * second)
    series: Scalar = ops.constant(Fraction((-1) ** (TERMS - 1), 2 * TERMS - 1))
    for j in range(TERMS - 2, -1, -1):
        series = series * twice + ops.constant(Fraction((-1) ** j, 2 * j + 1))
    return 4 * series / (first * second)


def quaternion_log(ops: Arithmetic, q0: Scalar, v: Sequence[Scalar]) -> list[Scalar]:
    """The rotation vector, |w| <= pi, of a quaternion q0 + v of any length with q0 >= 0: w = 2 v atan2(|v|, q0) / |v|."""
    square = dot(v, v)
    shifted = q0 + ops.sqrt(q0 * q0 + square)
    factor = 4 * atan_ratio(ops, square / (shifted * shifted)) / shifted
    return [factor * c for c in v]


def space_log(ops: Arithmetic, R: Entries, size: Scalar = 1) -> list[Scalar]:
    """The rotation vector of `size` times a rotation.

    The quaternion is the row of 4 q q^T with the largest diagonal entry, so that nothing cancels at any angle. At 180 degrees both
    signs are logarithms: the component of largest modulus (the first of equals) is made positive.
    (Shepperd's choice.)
    """
    a, b, c = R[2][1] - R[1][2], R[0][2] - R[2][0], R[1][0] - R[0][1]
    d, e, f = R[0][1] + R[1][0], R[0][2] + R[2][0], R[1][2] + R[2][1]
    x, y, z = R[0][0], R[1][1], R[2][2]
    rows = [
        [size + x + y + z, a, b, c],
        [a, size + x - y - z, d, e],
        [b, d, size - x + y - z, f],
        [c, e, f, size - x - y + z],
    ]
    best, largest = rows[0], rows[0][0]
    for k in range(1, 4):
        better = ops.less(largest, rows[k][k])
        best = [ops.where(better, new, old) for new, old in zip(rows[k], best, strict=True)]
        if k < 3:
            largest = ops.where(better, rows[k][k], largest)
    sign = ops.where(ops.less(best[0], 0), -1, 1)
    q = [sign * component for component in best]
    return quaternion_log(ops, q[0], q[1:])


def spin_log(ops: Arithmetic, X: Entries) -> list[Scalar]:
    """v with exp(-i v . sigma / 2) = X in SU(2), |v| < 2 pi; at X = -I it is (2 pi, 0, 0).

    Beyond a half turn v = log(-X) + 2 pi v / |v|.
    """
    (a, b), (c, d) = ([Complex.of(entry) for entry in row] for row in X)
    q0 = (a.re + d.re) / 2
    q = [-(c.im + b.im) / 2, (c.re - b.re) / 2, (d.im - a.im) / 2]
    beyond = ops.less(q0, 0)
    sign = ops.where(beyond, -1, 1)
    near = quaternion_log(ops, sign * q0, [sign * component for component in q])
    square = dot(q, q)
    pole = ops.less(square, ops.constant(_TINY))
    two_pi = ops.constant(2 * sp.pi)
    length = ops.sqrt(ops.where(beyond, ops.where(pole, 1, square), 1))
    axis = [ops.where(pole, 1 if k == 0 else 0, component / length) for k, component in enumerate(q)]
    return [w + ops.where(beyond, two_pi * n, 0) for w, n in zip(near, axis, strict=True)]


def real2_log(ops: Arithmetic, X: Entries, size: Scalar = 1) -> list[Scalar]:
    """(A_00, A_01, A_10) of the traceless A with exp(A) = X / size, det X = size^2, for a trace above -2 size.

    With t = tr X / 2 and s = det X - t^2 = sin^2 or -sinh^2 of the angle, A = (X - t) angle / sqrt(s): elliptic,
    parabolic and hyperbolic alike. At X = -size I, on the edge, A = pi [[0, -1], [1, 0]]; below it no logarithm exists
    and the result is NaN.
    """
    (a, b), (c, d) = X
    t, h = (a + d) / 2, (a - d) / 2
    s = -(h * h + b * c)
    sharp, wide = ops.less(t, 0), ops.less(3 * size, t)
    plain_t = ops.where(sharp, size, ops.where(wide, size, t))
    plain_s = ops.where(sharp, 0, ops.where(wide, 0, s))
    shifted = size + plain_t
    middle = 2 * atan_ratio(ops, plain_s / (shifted * shifted)) / shifted
    pole = ops.less(ops.fabs(s), ops.constant(_TINY))
    sine = ops.sqrt(ops.where(sharp, ops.where(pole, 1, s), 1))
    turned = ops.atan2(sine, ops.where(sharp, t, 1)) / sine
    sinh = ops.sqrt(ops.where(wide, -s, 1))
    stretched = ops.log((ops.where(wide, t, 1) + sinh) / size) / sinh
    factor = ops.where(sharp, turned, ops.where(wide, stretched, middle))
    edge = ops.where(sharp, ops.where(pole, ops.constant(sp.pi), 0), 0)
    return [factor * h, factor * b - edge, factor * c + edge]


def plane_log(ops: Arithmetic, X: Entries) -> tuple[Scalar, Scalar]:
    """(angle, size^2) of [[c, -s], [s, c]]; the angle in (-pi, pi]."""
    cosine, sine = (X[0][0] + X[1][1]) / 2, (X[1][0] - X[0][1]) / 2
    return ops.atan2(sine, cosine), cosine * cosine + sine * sine


def determinant_3(R: Entries) -> Scalar:
    """det of a 3 x 3 matrix."""
    return (
        R[0][0] * (R[1][1] * R[2][2] - R[1][2] * R[2][1])
        - R[0][1] * (R[1][0] * R[2][2] - R[1][2] * R[2][0])
        + R[0][2] * (R[1][0] * R[2][1] - R[1][1] * R[2][0])
    )
