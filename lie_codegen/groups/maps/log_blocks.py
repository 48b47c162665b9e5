"""Logarithms of the small matrices that groups are made of, right up to their cuts and with all derivatives.

One function serves all: atan(sqrt r) / sqrt r, analytic for r > -1, by two halvings of the angle and a series that then has the
ratio 0.047 at most. No arc cosine and no division by an angle: nothing cancels near the identity.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from lie_codegen.groups.maps.carried_quaternions import spin_quaternion
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.linear import dot
from lie_codegen.on_demand import sympy as sp

#: The first term left out is below 1e-19.
TERMS = 15
#: Of rotations, whose ratio is 0.0396 at most: the first term left out is below 1e-18.
_QUATERNION_TERMS = 12
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
    length = ops.sqrt(q0 * q0 + square)
    # tan(angle/2) = |v| / d1 for angle = atan2(|v|, q0); d1^2 + |v|^2 = 2 length d1, so that each further halving of the angle is a root
    # and a sum: tan(angle/8) = |v| / d3, with one division for all.
    d1 = q0 + length
    n1 = ops.sqrt(2 * (length * d1))
    d2 = d1 + n1
    d3 = d2 + ops.sqrt(2 * (n1 * d2))
    inverse = 1 / d3
    r = square * (inverse * inverse)
    even, odd = ops.constant(0), ops.constant(0)
    fourth = r * r
    # atan(t)/t at t^2 = r <= 0.0396, in two interleaved sums: half as deep as one.
    for j in range(_QUATERNION_TERMS - 2, -1, -2):
        even = even * fourth + ops.constant(Fraction(1, 2 * j + 1))
        odd = odd * fourth + ops.constant(Fraction(-1, 2 * j + 3))
    factor = 16 * ((even + r * odd) * inverse)
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
    q = spin_quaternion(X)
    return full_quaternion_log(ops, q[0], q[1:])


def full_quaternion_log(ops: Arithmetic, q0: Scalar, q: Sequence[Scalar]) -> list[Scalar]:
    """2 v atan2(|v|, q0) / |v|, up to a full turn; (2 pi, 0, 0) at q0 < 0, v = 0."""
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
    # s = 0 and X != -size: minus a Jordan block, which has no logarithm.
    none = ops.less(ops.constant(_TINY), ops.where(sharp, ops.where(pole, h * h + b * b + c * c, 0), 0))
    factor = ops.where(none, ops.constant(math.nan), factor)
    edge = ops.where(none, ops.constant(math.nan), ops.where(sharp, ops.where(pole, ops.constant(sp.pi), 0), 0))
    return [factor * h, factor * b - edge, factor * c + edge]


def space4_log(ops: Arithmetic, X: Entries) -> list[Scalar]:
    """Entries below the diagonal of the shortest A with exp(A) = X in SO(4).

    X v = p v q with unit quaternions; the 16 signed sums <L_i R_j, X>/4 are p_i q_j, and the largest row gives both to all digits. Of (p, q) and
    (-p, -q) the pair with p_0 + q_0 >= 0 is taken: the sum of their half angles is then at most pi, which is the largest plane angle.
    """
    M = [[_quaternion_sum(X, i, j) / 4 for j in range(4)] for i in range(4)]
    row, largest = M[0], dot(M[0], M[0])
    for k in range(1, 4):
        size = dot(M[k], M[k])
        better = ops.less(largest, size)
        row = [ops.where(better, new, old) for new, old in zip(M[k], row, strict=True)]
        largest = ops.where(better, size, largest)
    length = ops.sqrt(largest)
    q = [entry / length for entry in row]
    p = [dot(each, q) for each in M]
    # p_0 + q_0 is rounding where both angles are near pi; the vector parts do not cancel.
    closer = ops.less(dot(q[1:], q[1:]), dot(p[1:], p[1:]))
    judge = ops.where(ops.less(p[0] * q[0], 0), ops.where(closer, q[0], p[0]), p[0] + q[0])
    sign = ops.where(ops.less(judge, 0), -1, 1)
    a, b = ([w / 2 for w in full_quaternion_log(ops, sign * r[0], [sign * c for c in r[1:]])] for r in (p, q))
    return [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[2] - b[2], b[1] - a[1], a[0] - b[0]]


#: e_i e_j = sign e_k of the unit quaternions, [i][j] = (sign, k).
_QUATERNIONS = (
    ((1, 0), (1, 1), (1, 2), (1, 3)),
    ((1, 1), (-1, 0), (1, 3), (-1, 2)),
    ((1, 2), (-1, 3), (-1, 0), (1, 1)),
    ((1, 3), (1, 2), (-1, 1), (-1, 0)),
)


def _quaternion_sum(X: Entries, i: int, j: int) -> Scalar:
    """sum_c <e_i e_c e_j, X e_c>."""
    total: Scalar = 0
    for c in range(4):
        first, middle = _QUATERNIONS[i][c]
        second, r = _QUATERNIONS[middle][j]
        total = total + X[r][c] if first * second > 0 else total - X[r][c]
    return total


def complex2_log(ops: Arithmetic, X: Entries) -> list[Scalar]:
    """Real and imaginary parts of (A_00, A_01, A_10), exp(A) = X in SL(2, C)."""
    (a, b), (c, d) = ([Complex.of(entry) for entry in row] for row in X)
    h, b, c = special2_log(ops, a, b, c, d)
    return [h.re, h.im, b.re, b.im, c.re, c.im]


#: |s|^2 up to which asinh(s)/s is summed, and the terms this takes.
_NEAR, _ASINH_TERMS = 0.04, 13


def special2_log(ops: Arithmetic, a: Complex, b: Complex, c: Complex, d: Complex) -> tuple[Complex, Complex, Complex]:
    """(A_00, A_01, A_10) of A = (mu/s) (X - t), t = tr X/2, s^2 = -det(X - t), mu = log(t + s); i pi sigma_3 at X = -1, NaN at -(Jordan).

    s^2 = h^2 + b c does not cancel near the identity as t^2 - 1 does; s is the root with Re(conj(t) s) >= 0.
    """
    half = ops.constant(Fraction(1, 2))
    t, h = (a + d) * half, (a - d) * half
    square = h * h + b * c
    size = square.re * square.re + square.im * square.im
    # X has the eigenvalues t + s and t - s, whose product is 1: mu = log(t + s) on one and -mu on the other, which (mu/s) (X - t) is on both.
    # Near the identity mu = asinh(s), for cosh mu = t and sinh mu = s: its series needs no root, and no digits of t.
    series = Complex(ops.constant(_asinh(_ASINH_TERMS - 1)), 0)
    for k in range(_ASINH_TERMS - 2, -1, -1):
        series = series * square + Complex(ops.constant(_asinh(k)), 0)
    near = ops.where(ops.less(size, ops.constant(_NEAR * _NEAR)), ops.where(ops.less(0, t.re), 1, 0), 0)
    is_near = ops.less(half, near)
    zero = ops.less(size, ops.constant(_TINY))
    s = complex_sqrt(ops, _chosen(ops, is_near, Complex(1, 0), _chosen(ops, zero, Complex(1, 0), square)))
    flip = ops.where(ops.less(t.re * s.re + t.im * s.im, 0), -1, 1)
    s = Complex(flip * s.re, flip * s.im)
    z = Complex(t.re + s.re, t.im + s.im)
    safe = _chosen(ops, is_near, Complex(1, 0), z)
    mu = Complex(ops.log(safe.re * safe.re + safe.im * safe.im) / 2, ops.atan2(safe.im, safe.re))
    far = mu / s
    factor = _chosen(ops, is_near, series, far)
    other = h.re * h.re + h.im * h.im + b.re * b.re + b.im * b.im + c.re * c.re + c.im * c.im
    none = ops.less(ops.constant(_TINY), ops.where(is_near, 0, ops.where(zero, other, 0)))
    nan = ops.constant(math.nan)
    factor = _chosen(ops, none, Complex(nan, nan), factor)
    edge = ops.where(is_near, 0, ops.where(zero, ops.constant(sp.pi), 0))
    first = factor * h
    return Complex(first.re, first.im + edge), factor * b, factor * c


def _asinh(k: int) -> Fraction:
    """The coefficient of s^(2 k) in asinh(s)/s."""
    return Fraction((-1) ** k * math.factorial(2 * k), 4**k * math.factorial(k) ** 2 * (2 * k + 1))


def _chosen(ops: Arithmetic, condition: Any, then: Complex, otherwise: Complex) -> Complex:
    return Complex(ops.where(condition, then.re, otherwise.re), ops.where(condition, then.im, otherwise.im))


def complex_sqrt(ops: Arithmetic, z: Complex) -> Complex:
    """The root with non-negative real part of z != 0, without cancellation."""
    size = ops.sqrt(z.re * z.re + z.im * z.im)
    large = ops.sqrt((size + ops.fabs(z.re)) / 2)
    small = z.im / (2 * large)
    back = ops.less(z.re, 0)
    down = ops.where(ops.less(z.im, 0), -1, 1)
    return Complex(ops.where(back, down * small, large), ops.where(back, down * large, small))


def lorentz_log(ops: Arithmetic, X: Entries) -> list[Scalar]:
    """Entries below the diagonal of A with exp(A) = X in SO+(3, 1), time last, through SL(2, C).

    sum_ab X_ab sigma_a C sigma_b is a multiple of M, X V = M V M^H, for any C; of C = 1, sigma_1..3 the one of largest determinant.
    """
    best, largest = _spinor(X, 0), None
    for k in range(4):
        entries = _spinor(X, k)
        value = entries[0] * entries[3] - entries[1] * entries[2]
        size = value.re * value.re + value.im * value.im
        if largest is None:
            largest, determinant = size, value
            continue
        better = ops.less(largest, size)
        best = [_chosen(ops, better, new, old) for new, old in zip(entries, best, strict=True)]
        largest, determinant = ops.where(better, size, largest), _chosen(ops, better, value, determinant)
    root = complex_sqrt(ops, determinant)
    a, b, c, d = (entry / root for entry in best)
    sign = ops.where(ops.less(a.re + d.re, 0), -1, 1)
    a, b, c, d = (Complex(sign * entry.re, sign * entry.im) for entry in (a, b, c, d))
    h, b, c = special2_log(ops, a, b, c, d)
    turn = [-(b.im + c.im), c.re - b.re, -2 * h.im]
    boost = [b.re + c.re, c.im - b.im, 2 * h.re]
    return [turn[2], -turn[1], boost[0], turn[0], boost[1], boost[2]]


_PAULI = (
    ((1, 0), (0, 1)),
    ((0, 1), (1, 0)),
    ((0, -1j), (1j, 0)),
    ((1, 0), (0, -1)),
)


def _spinor(X: Entries, k: int) -> list[Complex]:
    """The entries of sum_ab X_ab sigma_a sigma_k sigma_b, a and b = 0 for time, which stands last in X."""
    parts: list[list[Scalar]] = [[0, 0] for _ in range(4)]
    for a in range(4):
        for b in range(4):
            value = X[(a - 1) % 4][(b - 1) % 4]
            for place, weight in enumerate(_pauli_product(a, k, b)):
                for side, part in enumerate((weight.real, weight.imag)):
                    if part:
                        old = parts[place][side]
                        parts[place][side] = old + value if part > 0 else old - value
    return [Complex(re, im) for re, im in parts]


def _pauli_product(*indices: int) -> list[complex]:
    product: list[list[complex]] = [[1, 0], [0, 1]]
    for index in indices:
        sigma = _PAULI[index]
        product = [[complex(sum(row[m] * sigma[m][j] for m in range(2))) for j in range(2)] for row in product]
    return [entry for row in product for entry in row]


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
