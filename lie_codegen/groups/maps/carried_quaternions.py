"""Matrices that know the unit quaternions of which they are made, so that their logarithm need not find them again.

A block of rotations R(q) = 1 + 2 q_0 q_v^ + 2 (q_v^)^2, or of spins q_0 - i q_v . sigma. Entries that nobody reads cost nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.linear import Vector


class QuaternionMatrix(list[list[Any]]):
    """Rows of a matrix.

    Attributes:
        quaternions: (q_0, q_1, q_2, q_3), unit, of diagonal blocks by their rows and columns.
    """

    def __init__(self, rows: Sequence[Sequence[Any]], quaternions: Mapping[tuple[int, ...], Vector]) -> None:
        super().__init__(list(row) for row in rows)
        self.quaternions = quaternions


def carried(X: Any, indices: Sequence[int]) -> Vector | None:
    """The unit quaternion of a diagonal block; None where the matrix does not know it."""
    return X.quaternions.get(tuple(indices)) if isinstance(X, QuaternionMatrix) else None


def rotation_matrix(q: Vector) -> list[list[Any]]:
    """R(q) of a unit quaternion."""
    a, b, c, d = q
    return [
        [1 - 2 * (c * c + d * d), 2 * (b * c - a * d), 2 * (b * d + a * c)],
        [2 * (b * c + a * d), 1 - 2 * (b * b + d * d), 2 * (c * d - a * b)],
        [2 * (b * d - a * c), 2 * (c * d + a * b), 1 - 2 * (b * b + c * c)],
    ]


def spin_matrix(q: Vector) -> list[list[Any]]:
    """q_0 - i q_v . sigma."""
    a, b, c, d = q
    return [[Complex(a, -d), Complex(-c, -b)], [Complex(c, -b), Complex(a, d)]]


def spin_quaternion(X: Sequence[Sequence[Any]]) -> Vector:
    """The quaternion of an element of SU(2), each of its entries the mean of two."""
    (a, b), (c, d) = ([Complex.of(entry) for entry in row] for row in X)
    return [(a.re + d.re) / 2, -(c.im + b.im) / 2, (c.re - b.re) / 2, (d.im - a.im) / 2]


def times(p: Vector, q: Vector) -> Vector:
    """Hamilton's product."""
    a, b, c, d = p
    w, x, y, z = q
    return [
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y + c * w + d * x - b * z,
        a * z + d * w + b * y - c * x,
    ]
