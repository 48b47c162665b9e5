"""The logarithm of a rotation with all its digits from 0 to 180 degrees.

theta = 2 atan2(|q_v|, q_0) q_v / |q_v| from the unit quaternion (q_0, q_v) with q_0 >= 0, the quaternion from the
largest of its four components (Shepperd), so that nothing cancels. theta/(2 sin theta) (R - R^T)^v, the textbook
formula, has no digits left at 180 degrees; Geyer's Proposition 11 prints it without the 1/2.

Of a matrix that knows its unit quaternion (`carried_quaternions`) nothing is looked for, and with q_0 >= 0

    theta = 2 f(1 - q_0) q_v,   f(u) = arccos(1 - u)/sqrt(1 - (1 - u)^2) = 1 + u/3 + 2 u^2/15 + ...,

analytic for |u| < 2: a polynomial on [0, 1], without a root, a quotient or an arc tangent. Stages of an integrator lie off |q| = 1 by what is left
away there, and the motion is the same whatever the field is off it; but a field that is far from constant along q makes the steps look worse than
they are: without the factor (3 - q.q)/2, which is 1/|q| but for the square of that distance, 10,000 loops took 1.6 times as many steps.

At exactly 180 degrees both theta and -theta are logarithms: the one is taken whose quaternion component of largest
size is positive, and |theta| = pi.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from lie_codegen.groups.maps.carried_quaternions import carried
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.linear import Vector, dot, scaled

#: |q_v|^2 below which 2 atan2(s, c)/s is summed as its series; 8 terms leave less than 1e-17.
_SMALL = 1e-2
_TERMS = 8
#: (f(u) - 1)/u to 3e-17 on [0, 1]: the polynomial of degree 20 through it at the zeros of Chebyshev's T_21, in 60 digits. Its series about 0,
#: 1/3 + 2 u/15 + ..., would need fifty terms, for the singularity at u = 2; with the points of an interval errors fall like 5.8^-k.
_SHORT_ARC = (
    0.33333333333333334665, 0.13333333333332159126, 0.057142857144574497183, 0.025396825297269285897, 0.011544014593116172264,
    0.0053279483088366182679, 0.0024871121300071885284, 0.001163854600132813183, 0.00059408544241882829632,
    0.000072113529832630871385, 0.00083300093742698706796, -0.0019569674992866074442, 0.0045212623352351001299,
    -0.0078002147398554877146, 0.010588885862776897918, -0.011041195077543494403, 0.0087218645523937089629,
    -0.0050442123635885330852, 0.0020230684103422831273, -0.00050420295628496021485, 0.000059559620437726246689,
)  # fmt: skip


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
    known = carried(R, range(3))
    if known is not None:
        return unit_log(ops, known)
    q = quaternion_of(ops, R)
    return scaled(half_angle_ratio(ops, q[0], dot(q[1:], q[1:])), q[1:])


def unit_log(ops: Arithmetic, q: Vector) -> Vector:
    """The rotation vector, |theta| <= pi, of a unit quaternion, or of one that is nearly so, over its length."""
    sign = ops.where(ops.less(q[0], 0), ops.constant(-1), ops.constant(1))
    near = (3 - ((q[0] * q[0] + q[1] * q[1]) + (q[2] * q[2] + q[3] * q[3]))) / 2
    return scaled(2 * sign * near * short_arc(ops, 1 - sign * near * q[0]), q[1:])


def short_arc(ops: Arithmetic, u: Scalar) -> Scalar:
    """arccos(c)/sqrt(1 - c^2) of c = 1 - u in [0, 1]: the angle over its sine."""
    square = u * u
    fourth = square * square
    # four interleaved sums, a quarter as deep as one: a single loop waits for each operation
    sums: list[Scalar] = []
    for first in range(4):
        powers = _SHORT_ARC[first::4]
        value: Scalar = ops.constant(powers[-1])
        for coefficient in reversed(powers[:-1]):
            value = ops.constant(coefficient) + fourth * value
        sums.append(value)
    return 1 + u * ((sums[0] + u * sums[1]) + square * (sums[2] + u * sums[3]))


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
