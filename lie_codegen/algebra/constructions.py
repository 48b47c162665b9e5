"""Lie algebras from matrices, from brackets, and in another order of the basis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.algebra.orthogonal_basis import orthogonal_table
from lie_codegen.errors import AlgebraError, DependentBasisError, InputError, NotClosedError
from lie_codegen.exact.numbers import Number, domain_matrix, exact_number, real_coordinates, to_numbers
from lie_codegen.on_demand import sympy as sp


def algebra_from_brackets(
    name: str, labels: Sequence[str], brackets: Mapping[tuple[str, str], Mapping[str, Any]]
) -> LieAlgebra:
    """The algebra with [a, b] = sum of coefficient * label for each given pair; brackets not given are zero.

    Raises:
        AlgebraError: an unknown label, [a, a] != 0, or a pair given in both orders that is not antisymmetric.
        JacobiError: if the Jacobi identity fails, naming the triple.
    """
    labels = tuple(labels)
    table: dict[tuple[int, int], dict[int, Number]] = {}
    for pair, combination in brackets.items():
        if not isinstance(pair, tuple) or len(pair) != 2:
            raise AlgebraError(f"{name}: the bracket {pair!r} must be named by a pair of labels")
        for label in (*pair, *combination):
            if label not in labels:
                raise AlgebraError(f"{name}: the bracket [{', '.join(pair)}] names {label!r}, which is not a label")
        i, j = (labels.index(label) for label in pair)
        row = {labels.index(k): exact_number(value) for k, value in combination.items()}
        row = {k: value for k, value in row.items() if value != 0}
        _check_real(name, f"the bracket [{pair[0]}, {pair[1]}]", row.values())
        if i == j:
            if row:
                raise AlgebraError(f"{name}: [{pair[0]}, {pair[0]}] must be 0 by antisymmetry; remove it")
            continue
        if i > j:
            i, j, row = j, i, {k: -value for k, value in row.items()}
        if (i, j) in table and table[i, j] != row:
            raise AlgebraError(
                f"{name}: [{labels[i]}, {labels[j]}] and [{labels[j]}, {labels[i]}] are both given and not "
                "antisymmetric; give one of them"
            )
        table[i, j] = row
    return LieAlgebra(name, labels, {key: row for key, row in sorted(table.items()) if row})


def _check_real(name: str, where: str, values: Any) -> None:
    for value in values:
        if value.is_real is not True:
            raise AlgebraError(f"{name}: {where} has the coefficient {value}; a real Lie algebra needs real ones")


def algebra_from_matrices(name: str, labels: Sequence[str], matrices: Sequence[sp.ImmutableMatrix]) -> LieAlgebra:
    """The real span of square matrices, with the structure constants of their commutators.

    Raises:
        DependentBasisError: if the matrices are linearly dependent over the reals, naming the relation.
        NotClosedError: if a commutator leaves the span, naming the pair.
    """
    labels = tuple(labels)
    if len(labels) != len(matrices):
        raise InputError(f"{name}: {len(labels)} labels for {len(matrices)} matrices")
    columns = [real_coordinates(matrix) for matrix in matrices]
    quickly = orthogonal_table(matrices, columns)
    if quickly is not None:
        return LieAlgebra(name, labels, quickly)
    pivots, inverse = _coordinate_map(name, labels, columns)
    table = {}
    for i, j in combinations(range(len(labels)), 2):
        commutator = real_coordinates(_commutator(matrices[i], matrices[j]))
        if not any(commutator):
            continue
        picked = [commutator[p] for p in pivots]
        row = {
            k: value
            for k in range(len(labels))
            if (value := sp.expand(sum((inverse[k][m] * picked[m] for m in range(len(picked))), sp.S.Zero))) != 0
        }
        for position, entry in enumerate(commutator):
            span = sum((value * columns[k][position] for k, value in row.items()), sp.S.Zero)
            if sp.expand(span - entry) != 0 and (span - entry).equals(0) is not True:
                raise NotClosedError(
                    f"{name}: not closed under the bracket: [{labels[i]}, {labels[j]}] is not a combination of "
                    f"{', '.join(labels)}; add the missing direction to the basis"
                )
        if row:
            table[i, j] = row
    return LieAlgebra(name, labels, table)


def _commutator(a: sp.ImmutableMatrix, b: sp.ImmutableMatrix) -> sp.ImmutableMatrix:
    left, right = a * b, b * a
    return (left - right).applyfunc(sp.expand)


def _coordinate_map(
    name: str, labels: tuple[str, ...], columns: Sequence[Sequence[Number]]
) -> tuple[list[int], list[list[Number]]]:
    """Positions that determine the coordinates, and the inverse of the basis restricted to them."""
    basis = domain_matrix(columns)
    _, pivots = basis.rref()
    if len(pivots) < len(labels):
        relation = to_numbers(domain_matrix(list(zip(*columns, strict=True))).nullspace().to_dense())[0]
        text = " + ".join(f"({value}) {label}" for value, label in zip(relation, labels, strict=True) if value != 0)
        raise DependentBasisError(f"{name}: the basis matrices are linearly dependent: {text} = 0; drop one of them")
    square = domain_matrix([[column[p] for column in columns] for p in pivots])
    return list(pivots), to_numbers(square.inv())


def reorder_algebra(algebra: LieAlgebra, labels: Sequence[str]) -> LieAlgebra:
    """The same algebra with its basis in another order.

    Raises:
        InputError: if `labels` is not a permutation of the algebra's labels.
    """
    order = permutation(algebra, labels)
    where = {old: new for new, old in enumerate(order)}
    table = {}
    for (i, j), row in algebra.table.items():
        a, b = where[i], where[j]
        sign = 1 if a < b else -1
        table[min(a, b), max(a, b)] = {where[k]: sign * value for k, value in row.items()}
    return LieAlgebra(algebra.name, tuple(labels), dict(sorted(table.items())))


def permutation(algebra: LieAlgebra, labels: Sequence[str]) -> list[int]:
    """Old positions in the new order.

    Raises:
        InputError: if `labels` is not a permutation of the algebra's labels.
    """
    if sorted(labels) != sorted(algebra.labels):
        raise InputError(
            f"{algebra.name}: {tuple(labels)} is not a reordering of its labels {algebra.labels}; name each once"
        )
    return [algebra.labels.index(label) for label in labels]
