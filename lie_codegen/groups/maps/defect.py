"""defect(X): how far a matrix is from its group, by the conditions of `membership`, in any arithmetic.

Each condition is relative (forms to max(1, |X|^2), determinants and X A X^{-1} to |X| |X^{-1}|), so that the defect is linear in the distance
and of the size of rounding on the group. A wrong component counts 2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from typing import Any

from lie_codegen.groups.derivation import GroupDerivation
from lie_codegen.groups.maps.kept_forms import Form
from lie_codegen.groups.maps.matrices import GroupMatrices
from lie_codegen.groups.maps.membership import Membership, membership
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
    parts = [ops.fabs(part) for row in X for entry in row for part in _parts(entry, data.group.is_complex)]
    # A comparison with NaN is false, so that a maximum would lose it; a sum does not.
    finite = ops.less(total(parts), ops.constant(_FINITE))
    return ops.where(finite, largest(ops, figures), ops.constant(math.nan))


def figures_of(ops: Arithmetic, data: GroupDerivation, X: Sequence[Sequence[Any]]) -> list[Figure]:
    """Every condition of the group, as a message names it, with its relative and its plain figure."""
    group = data.group
    conditions = membership(group)
    parts = [_parts(entry, group.is_complex) for row in X for entry in row]
    size = largest(ops, [1, *(ops.fabs(part) for pair in parts for part in pair)])
    Z = _pattern(data, X)
    return [
        *_linear(ops, group, conditions, parts, size),
        *(_kept(ops, form, Z, size) for form in conditions.forms),
        *_determinants(ops, data, conditions, X, Z, size),
        *_normaliser(ops, data, conditions, X, size),
        *_components(ops, conditions, Z, size),
    ]


def largest(ops: Arithmetic, values: Sequence[Scalar]) -> Scalar:
    """The maximum of non-negative values; 0 of none."""
    result: Scalar = 0
    for value in values:
        if is_zero(result):
            result = value
        elif not is_zero(value):
            result = ops.where(ops.less(result, value), value, result)
    return result


def _parts(entry: Any, is_complex: bool) -> list[Scalar]:
    if not is_complex:
        return [entry]
    z = Complex.of(entry)
    return [z.re, z.im]


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
    ops: Arithmetic, group: MatrixGroup, conditions: Membership, parts: list[list[Scalar]], size: Scalar
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
        figures.append((name, ops.fabs(value) / size, value))
    return figures


def _kept(ops: Arithmetic, form: Form, Z: Matrix, size: Scalar) -> Figure:
    """X* S X - S, or what is left of X* S X - chi S."""
    change = _change(ops, form, Z)
    plain = largest(ops, [ops.fabs(part) for row in change for entry in row for part in _real_parts(entry)])
    return form.text, plain / (size * size), plain


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
            _real_parts(product(_conjugate(S[i][j]), moved[i][j]))[0] for i in d for j in d if not is_zero(S[i][j])
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


def _real_parts(entry: Any) -> list[Scalar]:
    return [entry.re, entry.im] if isinstance(entry, Complex) else [entry]


def _constant(ops: Arithmetic, value: Any) -> Any:
    re, im = value.as_real_imag()
    return number(ops, re) if im == 0 else Complex(number(ops, re), number(ops, im))


def _determinants(
    ops: Arithmetic, data: GroupDerivation, conditions: Membership, X: Any, Z: Matrix, size: Scalar
) -> list[Figure]:
    if not conditions.determinant:
        return []
    value = determinant(Z)
    # d det X = tr(X^{-1} dX): relative to |X| |X^{-1}|, which is 1 where all blocks are orthogonal.
    scale: Scalar = size * size if len(Z) == 2 else size if _orthogonal(data) else size * _inverse_size(ops, data, X)
    if conditions.determinant == "unit modulus":
        z = Complex.of(value)
        off = z.re * z.re + z.im * z.im - 1
        return [("|det X|^2 - 1", ops.fabs(off) / scale, off)]
    off = [add(part, -1) if k == 0 else part for k, part in enumerate(_real_parts(value))]
    plain = off[0] if len(off) == 1 else largest(ops, [ops.fabs(part) for part in off])
    return [("det X - 1", ops.fabs(plain) / scale, plain)]


def _orthogonal(data: GroupDerivation) -> bool:
    return data.is_unitary or all(orthogonal for _, orthogonal in data.real.blocks)


def _inverse_size(ops: Arithmetic, data: GroupDerivation, X: Any) -> Scalar:
    matrices = GroupMatrices(ops, data.real)
    inverse = matrices.inverse(matrices.read(X))
    return largest(ops, [1, *(ops.fabs(entry) for row in inverse for entry in row)])


def _normaliser(ops: Arithmetic, data: GroupDerivation, conditions: Membership, X: Any, size: Scalar) -> list[Figure]:
    """X A_i X^{-1} less its own part in the algebra."""
    if not conditions.normaliser:
        return []
    matrices = GroupMatrices(ops, data.real)
    element = matrices.read(X)
    inverse = matrices.inverse(element)
    kappa = size * largest(ops, [1, *(ops.fabs(entry) for row in inverse for entry in row)])
    worst: list[Scalar] = []
    for unit in range(data.group.dim):
        A = [[number(ops, entry) for entry in row] for row in data.real.basis[unit].tolist()]
        moved = matmul(element, matmul(A, inverse))
        rest = [list(row) for row in moved]
        inside = matrices.hat(matrices.vee(moved))
        worst += [ops.fabs(_minus(a, b)) for p, q in zip(rest, inside, strict=True) for a, b in zip(p, q, strict=True)]
    plain = largest(ops, worst)
    return [("the algebra under X A X^-1", plain / kappa, plain)]


def _components(ops: Arithmetic, conditions: Membership, Z: Matrix, size: Scalar) -> list[Figure]:
    """Signs that no path in the group changes."""
    figures = []
    # A determinant that other conditions hold at +-1 comes out of entries of any size: it has no sign below its rounding.
    settled = bool(conditions.forms or conditions.determinant)
    for block in conditions.blocks:
        if conditions.determinant == "one" and len(block) == len(Z):
            continue
        value = determinant([[_real_parts(Z[i][j])[0] for j in block] for i in block])
        if isinstance(value, int):
            continue
        name = "det X" if len(block) == len(Z) else f"det of rows and columns {', '.join(map(str, block))}"
        figures.append(_signed(ops, name, value, size, len(block) if settled else 0))
    for form, columns in conditions.oriented:
        V = [[float(entry) for entry in row] for row in columns]
        S = [[_constant(ops, entry) for entry in row] for row in form.matrix.tolist()]
        # X maps the positive subspace V of S to one on which S is positive: V^T S X V is never singular.
        middle = matmul(Z, S) if form.dual else matmul(S, Z)
        value = determinant(matmul([list(column) for column in zip(*V, strict=True)], matmul(middle, V)))
        figures.append(_signed(ops, "the orientation of the positive subspace of S", value, size, len(columns[0])))
    return figures


def _signed(ops: Arithmetic, name: str, value: Scalar, size: Scalar, rounding: int) -> Figure:
    """0 where the value is positive, 2 where it is not; `rounding`: the power of |X| that its rounding grows with."""
    least: Scalar = ops.constant(-_ROUNDING) if rounding else 0
    for _ in range(rounding):
        least = least * size
    return f"{name}, which is negative,", ops.where(ops.less(least, value), 0, ops.constant(WRONG_COMPONENT)), value
