"""defect(X): how far a matrix is from its group, by the conditions of `membership`, in any arithmetic.

Each condition is relative to the entries that it reads, and to no others: a rotation is one whatever its pose's position is. Forms are
relative to max(1, |X|^2), determinants and X A X^{-1} to |X| |X^{-1}|, so that the defect is linear in the distance and of the size of rounding on
the group. What is kept up to a factor is relative to |X|^2 itself: a scale of 1e-6 excuses nothing. A wrong component counts 2.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import Any

import numpy as np

from lie_codegen.groups.derivation import GroupDerivation
from lie_codegen.groups.maps.kept_forms import Form, in_doubles
from lie_codegen.groups.maps.log_routine import far_log, off_exponential
from lie_codegen.groups.maps.matrices import GroupMatrices
from lie_codegen.groups.maps.membership import Membership, membership
from lie_codegen.groups.maps.moduli import largest, moduli, modulus, parts_of, real_parts
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.linear import Matrix, matmul, number, total
from lie_codegen.kernel.structural_zeros import add, is_zero, product

#: What a wrong component counts: a determinant of -1 is off by 2.
WRONG_COMPONENT = 2
#: What a determinant of entries of size 1 may be off by, generously.
_ROUNDING = 1e-13
_FINITE = math.inf

#: (what, relative figure, figure as it stands)
Figure = tuple[str, Scalar, Scalar]


def defect(ops: Arithmetic, data: GroupDerivation, X: Sequence[Sequence[Any]]) -> Scalar:
    """The largest of the relative figures; NaN where an entry is NaN or infinite."""
    figures = [relative for _, relative, _ in figures_of(ops, data, X)]
    parts = [ops.fabs(part) for row in X for entry in row for part in parts_of(entry, data.group.is_complex)]
    # A comparison with NaN is false, so that a maximum would lose it; a sum does not.
    finite = ops.less(total(parts), ops.constant(_FINITE))
    return ops.where(finite, largest(ops, figures), ops.constant(math.nan))


def figures_of(ops: Arithmetic, data: GroupDerivation, X: Sequence[Sequence[Any]]) -> list[Figure]:
    """Every condition of the group, as a message names it, with its relative and its plain figure."""
    group = data.group
    conditions = membership(group)
    parts = [parts_of(entry, group.is_complex) for row in X for entry in row]
    sizes = _Sizes(ops, data, parts)
    Z = _pattern(data, X)
    return [
        *_linear(ops, group, conditions, parts, sizes),
        *(_kept(ops, form, Z, sizes) for form in conditions.forms),
        *_determinants(ops, data, conditions, X, Z, sizes),
        *_normaliser(ops, data, conditions, X),
        *_logarithm(ops, data, conditions, X),
        *_components(ops, conditions, Z, sizes),
    ]


class _Sizes:
    """The largest of the entries that a condition reads; of those within one diagonal block, the block's, computed once."""

    def __init__(self, ops: Arithmetic, data: GroupDerivation, parts: list[list[Scalar]]) -> None:
        self.ops = ops
        self.parts = parts
        self.d = data.group.degree
        self.block_of = data.real_block_of[: self.d]
        self.known: dict[int, Scalar] = {}

    def of(self, places: Iterable[tuple[int, int]], least: int = 1) -> Scalar:
        """max(least, |X_ij| over the places)."""
        wanted = sorted(set(places))
        blocks = {self.block_of[k] for place in wanted for k in place}
        size = self._block(blocks.pop()) if len(blocks) == 1 else self._largest(wanted)
        return largest(self.ops, [least, size]) if least else size

    def _block(self, number: int) -> Scalar:
        if number not in self.known:
            rows = [i for i in range(self.d) if self.block_of[i] == number]
            self.known[number] = self._largest([(i, j) for i in rows for j in rows])
        return self.known[number]

    def _largest(self, places: Iterable[tuple[int, int]]) -> Scalar:
        return largest(self.ops, [self.ops.fabs(part) for i, j in places for part in self.parts[i * self.d + j]])


def _pattern(data: GroupDerivation, X: Sequence[Sequence[Any]]) -> Matrix:
    """X with the entries that are 0 or 1 in every element as plain numbers: `linear` has looked at them."""
    group, varying, d = data.group, data.real.varying, data.group.degree
    if not group.is_complex:
        return [[X[i][j] if (i, j) in varying else int(i == j) for j in range(d)] for i in range(d)]

    def entry(i: int, j: int) -> Any:
        z = Complex.of(X[i][j])
        re = z.re if (i, j) in varying else int(i == j)
        if (i + d, j) not in varying:
            return re if isinstance(re, int) else Complex(re, 0)
        return Complex(re, z.im)

    return [[entry(i, j) for j in range(d)] for i in range(d)]


def _linear(
    ops: Arithmetic, group: MatrixGroup, conditions: Membership, parts: list[list[Scalar]], sizes: _Sizes
) -> list[Figure]:
    """w . (X - 1): most of them are one entry."""
    d = group.degree
    flat = [pair[0] for pair in parts] + ([pair[1] for pair in parts] if group.is_complex else [])
    figures = []
    for row in conditions.linear:
        value: Scalar = 0
        for k, weight in row.items():
            i, j = divmod(k % (d * d), d)
            moved = flat[k] - 1 if k < d * d and i == j else flat[k]
            value = add(value, product(number(ops, weight), moved))
        k = next(iter(row))
        i, j = divmod(k % (d * d), d)
        part = "" if k < d * d else "Im "
        one = int(i == j and k < d * d)
        name = (
            f"{part}X[{i}, {j}] - {one}"
            if len(row) == 1
            else f"a relation of the entries ({part}X[{i}, {j}] and others)"
        )
        # One entry is fixed: its own size says nothing. A relation of several is as good as the rounding of these.
        off = ops.fabs(value)
        figures.append((name, off if len(row) == 1 else off / sizes.of(divmod(k % (d * d), d) for k in row), value))
    return figures


def _kept(ops: Arithmetic, form: Form, Z: Matrix, sizes: _Sizes) -> Figure:
    """X* S X - S, or what is left of X* S X - chi S."""
    change = _change(ops, form, Z)
    d = range(len(Z))
    # Entries of Z that meet in the entry (i, j) of X* S X, on the left and on the right.
    met: dict[tuple[int, int], tuple[list[tuple[int, int]], list[tuple[int, int]]]] = {}
    for i in d:
        for j in range(i, len(Z)):
            pairs = [
                ((i, k), (j, m)) if form.dual else ((k, i), (m, j)) for k in d for m in d if form.matrix[k, m] != 0
            ]
            pairs = [(a, b) for a, b in pairs if not is_zero(Z[a[0]][a[1]]) and not is_zero(Z[b[0]][b[1]])]
            met[i, j] = [a for a, _ in pairs], [b for _, b in pairs]
    everything = {place for left, right in met.values() for place in (*left, *right)}
    values = {(i, i + k): modulus(ops, entry) for i, row in enumerate(change) for k, entry in enumerate(row)}
    plain = largest(ops, list(values.values()))
    if form.semi or len({sizes.block_of[k] for place in everything for k in place}) == 1:
        size = sizes.of(everything, 0 if form.semi else 1)
        return form.text, plain / (size * size), plain
    relative = [
        value / (sizes.of(met[place][0]) * sizes.of(met[place][1]))
        for place, value in values.items()
        if not is_zero(value)
    ]
    return form.text, largest(ops, relative), plain


def _change(ops: Arithmetic, form: Form, Z: Matrix) -> Matrix:
    S = [[_constant(ops, entry) for entry in row] for row in form.matrix.tolist()]
    star = [list(column) for column in zip(*Z, strict=True)]
    if form.conjugate:
        star = [[entry.conjugate() if isinstance(entry, Complex) else entry for entry in row] for row in star]
    moved = matmul(matmul(Z, S), star) if form.dual else matmul(star, matmul(S, Z))
    d = range(len(S))
    # The result is hermitian, symmetric or antisymmetric as S is: one triangle is enough.
    factor: Scalar = 1
    if form.semi:
        # chi = <S, X* S X> / <S, S>
        square = sum(abs(complex(entry)) ** 2 for entry in form.matrix.evalf(17).flat())
        overlap = total(
            real_parts(product(_conjugate(S[i][j]), moved[i][j]))[0] for i in d for j in d if not is_zero(S[i][j])
        )
        factor = overlap / square
    return [[_minus(moved[i][j], product(factor, S[i][j])) for j in d if i <= j] for i in d]


def determinant(matrix: Matrix) -> Scalar:
    """det by its minors of the last rows, each of them once: n 2^(n-1) products, no division."""
    size = len(matrix)
    minors: dict[tuple[int, ...], Scalar] = {(): 1}
    for row in reversed(matrix):
        larger: dict[tuple[int, ...], Scalar] = {}
        for columns in combinations(range(size), len(next(iter(minors))) + 1):
            terms = []
            for place, column in enumerate(columns):
                term = product(row[column], minors[columns[:place] + columns[place + 1 :]])
                terms.append(term if place % 2 == 0 else product(-1, term))
            larger[columns] = total(terms)
        minors = larger
    return minors[tuple(range(size))]


def _minus(a: Any, b: Any) -> Any:
    return add(a, product(-1, b))


def _conjugate(value: Any) -> Any:
    return value.conjugate() if isinstance(value, Complex) else value


def _constant(ops: Arithmetic, value: Any) -> Any:
    re, im = value.as_real_imag()
    return number(ops, re) if im == 0 else Complex(number(ops, re), number(ops, im))


def _determinants(
    ops: Arithmetic, data: GroupDerivation, conditions: Membership, X: Any, Z: Matrix, sizes: _Sizes
) -> list[Figure]:
    figures: list[Figure] = []
    for rows, kind in conditions.determinants:
        value = determinant([[Z[i][j] for j in rows] for i in rows])
        name = _determinant_name(rows, Z)
        scale = _determinant_scale(ops, data, rows, X, sizes)
        if kind == "unit modulus":
            z = Complex.of(value)
            off = z.re * z.re + z.im * z.im - 1
            figures.append((f"|{name}|^2 - 1", ops.fabs(off) / scale, off))
            continue
        parts = [add(part, -1) if k == 0 else part for k, part in enumerate(real_parts(value))]
        plain = parts[0] if len(parts) == 1 else largest(ops, [ops.fabs(part) for part in parts])
        figures.append((f"{name} - 1", ops.fabs(plain) / scale, plain))
    return figures


def _determinant_name(rows: Sequence[int], Z: Matrix) -> str:
    return "det X" if len(rows) == len(Z) else f"det of rows and columns {', '.join(map(str, rows))}"


def _determinant_scale(ops: Arithmetic, data: GroupDerivation, rows: Sequence[int], X: Any, sizes: _Sizes) -> Scalar:
    """|B| |B^{-1}| over the diagonal blocks B, for d det B = det B tr(B^{-1} dB); |B| where all of them are orthogonal."""
    d = data.group.degree
    inside = [(i, j) for i in rows for j in rows if sizes.block_of[i] == sizes.block_of[j]]
    size = sizes.of(inside)
    if len(rows) == 2:
        return size * size
    if _orthogonal(data, rows):
        return size
    matrices = GroupMatrices(ops, data.real)
    inverse = matrices.inverse(matrices.read(X))
    parts = range(2 if data.group.is_complex else 1)
    return size * largest(ops, [1, *(ops.fabs(inverse[i + d * part][j]) for i, j in inside for part in parts)])


def _orthogonal(data: GroupDerivation, rows: Sequence[int]) -> bool:
    d = data.group.degree
    return data.is_unitary or all(
        orthogonal for block, orthogonal in data.real.blocks if any(i % d in rows for i in block)
    )


def _normaliser(ops: Arithmetic, data: GroupDerivation, conditions: Membership, X: Any) -> list[Figure]:
    """X A_i X^{-1} less its own part in the algebra."""
    if not conditions.normaliser:
        return []
    matrices = GroupMatrices(ops, data.real)
    element = matrices.read(X)
    inverse = matrices.inverse(element)
    worst: list[Scalar] = []
    relative: list[Scalar] = []
    for unit in range(data.group.dim):
        A = [[number(ops, entry) for entry in row] for row in data.real.basis[unit].tolist()]
        moved = matmul(element, matmul(A, inverse))
        inside = matrices.hat(matrices.vee(moved))
        rest = moduli(
            ops, [[_minus(a, b) for a, b in zip(p, q, strict=True)] for p, q in zip(moved, inside, strict=True)]
        )
        # Rounding of each entry is that of the products it is summed from.
        bound = matmul(moduli(ops, element), matmul(moduli(ops, A), moduli(ops, inverse)))
        worst += [entry for row in rest for entry in row]
        relative += [
            entry / largest(ops, [1, limit])
            for row, limits in zip(rest, bound, strict=True)
            for entry, limit in zip(row, limits, strict=True)
            if not is_zero(entry)
        ]
    return [("the algebra under X A X^-1", largest(ops, relative), largest(ops, worst))]


def _logarithm(ops: Arithmetic, data: GroupDerivation, conditions: Membership, X: Any) -> list[Figure]:
    """X exp(-hat x) - 1 across the algebra, x read from the blocks; it says nothing where they have no logarithm."""
    if not conditions.logarithm:
        return []
    _, (distance, _) = off_exponential(ops, data, far_log(ops, data, X), X)
    return [("exp(-log X) X - 1", distance, distance)]


def _components(ops: Arithmetic, conditions: Membership, Z: Matrix, sizes: _Sizes) -> list[Figure]:
    """Signs that no path in the group changes."""
    figures = []
    # A determinant that other conditions hold at +-1 comes out of entries of any size: it has no sign below its rounding.
    held = {k for rows, _ in conditions.determinants for k in rows}
    held |= {k for form in conditions.forms if not form.semi for k, row in enumerate(form.matrix.tolist()) if any(row)}
    for block in conditions.blocks:
        if (block, "one") in conditions.determinants:
            continue
        value = determinant([[real_parts(Z[i][j])[0] for j in block] for i in block])
        if isinstance(value, int):
            continue
        rounding = len(block) if held.intersection(block) else 0
        size = sizes.of((i, j) for i in block for j in block)
        figures.append(_signed(ops, _determinant_name(block, Z), value, size, rounding))
    for form, columns in conditions.oriented:
        V = np.array(columns)
        S = [[_constant(ops, entry) for entry in row] for row in form.matrix.tolist()]
        # X maps the positive subspace V of S to one on which S is positive: V^T S X V is never singular.
        middle = matmul(Z, S) if form.dual else matmul(S, Z)
        value = determinant(matmul(V.T.tolist(), matmul(middle, V.tolist())))
        outer, inner = V.any(axis=1), (in_doubles([form.matrix])[0].T @ V).any(axis=1)
        rows, across = (outer, inner) if form.dual else (inner, outer)
        size = sizes.of((int(i), int(j)) for i, j in np.argwhere(np.outer(rows, across)) if not is_zero(Z[i][j]))
        figures.append(_signed(ops, "the orientation of the positive subspace of S", value, size, V.shape[1]))
    return figures


def _signed(ops: Arithmetic, name: str, value: Scalar, size: Scalar, rounding: int) -> Figure:
    """0 where the value is positive, 2 where it is not; `rounding`: the power of the size that its rounding grows with."""
    least: Scalar = ops.constant(-_ROUNDING) if rounding else 0
    for _ in range(rounding):
        least = least * size
    return f"{name}, which is negative,", ops.where(ops.less(least, value), 0, ops.constant(WRONG_COMPONENT)), value
