"""What cuts a group out of all matrices, found exactly from its basis.

Every X = exp(hat x) ... satisfies
    w . (X - 1) = 0              for w that annihilate the associative algebra that the A_i generate (fixed rows, columns and entries),
    X^H S X = S, X^T S X = S     where A^H S + S A = 0 (A^T S + S A = 0) for every A_i; the dual forms X S X^H = S, X S X^T = S,
    X^T S X = chi(X) S           where A^T S + S A is a multiple of S for every A_i,
    det X = 1 (|det X| = 1)      where every A_i is traceless (has an imaginary trace),
    X A_i X^{-1} in the algebra.
The matrices that satisfy a set of these form a group; where the linearised conditions leave n dimensions, it is the group itself up to
components. So conditions are taken, the cheap ones first, until n dimensions are left. Components are told apart by signs that are constant on
a connected group: of the determinant of every real diagonal block, and of an indefinite form on its own positive subspace.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.exact.block_structure import diagonal_blocks
from lie_codegen.exact.numbers import Number, domain_matrix, real_coordinates, to_numbers
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.on_demand import sympy as sp

#: Relative size of a singular value that counts as zero; the entries are exact numbers of moderate size.
_RANK = 1e-9


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


@dataclass(frozen=True)
class Membership:
    """The conditions of a group.

    Attributes:
        linear: rows w on the entries (real parts row by row, then for a complex group the imaginary parts): w . (X - 1) = 0.
        forms: the forms kept, and those that are kept up to a factor.
        determinant: "one", "unit modulus" or "".
        normaliser: whether X A_i X^{-1} has to be looked at.
        blocks: index sets whose determinant is real and positive.
        oriented: indefinite real symmetric forms, each with a basis (columns) of its positive subspace.
    """

    linear: tuple[dict[int, Number], ...]
    forms: tuple[Form, ...]
    determinant: str
    normaliser: bool
    blocks: tuple[tuple[int, ...], ...]
    oriented: tuple[tuple[Form, tuple[tuple[float, ...], ...]], ...]


@lru_cache(maxsize=64)
def membership(group: MatrixGroup) -> Membership:
    """The conditions of a group, as few as cut it out up to its components."""
    generators = tuple(_rescaled(matrix) for matrix in group.exact_basis)
    tangent = _TangentSpace(group)
    linear = _annihilator(group, generators)
    tangent.add(_linear_rows(linear, tangent.width))
    determinant = _determinant(group)
    traces = _trace_rows(group, determinant) if determinant else np.zeros((0, tangent.width))
    # SL(n): the determinant alone, before forms that say the same in more words.
    alone = bool(determinant) and not tangent.complete and tangent.would_complete(traces)
    if alone:
        tangent.add(traces)
    forms: list[Form] = []
    for form in () if tangent.complete else _forms(group, generators):
        if tangent.add(_form_rows(form, group)):
            forms.append(form)
        if tangent.complete:
            break
    if not alone and (tangent.complete or not tangent.add(traces)):
        determinant = ""
    normaliser = not tangent.complete and tangent.add(_normaliser_rows(group))
    return Membership(linear, tuple(forms), determinant, normaliser, _signed_blocks(group, linear), _oriented(forms))


class _TangentSpace:
    """Matrices Y that satisfy the linearised conditions so far; complete when only the algebra is left."""

    def __init__(self, group: MatrixGroup) -> None:
        self.width = group.degree**2 * (2 if group.is_complex else 1)
        self.wanted = self.width - group.dim
        self.rows = np.zeros((0, self.width))

    @property
    def complete(self) -> bool:
        return len(self.rows) >= self.wanted

    def add(self, rows: Array) -> bool:
        """Take conditions in; whether they say anything new."""
        together = self._with(rows)
        new = len(together) > len(self.rows)
        self.rows = together
        return new

    def would_complete(self, rows: Array) -> bool:
        """Whether these conditions leave only the algebra."""
        return len(self._with(rows)) >= self.wanted

    def _with(self, rows: Array) -> Array:
        """An orthonormal basis of the row space: its length is the rank."""
        together = np.concatenate([self.rows, rows])
        if not together.size:
            return self.rows
        _, values, directions = np.linalg.svd(together, full_matrices=False)
        return np.asarray(directions[: int(np.sum(values > _RANK * max(values[0], 1e-300)))])


def _rescaled(matrix: sp.MatrixBase) -> sp.ImmutableMatrix:
    """A multiple of the matrix, with rational entries where there is one: what is asked depends on the span alone."""
    parts = [part for part in real_coordinates(matrix) if part != 0]
    scaled = (matrix / parts[0]).applyfunc(sp.radsimp) if not parts[0].is_Rational else matrix
    rational = all(part.is_Rational for part in real_coordinates(scaled))
    return sp.ImmutableMatrix(scaled if rational else matrix)


def _entries(matrix: sp.MatrixBase, is_complex: bool) -> list[Number]:
    """Real parts row by row, then for a complex group the imaginary parts."""
    flat = real_coordinates(matrix)
    return flat[::2] + flat[1::2] if is_complex else flat[::2]


def _vector(matrix: Any, is_complex: bool) -> Array:
    """The same in floating point."""
    flat = np.asarray(matrix, dtype=complex).ravel()
    return np.concatenate([flat.real, flat.imag]) if is_complex else flat.real


def _numeric(matrices: Sequence[sp.MatrixBase]) -> list[NDArray[Any]]:
    return [np.array(matrix.evalf(17).tolist(), dtype=complex) for matrix in matrices]


def _annihilator(group: MatrixGroup, generators: Sequence[sp.ImmutableMatrix]) -> tuple[dict[int, Number], ...]:
    """Rows that vanish on every product of generators: X - 1 lies in the real span of these products.

    Which products are independent is decided in floating point, what annihilates them exactly.
    """
    width = group.degree**2 * (2 if group.is_complex else 1)
    exact, numeric, rows = list(generators), _numeric(generators), np.zeros((0, width))
    sides = numeric[:]
    chosen: list[sp.ImmutableMatrix] = []
    queue = list(zip(exact, numeric, strict=True))
    while queue and len(chosen) < width:
        matrix, value = queue.pop(0)
        vector = _vector(value, group.is_complex)
        size = np.linalg.norm(vector)
        rest = vector - rows.T @ (rows @ vector)
        rest = rest - rows.T @ (rows @ rest)
        if size == 0 or np.linalg.norm(rest) <= _RANK * size:
            continue
        rows = np.concatenate([rows, rest[None] / np.linalg.norm(rest)])
        chosen.append(matrix)
        queue += [(matrix * g, value @ side) for g, side in zip(generators, sides, strict=True)]
    if len(chosen) == width:
        return ()
    table = [_entries(matrix.applyfunc(sp.expand), group.is_complex) for matrix in chosen]
    found = to_numbers(domain_matrix(table).nullspace().to_dense())
    return tuple({k: sp.radsimp(value / _leading(row)) for k, value in enumerate(row) if value != 0} for row in found)


def _leading(row: Sequence[Number]) -> Number:
    """The entry of largest modulus: rows are scaled to it."""
    return max(row, key=lambda value: abs(float(value)))


def blocks_suffice(group: MatrixGroup, *, scaled: bool) -> bool:
    """Whether the linear conditions, the determinant, and diagonal blocks that are orthogonal or unitary (times a scale) say it all."""
    tangent = _TangentSpace(group)
    tangent.add(_linear_rows(membership(group).linear, tangent.width))
    for block in diagonal_blocks(group.exact_basis):
        index = np.ix_(block, block)

        def even(Y: NDArray[Any], index: Any = index, size: int = len(block)) -> NDArray[Any]:
            part = Y[index] + Y[index].conj().T
            return np.asarray(part - np.trace(part).real / size * np.eye(size) if scaled else part)

        if len(block) > 1:
            tangent.add(_rows_of(group, even))
    if membership(group).determinant:
        tangent.add(_trace_rows(group, membership(group).determinant))
    return tangent.complete


def _linear_rows(linear: Iterable[dict[int, Number]], width: int) -> Array:
    rows = np.array([[float(row.get(k, 0)) for k in range(width)] for row in linear])
    return rows.reshape(-1, width)


def _forms(group: MatrixGroup, generators: Sequence[sp.ImmutableMatrix]) -> Iterable[Form]:
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
        result.append(_rescaled(total.applyfunc(sp.expand)))
    return result


def _action(A: sp.MatrixBase, S: sp.MatrixBase, conjugate: bool, dual: bool) -> sp.MatrixBase:
    star = A.H if conjugate else A.T
    return (A * S + S * star if dual else star * S + S * A).applyfunc(sp.expand)


def _proportional(B: sp.MatrixBase, S: sp.MatrixBase) -> bool:
    place = next(k for k, value in enumerate(S.flat()) if value != 0)
    factor = B.flat()[place] / S.flat()[place]
    return bool((B - factor * S).applyfunc(lambda e: sp.radsimp(sp.expand(e))).is_zero_matrix)


def _invariant(
    group: MatrixGroup, generators: Sequence[sp.ImmutableMatrix], conjugate: bool, sign: int, dual: bool
) -> list[sp.ImmutableMatrix]:
    """A basis of the S = sign S^T (hermitian where `conjugate`) with A* S + S A = 0 for all generators."""
    patterns = _patterns(group.degree, conjugate, sign, group.is_complex)
    if not patterns:
        return []
    values, bases = _numeric(patterns), _numeric(generators)

    def moved(A: NDArray[Any], S: NDArray[Any]) -> NDArray[Any]:
        star = A.conj().T if conjugate else A.T
        return np.asarray(A @ S + S @ star if dual else star @ S + S @ A)

    columns = [np.concatenate([_vector(moved(A, S), True) for A in bases]) for S in values]
    if np.linalg.matrix_rank(np.array(columns).T, tol=_RANK * max(1.0, float(np.max(np.abs(columns))))) == len(
        patterns
    ):
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
        result.append(sp.ImmutableMatrix((total / _leading(flat)).applyfunc(lambda e: sp.radsimp(sp.expand(e)))))
    return result


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


def _units(group: MatrixGroup) -> list[NDArray[Any]]:
    """A real basis of all matrices, in the order of the entries."""
    d = group.degree
    real = [np.eye(d * d)[k].reshape(d, d).astype(complex) for k in range(d * d)]
    return real + [1j * E for E in real] if group.is_complex else real


def _rows_of(group: MatrixGroup, condition: Callable[[NDArray[Any]], NDArray[Any]]) -> Array:
    """The rows of a real-linear condition on Y."""
    columns = [_vector(condition(E), True) for E in _units(group)]
    return np.array(columns).T


def _form_rows(form: Form, group: MatrixGroup) -> Array:
    S = _numeric([form.matrix])[0]
    square = float(np.sum(np.abs(S) ** 2))

    def condition(Y: NDArray[Any]) -> NDArray[Any]:
        star = Y.conj().T if form.conjugate else Y.T
        change = Y @ S + S @ star if form.dual else star @ S + S @ Y
        return np.asarray(change - np.sum(change * S.conj()) / square * S if form.semi else change)

    return _rows_of(group, condition)


def _determinant(group: MatrixGroup) -> str:
    traces = [sp.expand(matrix.trace()) for matrix in group.exact_basis]
    if not any(traces):
        return "one"
    return "unit modulus" if all(sp.re(trace) == 0 for trace in traces) else ""


def _trace_rows(group: MatrixGroup, kind: str) -> Array:
    def trace(Y: NDArray[Any]) -> NDArray[Any]:
        value = complex(np.trace(Y))
        return np.array([[value if kind == "one" else complex(value.real)]])

    return _rows_of(group, trace)


def _normaliser_rows(group: MatrixGroup) -> Array:
    def condition(Y: NDArray[Any]) -> NDArray[Any]:
        moved = [Y @ A - A @ Y for A in group.basis]
        return np.concatenate([B - group.hat(group.project(B)) for B in moved])

    return _rows_of(group, condition)


def _signed_blocks(group: MatrixGroup, linear: Sequence[dict[int, Number]]) -> tuple[tuple[int, ...], ...]:
    """Diagonal blocks whose determinant is real on all of the group, and not 1 by the linear conditions alone."""
    fixed = {next(iter(row)) for row in linear if len(row) == 1}
    d = group.degree
    result = []
    for block in diagonal_blocks(group.exact_basis):
        real = not group.is_complex or (len(block) == 1 and d * d + block[0] * (d + 1) in fixed)
        constant = len(block) == 1 and block[0] * (d + 1) in fixed
        if real and not constant:
            result.append(block)
    return tuple(result)


def _oriented(forms: Sequence[Form]) -> tuple[tuple[Form, tuple[tuple[float, ...], ...]], ...]:
    """Indefinite real symmetric forms, with the eigenvectors of their positive eigenvalues."""
    result = []
    for form in forms:
        S = _numeric([form.matrix])[0]
        if form.conjugate or np.any(S.imag) or not np.allclose(S, S.T):
            continue
        values, vectors = np.linalg.eigh(S.real)
        if values[0] < -_RANK and values[-1] > _RANK:
            result.append((form, tuple(map(tuple, vectors[:, values > _RANK].tolist()))))
    return tuple(result)
