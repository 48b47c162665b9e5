"""A group as magnus.c needs it: basis, brackets, and its short state where it has one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.flow.product_rate import rotation_rate
from lie_codegen.groups.matrix_group import MatrixGroup

#: Up to this dimension brackets come from structure constants, unrolled; above, as products of matrices (measured on su4, su8).
MOST_UNROLLED = 15

Term = tuple[str, int]
Bracket = tuple[str, int, int]
#: Whether the entry is the second of a pair i < j, the pair, and the other of the two.
PairTerm = tuple[int, int, int, int]
Product = tuple[str, tuple[int, ...]]


@dataclass(frozen=True)
class GroupView:
    """What magnus_group.h.jinja sees; see magnus.c for the words."""

    name: str
    dim: int
    size: int
    parts: int
    rows: int
    skew: int
    coordinates: int
    quaternion: int
    half: str
    hat: tuple[tuple[Term, ...], ...]
    pairs: tuple[tuple[int, int], ...]
    brackets: tuple[tuple[Bracket, ...], ...]
    matrix: tuple[tuple[Product, ...], ...]
    back: tuple[tuple[Term, ...], ...] = ()
    pairs_back: tuple[tuple[Term, ...], ...] = ()
    entries_back: tuple[tuple[PairTerm, ...], ...] = ()


def group_view(group: MatrixGroup) -> GroupView:
    """The view of a group."""
    basis, c = np.asarray(group.basis), group.algebra.structure_constants
    parts = (basis.real, basis.imag) if group.is_complex else (basis.real,)
    n, d = group.dim, group.degree
    skew = bool(np.all(basis == -np.conj(np.swapaxes(basis, 1, 2))))
    # The bracket of skew-Hermitian matrices reads (x y)^H, so it needs all rows.
    rows = d if skew else 1 + max(i for i in range(d) if np.any(basis[:, i, :] != 0))
    hat = tuple(_terms(part[:, i, j]) for part in parts for i in range(rows) for j in range(d))
    unrolled = n <= MOST_UNROLLED
    pairs = tuple((i, j) for i in range(n) for j in range(i + 1, n) if np.any(c[i, j] != 0)) if unrolled else ()
    brackets = tuple(tuple((repr(float(c[i, j, k])), i, j) for i, j in pairs if c[i, j, k]) for k in range(n))
    half, matrix = _quaternion(group, parts=len(parts))
    return GroupView(
        group.name, n, d, len(parts), rows, int(skew), int(unrolled), int(bool(matrix)), repr(half), hat, pairs,
        brackets if unrolled else (), matrix,
    )  # fmt: skip


def reverse_view(group: MatrixGroup) -> GroupView:
    """The view for magnus_pullback.c: brackets backwards where they come from structure constants, else whole matrices."""
    basis, c, d = np.asarray(group.basis), group.algebra.structure_constants, group.degree
    parts = (basis.real, basis.imag) if group.is_complex else (basis.real,)
    flat = np.concatenate([part.reshape(group.dim, d * d) for part in parts], axis=1)
    hat, back = (tuple(_terms(column) for column in table) for table in (flat.T, flat))
    view = group_view(group)
    if not view.coordinates:
        return replace(view, rows=d, hat=hat, back=back)
    pairs_back = tuple(_terms(c[i, j]) for i, j in view.pairs)
    entries_back = tuple(
        tuple((int(k == j), i, j, i if k == j else j) for i, j in view.pairs if k in (i, j)) for k in range(group.dim)
    )
    return replace(view, back=back, pairs_back=pairs_back, entries_back=entries_back)


def _terms(column: Array) -> tuple[Term, ...]:
    return tuple((repr(float(value)), i) for i, value in enumerate(column) if value)


def _quaternion(group: MatrixGroup, parts: int) -> tuple[float, tuple[tuple[Product, ...], ...]]:
    """s/2 and X as polynomials of a unit quaternion, where [A_1, A_2] = s A_3 and so on round, and X is of spin 1/2 or 1.

    exp(sum x_i A_i) has the quaternion (cos(s|x|/2), sin(s|x|/2) x/|x|). With Q = (2/s) sum q_i A_i:
    X = q_0 + Q where A_i A_j + A_j A_i = -(s^2/2) delta_ij, and X = 1 + q_0 Q + Q^2/2 where hat(x)^3 = -s^2 |x|^2 hat(x).
    """
    s = rotation_rate(group)
    if s is None:
        return 0.0, ()
    A, one = np.asarray(group.basis), np.eye(group.degree)
    pairs = np.einsum("aij,bjk->abik", A, A)
    symmetric = pairs + np.swapaxes(pairs, 0, 1)
    half = -(s * s / 2) * np.eye(3)[:, :, None, None] * one
    table: dict[tuple[int, ...], NDArray[Any]]
    Q: dict[tuple[int, ...], NDArray[Any]] = {(k + 1,): (2 / s) * A[k] for k in range(3)}
    if np.max(np.abs(symmetric - half)) <= 1e-14 * np.max(np.abs(pairs)):
        table = {(0,): one, **Q}
    elif _is_spin_one(A, symmetric, s):
        squares: dict[tuple[int, ...], NDArray[Any]] = {
            (k + 1, m + 1): (1 if k == m else 2) * symmetric[k, m] / s**2 for k in range(3) for m in range(k, 3)
        }
        table = {(): one, **{(0, *key): value for key, value in Q.items()}, **squares}
    else:
        return 0.0, ()
    real = [value.real for value in table.values()]
    both = [real, [value.imag for value in table.values()]][:parts]
    entries = [
        tuple((repr(float(value[i, j])), key) for key, value in zip(table, part, strict=True) if value[i, j])
        for part in both
        for i in range(group.degree)
        for j in range(group.degree)
    ]
    return s / 2, tuple(entries)


def _is_spin_one(A: NDArray[np.complex128], symmetric: NDArray[np.complex128], s: float) -> bool:
    """hat(x)^3 = -s^2 |x|^2 hat(x) for all x: the symmetric part of A_i A_j A_k is -s^2 (delta_ij A_k + ...)/3."""
    for i in range(3):
        for j in range(3):
            for k in range(3):
                cube = (symmetric[i, j] @ A[k] + symmetric[j, k] @ A[i] + symmetric[k, i] @ A[j]) / 6
                wanted = -(s * s / 3) * ((i == j) * A[k] + (j == k) * A[i] + (k == i) * A[j])
                if np.max(np.abs(cube - wanted)) > 1e-13 * s * s * np.max(np.abs(A)):
                    return False
    return True
