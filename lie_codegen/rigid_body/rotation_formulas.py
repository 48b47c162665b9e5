"""Formulas of the whole torque-free rotation, over any arithmetic: shortest arcs, the slow variables, the state at a phase.

Along the paper's axes l = J omega / L = (r1 cn, -r2 sn, r3 dn), with I2 the middle moment and l3 > 0:

    X = C(H/L) Rz(alpha) A(l),   alpha' = L/I3 (1 - c / (1 + r3 dn)),   c = r1^2 (I1 - I3) / I1.

A(l) is the shortest rotation that takes l to e3. As l3 > 0, nothing is singular, pure spin and symmetric bodies included, which
Euler angles 3-1-3 are not.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.elliptic import half_pi

Vector = Sequence[Scalar]
Matrix = list[list[Scalar]]


class Shape(NamedTuple):
    """What H and D (or omega) determine beside directions.

    Attributes:
        r: (r1, r2, r3).
        k, c: modulus; c above.
        rate: Lambda times 4 K: the rate of u [1/s].
    """

    r: tuple[Scalar, Scalar, Scalar]
    k: Scalar
    c: Scalar
    rate: Scalar


def shortest_arc(l: Vector) -> Matrix:  # noqa: E741
    """A(l), which takes the unit vector l to e3; l3 > -1."""
    q = 1 / (1 + l[2])
    return [
        [1 - l[0] * l[0] * q, -(l[0] * l[1]) * q, -l[0]],
        [-(l[0] * l[1]) * q, 1 - l[1] * l[1] * q, -l[1]],
        [l[0], l[1], l[2]],
    ]


def frame_of(ops: Arithmetic, h: Vector) -> Matrix:
    """C(h), whose third column is the unit vector h: A(h)^T, turned by pi about axis 1 where h3 < 0, so that h3 = -1 is regular."""
    below = ops.less(h[2], ops.constant(0))
    sign = ops.where(below, ops.constant(-1), ops.constant(1))
    A = shortest_arc([h[0], sign * h[1], sign * h[2]])
    rows = transpose(A)
    return [rows[0], [sign * entry for entry in rows[1]], [sign * entry for entry in rows[2]]]


def about_third(ops: Arithmetic, alpha: Scalar, M: Matrix) -> Matrix:
    """Rz(alpha) M."""
    c, s = ops.cos(alpha), ops.sin(alpha)
    return [
        [c * a - s * b for a, b in zip(M[0], M[1], strict=True)],
        [s * a + c * b for a, b in zip(M[0], M[1], strict=True)],
        M[2],
    ]


def multiply(A: Sequence[Vector], B: Sequence[Vector]) -> Matrix:
    """A B."""
    return [[sum(row[k] * B[k][j] for k in range(3)) for j in range(3)] for row in A]


def transpose(A: Sequence[Vector]) -> Matrix:
    """A^T."""
    return [[A[i][j] for i in range(3)] for j in range(3)]


def apply(A: Sequence[Vector], v: Vector) -> list[Scalar]:
    """A v."""
    return [row[0] * v[0] + row[1] * v[1] + row[2] * v[2] for row in A]


def cross(a: Vector, b: Vector) -> list[Scalar]:
    """a x b."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def shape_at(ops: Arithmetic, inertia: Vector, L: Scalar, first: Scalar, third: Scalar) -> Shape:
    """The shape of the motion with r1^2 = first, r3^2 = third, first + third = 1."""
    I1, I2, I3 = inertia
    second = first * (I2 * (I1 - I3)) / (I1 * (I2 - I3))
    k = ops.sqrt((I1 - I2) * I3 * first / (I1 * (I2 - I3) * third))
    r3 = ops.sqrt(third)
    sense = ops.where(ops.less(I1, I3), ops.constant(-1), ops.constant(1))
    rate = sense * ops.sqrt((I2 - I3) * (I1 - I3) / (I1 * I2)) * L * r3 / I3
    return Shape((ops.sqrt(first), ops.sqrt(second), r3), k, first * (I1 - I3) / I1, rate)


def squares_of(inertia: Vector, l: Vector) -> tuple[Scalar, Scalar]:  # noqa: E741
    """(r1^2, r3^2) of the motion through l, without cancellation."""
    I1, I2, I3 = inertia
    below = 1 / (I2 * (I1 - I3))
    return (
        l[0] * l[0] + l[1] * l[1] * (I1 * (I2 - I3)) * below,
        l[2] * l[2] + l[1] * l[1] * (I3 * (I1 - I2)) * below,
    )


def sine_series(ops: Arithmetic, coefficients: Vector, phi: Scalar) -> Scalar:
    """sum_n b_n sin(4 pi n phi), n = 1 .. N, by Clenshaw's recurrence."""
    theta = 8 * half_pi(ops) * phi
    twice = 2 * ops.cos(theta)
    ahead: Any = 0
    behind: Any = 0
    for b in reversed(coefficients):
        ahead, behind = b + twice * ahead - behind, ahead
    return ahead * ops.sin(theta)
