"""Group elements as unit quaternions with the other entries beside them, where a group is made of rotations, spins and free entries.

    q' = q (0, w)/2,   X_ij' = (X hat(xi))_ij   for X' = X hat(xi),

w the rotation vector that hat(xi) has in the block of q. A step of any method for vectors may be taken in these few numbers: no Theta, no
dexp^-1, no exponential; and X, whose entries are polynomials in them, knows the quaternions, which is where the logarithm of a law begins. The
flow keeps |q| = 1; what a step leaves away of it is taken back by q/|q|, after which X is an element of the group to rounding.

Which groups: every diagonal block is a rotation of space (3 x 3 real, skew-symmetric in the algebra), a spin (2 x 2, in su(2)) or a number, and
the dimension of the group is the number of unit quaternions times three and that of the doubles beside them. The matrices of that shape are
a connected manifold of that dimension, in which the group is open and closed, so there is no other condition that a step could violate.
SO(3), SU(2), SE(3), SE_2(3), SO(3) x SO(3) in any basis of their algebras; not the same rotation twice (SE(3) by 6 x 6 matrices).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from lie_codegen.groups.maps.carried_quaternions import (
    QuaternionMatrix,
    rotation_matrix,
    spin_matrix,
    spin_quaternion,
    times,
)
from lie_codegen.groups.maps.element_pattern import varying_entries
from lie_codegen.groups.maps.rkmk import hat_body
from lie_codegen.groups.maps.rotation_log import quaternion_of
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.linear import Vector, matmul, scaled


@dataclass(frozen=True)
class ShortState:
    """How an element of one group is kept.

    Attributes:
        group: the group.
        blocks: rows and columns of the blocks with a quaternion: three of a rotation, two of a spin.
        beside: the other entries that vary.
    """

    group: MatrixGroup
    blocks: tuple[tuple[int, ...], ...]
    beside: tuple[tuple[int, int], ...]

    @property
    def others(self) -> int:
        """Doubles beside the quaternions."""
        return len(self.beside) * (2 if self.group.is_complex else 1)

    def element(self, quaternions: Sequence[Vector], others: Vector) -> QuaternionMatrix:
        """X."""
        d = self.group.degree
        rows: list[list[Any]] = [[int(i == j) for j in range(d)] for i in range(d)]
        for block, q in zip(self.blocks, quaternions, strict=True):
            part = rotation_matrix(q) if len(block) == 3 else spin_matrix(q)
            for i, row in zip(block, part, strict=True):
                for j, entry in zip(block, row, strict=True):
                    rows[i][j] = entry
        for k, (i, j) in enumerate(self.beside):
            rows[i][j] = Complex(others[2 * k], others[2 * k + 1]) if self.group.is_complex else others[k]
        return QuaternionMatrix(rows, dict(zip(self.blocks, quaternions, strict=True)))

    def lifted(self, ops: Arithmetic, X: Sequence[Sequence[Any]]) -> tuple[list[Vector], Vector]:
        """Quaternions and the other entries of X. Of q and -q the one with q_0 >= 0 for rotations, so that they begin on the principal branch."""
        quaternions = []
        for block in self.blocks:
            part = [[X[i][j] for j in block] for i in block]
            quaternions.append(quaternion_of(ops, part) if len(block) == 3 else spin_quaternion(part))
        return quaternions, self._flat(X)

    def rates(
        self, ops: Arithmetic, quaternions: Sequence[Vector], X: Sequence[Sequence[Any]], xi: Vector
    ) -> tuple[list[Vector], Vector]:
        """Of both, where X' = X hat(xi)."""
        A = hat_body(self.group, ops, xi)
        found = []
        for block, q in zip(self.blocks, quaternions, strict=True):
            part = [[A[i][j] for j in block] for i in block]
            # of a spin -i w . sigma/2 the entries are half of w: those of the quaternion (0, w/2)
            w = [part[2][1], part[0][2], part[1][0]] if len(block) == 3 else scaled(2, spin_quaternion(part)[1:])
            found.append([x / 2 for x in times(q, [0, *w])])
        return found, self._flat(matmul(X, A)) if self.beside else []

    def _flat(self, X: Sequence[Sequence[Any]]) -> Vector:
        entries = [X[i][j] for i, j in self.beside]
        if not self.group.is_complex:
            return entries
        return [part for entry in entries for part in (Complex.of(entry).re, Complex.of(entry).im)]


@lru_cache(maxsize=256)
def short_state(group: MatrixGroup) -> ShortState | None:
    """That of a group; None where it has none."""
    basis, varying = np.asarray(group.basis), varying_entries(group)
    blocks, numbers = [], set(varying)
    for block in _diagonal_blocks(varying, group.degree):
        if len(block) == 1:
            continue
        parts = basis[np.ix_(range(group.dim), block, block)]
        if not _turns(parts):
            return None
        blocks.append(block)
        numbers -= {(i, j) for i in block for j in block}
    found = ShortState(group, tuple(blocks), tuple(sorted(numbers)))
    return found if blocks and group.dim == 3 * len(blocks) + found.others else None


def _turns(parts: np.ndarray[Any, Any]) -> bool:
    """Whether the matrices are of so(3) or of su(2)."""
    if np.any(parts + np.conj(np.swapaxes(parts, 1, 2)) != 0):
        return False
    size = parts.shape[1]
    if size == 3:
        return not np.any(np.imag(parts))
    return size == 2 and not np.any(np.trace(parts, axis1=1, axis2=2)) and bool(np.any(np.imag(parts)))


def _diagonal_blocks(varying: Sequence[tuple[int, int]], degree: int) -> list[tuple[int, ...]]:
    """Rows that depend on each other: of (i, j) and (j, i) both entries vary. The pattern is closed under products, so one look is enough."""
    pattern, found = set(varying), list[tuple[int, ...]]()
    for i in range(degree):
        if not any(i in block for block in found):
            found.append((i, *(j for j in range(i + 1, degree) if (i, j) in pattern and (j, i) in pattern)))
    return found


@dataclass(frozen=True)
class ShortStates:
    """Several elements in one vector: the quaternions of all, then the other entries of all, then what else there is.

    Attributes:
        parts: of the elements.
    """

    parts: tuple[ShortState, ...]

    @property
    def quaternions(self) -> int:
        """How many stand in front."""
        return sum(len(part.blocks) for part in self.parts)

    @property
    def size(self) -> int:
        """Doubles of all elements."""
        return 4 * self.quaternions + sum(part.others for part in self.parts)

    def elements(self, y: Vector) -> list[QuaternionMatrix]:
        """All elements."""
        return [part.element(*each) for part, each in zip(self.parts, self._split(y), strict=True)]

    def lifted(self, ops: Arithmetic, elements: Sequence[Any]) -> Vector:
        """The vector of elements."""
        return _joined([part.lifted(ops, X) for part, X in zip(self.parts, elements, strict=True)])

    def rates(self, ops: Arithmetic, y: Vector, elements: Sequence[Any], velocities: Sequence[Vector]) -> Vector:
        """y' of the elements."""
        found = []
        for part, (quaternions, _), X, xi in zip(self.parts, self._split(y), elements, velocities, strict=True):
            found.append(part.rates(ops, quaternions, X, xi))
        return _joined(found)

    def _split(self, y: Vector) -> list[tuple[list[Vector], Vector]]:
        found, front, behind = [], 0, 4 * self.quaternions
        for part in self.parts:
            count = len(part.blocks)
            mine = [list(y[front + 4 * k : front + 4 * k + 4]) for k in range(count)]
            found.append((mine, list(y[behind : behind + part.others])))
            front, behind = front + 4 * count, behind + part.others
        return found


def short_states(groups: Sequence[MatrixGroup]) -> ShortStates | None:
    """Those of elements of these groups; None where one of them has none, or there are none."""
    parts = [short_state(group) for group in groups]
    kept = tuple(part for part in parts if part is not None)
    return ShortStates(kept) if kept and len(kept) == len(parts) else None


def _joined(found: Sequence[tuple[list[Vector], Vector]]) -> Vector:
    return [x for quaternions, _ in found for q in quaternions for x in q] + [x for _, others in found for x in others]
