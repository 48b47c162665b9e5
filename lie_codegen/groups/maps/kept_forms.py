"""Bilinear and hermitian forms that every element of a group keeps, or keeps up to a factor, found exactly from its basis.

X* S X = S on the connected group is A* S + S A = 0 for every A_i: linear equations for the entries of S. They are solved in
doubles first, whose rank says in most cases that there is no form; only what is left is solved exactly.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.exact.numbers import Number, domain_matrix, real_coordinates, to_numbers
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.on_demand import sympy as sp

#: Relative size of a singular value that counts as zero; the entries are exact numbers of moderate size.
RANK = 1e-9


@dataclass(frozen=True)
class Form:
    """X* S X = S (chi(X) S where `semi`), X* the transpose or (`conjugate`) the adjoint; `dual`: X S X* in its place."""

    matrix: sp.ImmutableMatrix
    conjugate: bool = False
    dual: bool = False
    semi: bool = False

    @property
    def text(self) -> str:
        """As a message names it."""
        star = "X^H" if self.conjugate else "X^T"
        left = f"X S {star}" if self.dual else f"{star} S X"
        if self.matrix == sp.eye(self.matrix.rows):
            left = left.replace(" S", "")
        right = "chi S" if self.semi else "1" if self.matrix == sp.eye(self.matrix.rows) else "S"
        return f"{left} - {right}"


def kept_forms(group: MatrixGroup, generators: Sequence[sp.ImmutableMatrix]) -> Iterable[Form]:
    """Invariant forms, then dual ones, then those kept up to a factor."""
    kinds = [(True, 1)] if group.is_complex else []
    kinds += [(False, 1), (False, -1)]
    for dual in (False, True):
        for conjugate, sign in kinds:
            for S in _invariant(group, generators, conjugate, sign, dual):
                yield Form(S, conjugate, dual)
    derived = _derived(group)
    if not derived or len(derived) == group.dim:
        return
    for dual in (False, True):
        for conjugate, sign in kinds:
            for S in _invariant(group, derived, conjugate, sign, dual):
                if all(_proportional(_action(A, S, conjugate, dual), S) for A in generators):
                    yield Form(S, conjugate, dual, semi=True)


def _derived(group: MatrixGroup) -> list[sp.ImmutableMatrix]:
    """A basis of the matrices of [g, g]."""
    rows = [[row.get(k, sp.S.Zero) for k in range(group.dim)] for row in group.algebra.table.values()]
    if not rows:
        return []
    reduced, pivots = domain_matrix(rows).rref()
    result = []
    for row in to_numbers(reduced)[: len(pivots)]:
        total = sp.zeros(group.degree, group.degree)
        for value, matrix in zip(row, group.exact_basis, strict=True):
            total += value * matrix
        result.append(rescaled(total.applyfunc(sp.expand)))
    return result


def _invariant(
    group: MatrixGroup, generators: Sequence[sp.ImmutableMatrix], conjugate: bool, sign: int, dual: bool
) -> list[sp.ImmutableMatrix]:
    """A basis of the S = sign S^T (hermitian where `conjugate`) with A* S + S A = 0 for all generators."""
    patterns = _patterns(group.degree, conjugate, sign, group.is_complex)
    if not patterns:
        return []
    values, bases = in_doubles(patterns), in_doubles(generators)

    def moved(A: NDArray[Any], S: NDArray[Any]) -> NDArray[Any]:
        star = A.conj().T if conjugate else A.T
        return np.asarray(A @ S + S @ star if dual else star @ S + S @ A)

    columns = [np.concatenate([as_vector(moved(A, S), True) for A in bases]) for S in values]
    if np.linalg.matrix_rank(np.array(columns).T, tol=RANK * max(1.0, float(np.max(np.abs(columns))))) == len(patterns):
        return []
    table = [[part for A in generators for part in real_coordinates(_action(A, S, conjugate, dual))] for S in patterns]
    equations = [list(row) for row in zip(*table, strict=True) if any(row)]
    found = to_numbers(domain_matrix(equations).nullspace().to_dense()) if equations else sp.eye(len(patterns)).tolist()
    result = []
    for row in found:
        total = sp.zeros(group.degree, group.degree)
        for value, S in zip(row, patterns, strict=True):
            total += value * S
        flat = [part for part in real_coordinates(total.applyfunc(sp.expand)) if part != 0]
        result.append(sp.ImmutableMatrix((total / leading(flat)).applyfunc(lambda e: sp.radsimp(sp.expand(e)))))
    return result


def _action(A: sp.MatrixBase, S: sp.MatrixBase, conjugate: bool, dual: bool) -> sp.MatrixBase:
    star = A.H if conjugate else A.T
    return (A * S + S * star if dual else star * S + S * A).applyfunc(sp.expand)


def _proportional(B: sp.MatrixBase, S: sp.MatrixBase) -> bool:
    place = next(k for k, value in enumerate(S.flat()) if value != 0)
    factor = B.flat()[place] / S.flat()[place]
    return bool((B - factor * S).applyfunc(lambda e: sp.radsimp(sp.expand(e))).is_zero_matrix)


def _patterns(d: int, conjugate: bool, sign: int, is_complex: bool) -> list[sp.ImmutableMatrix]:
    """A real basis of the hermitian, symmetric or antisymmetric matrices."""
    result = []
    for i in range(d):
        for j in range(i, d):
            for factor in (sp.S.One, sp.I) if is_complex else (sp.S.One,):
                S = sp.zeros(d, d)
                S[i, j] += factor
                S[j, i] = sp.conjugate(factor) if conjugate and i != j else sign * factor if i != j else S[i, j]
                if i == j and ((conjugate and factor != 1) or (not conjugate and sign < 0)):
                    continue
                result.append(sp.ImmutableMatrix(S))
    return result


def leading(row: Sequence[Number]) -> Number:
    """The entry of largest modulus: rows are scaled to it."""
    return max(row, key=lambda value: abs(float(value)))


def rescaled(matrix: sp.MatrixBase) -> sp.ImmutableMatrix:
    """A multiple of the matrix, with rational entries where there is one: what is asked depends on the span alone."""
    parts = [part for part in real_coordinates(matrix) if part != 0]
    scaled = (matrix / parts[0]).applyfunc(sp.radsimp) if not parts[0].is_Rational else matrix
    rational = all(part.is_Rational for part in real_coordinates(scaled))
    return sp.ImmutableMatrix(scaled if rational else matrix)


def as_vector(matrix: Any, is_complex: bool) -> Array:
    """The same in floating point."""
    flat = np.asarray(matrix, dtype=complex).ravel()
    return np.concatenate([flat.real, flat.imag]) if is_complex else flat.real


def in_doubles(matrices: Sequence[sp.MatrixBase]) -> list[NDArray[Any]]:
    """Exact matrices in doubles."""
    return [np.array(matrix.evalf(17).tolist(), dtype=complex) for matrix in matrices]
