"""The logarithm of a rotation with all its digits from 0 to 180 degrees.

theta = 2 atan2(|q_v|, q_0) q_v / |q_v| from the unit quaternion (q_0, q_v) with q_0 >= 0, the quaternion from the
largest of its four components (Shepperd), so that nothing cancels. theta/(2 sin theta) (R - R^T)^v, the textbook
formula, has no digits left at 180 degrees; Geyer's Proposition 11 prints it without the 1/2.

At exactly 180 degrees both theta and -theta are logarithms: the one is taken whose quaternion component of largest
size is positive, and |theta| = pi.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.linear import Vector, dot, scaled

#: |q_v|^2 below which 2 atan2(s, c)/s is summed as its series; 8 terms leave less than 1e-17.
_SMALL = 1e-2
_TERMS = 8


def quaternion_of(ops: Arithmetic, R: Sequence[Sequence[Scalar]]) -> Vector:
    """(q_0, q_1, q_2, q_3), scalar first, q_0 >= 0, of a rotation matrix."""
    trace = R[0][0] + R[1][1] + R[2][2]
    size = [1 + trace] + [1 - trace + 2 * R[i][i] for i in range(3)]
    odd = [R[2][1] - R[1][2], R[0][2] - R[2][0], R[1][0] - R[0][1]]
    even = [R[0][1] + R[1][0], R[0][2] + R[2][0], R[1][2] + R[2][1]]
    candidates = [
        [size[0], odd[0], odd[1], odd[2]],
        [odd[0], size[1], even[0], even[1]],
        [odd[1], even[0], size[2], even[2]],
        [odd[2], even[1], even[2], size[3]],
    ]
    largest, chosen = size[0], candidates[0]
    for square, candidate in zip(size[1:], candidates[1:], strict=True):
        better = ops.less(largest, square)
        chosen = [ops.where(better, new, old) for new, old in zip(candidate, chosen, strict=True)]
        largest = ops.where(better, square, largest)
    factor = 1 / (2 * ops.sqrt(largest))
    sign = ops.where(ops.less(chosen[0], 0), -factor, factor)
    return scaled(sign, chosen)


def rotation_log(ops: Arithmetic, R: Sequence[Sequence[Scalar]]) -> Vector:
    """theta with exp(hat(theta)) = R and |theta| <= pi."""
    q = quaternion_of(ops, R)
    return scaled(half_angle_ratio(ops, q[0], dot(q[1:], q[1:])), q[1:])


def half_angle_ratio(ops: Arithmetic, c: Scalar, s_squared: Scalar) -> Scalar:
    """2 atan2(s, c)/s for c >= 0, from s^2; smooth at s = 0."""
    near = ops.less(s_squared, _SMALL)
    safe = ops.sqrt(ops.where(near, 1, s_squared))
    far_value = 2 * ops.atan2(safe, c) / safe
    safe_c = ops.where(near, c, 1)
    ratio = ops.where(near, s_squared, 0) / (safe_c * safe_c)
    return ops.where(near, 2 / safe_c * (1 + _atan_tail(ops, ratio)), far_value)


def _atan_tail(ops: Arithmetic, t: Scalar) -> Scalar:
    """atan(x)/x - 1 at x^2 = t: -t/3 + t^2/5 - ..., the signs in the constants."""
    value: Scalar = 0
    for k in range(_TERMS, 0, -1):
        value = t * (value + ops.constant(Fraction((-1) ** k, 2 * k + 1)))
    return value
