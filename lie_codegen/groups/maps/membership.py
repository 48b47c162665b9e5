"""What cuts a group out of all matrices, found exactly from its basis.

Every X = exp(hat x) ... satisfies
    w . (X - 1) = 0              for w that annihilate the associative algebra that the A_i generate (fixed rows, columns and entries),
    X^H S X = S, X^T S X = S     where A^H S + S A = 0 (A^T S + S A = 0) for every A_i; the dual forms X S X^H = S, X S X^T = S,
    X^T S X = chi(X) S           where A^T S + S A is a multiple of S for every A_i,
    det X = 1 (|det X| = 1)      where every A_i is traceless (has an imaginary trace), and so of the diagonal blocks of X,
    X A_i X^{-1} in the algebra.
The matrices that satisfy a set of these form a group; where the linearised conditions leave n dimensions, it is the group itself up to
components. So conditions are taken, the cheap ones first, until n dimensions are left. Components are told apart by signs that are constant on
a connected group: of the determinant of every real diagonal block, and of an indefinite form on its own positive subspace.

Where they leave more, what ties the blocks together is no polynomial: a spiral e^{a t} R(t), a screw, dilations by e^t and e^{2 t}. Then
X exp(-log X) = 1 is looked at, with the logarithm read from some of the blocks.
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
from lie_codegen.groups.maps.kept_forms import RANK, Form, as_vector, in_doubles, kept_forms, leading, rescaled
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.on_demand import sympy as sp


@dataclass(frozen=True)
class Membership:
    """The conditions of a group.

    Attributes:
        linear: rows w on the entries (real parts row by row, then for a complex group the imaginary parts): w . (X - 1) = 0.
        forms: the forms kept, and those that are kept up to a factor.
        determinants: rows (and columns) whose determinant is "one" or of "unit modulus".
        normaliser: whether X A_i X^{-1} has to be looked at.
        logarithm: whether X exp(-log X) has to be looked at, too.
        blocks: index sets whose determinant is real and positive.
        oriented: indefinite real symmetric forms, each with a basis (columns) of its positive subspace.
    """

    linear: tuple[dict[int, Number], ...]
    forms: tuple[Form, ...]
    determinants: tuple[tuple[tuple[int, ...], str], ...]
    normaliser: bool
    logarithm: bool
    blocks: tuple[tuple[int, ...], ...]
    oriented: tuple[tuple[Form, tuple[tuple[float, ...], ...]], ...]


@lru_cache(maxsize=64)
def membership(group: MatrixGroup) -> Membership:
    """The conditions of a group, as few as cut it out up to its components."""
    generators = tuple(rescaled(matrix) for matrix in group.exact_basis)
    tangent = _TangentSpace(group)
    linear = _annihilator(group, generators)
    tangent.add(_linear_rows(linear, tangent.width))
    known = _determinants(group)
    rows = [(each, _trace_rows(group, *each)) for each in known]
    determinants = []
    # SL(n): the determinant alone, before forms that say the same in more words.
    if rows and not tangent.complete and tangent.would_complete(np.concatenate([row for _, row in rows])):
        determinants = [each for each, row in rows if not tangent.complete and tangent.add(row)]
    forms: list[Form] = []
    for form in () if tangent.complete else kept_forms(group, generators):
        if tangent.add(_form_rows(form, group)):
            forms.append(form)
        if tangent.complete:
            break
    determinants += [each for each, row in rows if not tangent.complete and tangent.add(row)]
    normaliser = not tangent.complete and tangent.add(_normaliser_rows(group))
    return Membership(
        linear,
        tuple(forms),
        tuple(determinants),
        normaliser,
        not tangent.complete,
        _signed_blocks(group, linear),
        _oriented(forms),
    )


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
        return np.asarray(directions[: int(np.sum(values > RANK * max(values[0], 1e-300)))])


def _entries(matrix: sp.MatrixBase, is_complex: bool) -> list[Number]:
    """Real parts row by row, then for a complex group the imaginary parts."""
    flat = real_coordinates(matrix)
    return flat[::2] + flat[1::2] if is_complex else flat[::2]


def _annihilator(group: MatrixGroup, generators: Sequence[sp.ImmutableMatrix]) -> tuple[dict[int, Number], ...]:
    """Rows that vanish on every product of generators: X - 1 lies in the real span of these products.

    Which products are independent is decided in floating point, what annihilates them exactly.
    """
    width = group.degree**2 * (2 if group.is_complex else 1)
    exact, numeric, rows = list(generators), in_doubles(generators), np.zeros((0, width))
    sides = numeric[:]
    chosen: list[sp.ImmutableMatrix] = []
    queue = list(zip(exact, numeric, strict=True))
    while queue and len(chosen) < width:
        matrix, value = queue.pop(0)
        vector = as_vector(value, group.is_complex)
        size = np.linalg.norm(vector)
        rest = vector - rows.T @ (rows @ vector)
        rest = rest - rows.T @ (rows @ rest)
        if size == 0 or np.linalg.norm(rest) <= RANK * size:
            continue
        rows = np.concatenate([rows, rest[None] / np.linalg.norm(rest)])
        chosen.append(matrix)
        queue += [(matrix * g, value @ side) for g, side in zip(generators, sides, strict=True)]
    if len(chosen) == width:
        return ()
    table = [_entries(matrix.applyfunc(sp.expand), group.is_complex) for matrix in chosen]
    found = to_numbers(domain_matrix(table).nullspace().to_dense())
    return tuple({k: sp.radsimp(value / leading(row)) for k, value in enumerate(row) if value != 0} for row in found)


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
    for block, kind in membership(group).determinants:
        tangent.add(_trace_rows(group, block, kind))
    return tangent.complete


def _linear_rows(linear: Iterable[dict[int, Number]], width: int) -> Array:
    rows = np.array([[float(row.get(k, 0)) for k in range(width)] for row in linear])
    return rows.reshape(-1, width)


def _units(group: MatrixGroup) -> list[NDArray[Any]]:
    """A real basis of all matrices, in the order of the entries."""
    d = group.degree
    real = [np.eye(d * d)[k].reshape(d, d).astype(complex) for k in range(d * d)]
    return real + [1j * E for E in real] if group.is_complex else real


def _rows_of(group: MatrixGroup, condition: Callable[[NDArray[Any]], NDArray[Any]]) -> Array:
    """The rows of a real-linear condition on Y."""
    columns = [as_vector(condition(E), True) for E in _units(group)]
    return np.array(columns).T


def _form_rows(form: Form, group: MatrixGroup) -> Array:
    S = in_doubles([form.matrix])[0]
    square = float(np.sum(np.abs(S) ** 2))

    def condition(Y: NDArray[Any]) -> NDArray[Any]:
        star = Y.conj().T if form.conjugate else Y.T
        change = Y @ S + S @ star if form.dual else star @ S + S @ Y
        return np.asarray(change - np.sum(change * S.conj()) / square * S if form.semi else change)

    return _rows_of(group, condition)


def _determinants(group: MatrixGroup) -> list[tuple[tuple[int, ...], str]]:
    """Diagonal blocks, and then all of X, whose determinant is 1 or of modulus 1."""
    result = []
    whole = tuple(range(group.degree))
    for rows in dict.fromkeys((*map(tuple, diagonal_blocks(group.exact_basis)), whole)):
        traces = [sp.expand(sum(matrix[i, i] for i in rows)) for matrix in group.exact_basis]
        if not any(traces):
            result.append((rows, "one"))
        elif all(sp.re(trace) == 0 for trace in traces):
            result.append((rows, "unit modulus"))
    return result


def _trace_rows(group: MatrixGroup, rows: tuple[int, ...], kind: str) -> Array:
    def trace(Y: NDArray[Any]) -> NDArray[Any]:
        value = complex(sum(Y[i, i] for i in rows))
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
        S = in_doubles([form.matrix])[0]
        if form.conjugate or np.any(S.imag) or not np.allclose(S, S.T):
            continue
        values, vectors = np.linalg.eigh(S.real)
        if values[0] < -RANK and values[-1] > RANK:
            result.append((form, tuple(map(tuple, vectors[:, values > RANK].tolist()))))
    return tuple(result)
