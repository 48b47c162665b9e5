"""lc.product and lc.semidirect: groups from groups."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.errors import AlgebraError, InputError, ShapeError
from lie_codegen.exact.numbers import Number
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.definition import exact_matrix
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.representation import faithful_representation
from lie_codegen.identifiers import check_identifier
from lie_codegen.on_demand import sympy as sp


def product(a: GroupLike, b: GroupLike, *, name: str | None = None) -> MatrixGroup:
    """The direct product: block diagonal matrices, the basis of a and then that of b.

    Labels stay where all are different; otherwise each gets the name of its group in front (so3_w1), and where the groups
    have one name also a number (so3_1_w1, so3_2_w1).

    Args:
        name: C identifier; "<a>_x_<b>" by default.

    Raises:
        IdentifierError: if the name cannot be a C identifier.
    """
    a, b = as_group(a, "product"), as_group(b, "product")
    name = check_identifier(name if name is not None else f"{a.name}_x_{b.name}", "name")
    shift = a.dim
    table = {key: dict(row) for key, row in a.algebra.table.items()}
    for (i, j), row in b.algebra.table.items():
        table[i + shift, j + shift] = {k + shift: value for k, value in row.items()}
    algebra = LieAlgebra(name, joint_labels(a, b), table)
    basis = tuple(_block_diagonal(m, sp.zeros(b.degree)) for m in a.exact_basis) + tuple(
        _block_diagonal(sp.zeros(a.degree), m) for m in b.exact_basis
    )
    return MatrixGroup(algebra, basis, a.units + b.units, f"direct product of {a.name} and {b.name}")


def joint_labels(a: MatrixGroup, b: MatrixGroup) -> tuple[str, ...]:
    """Labels of a product: those of the factors, made different by the factors' names if need be."""
    if not set(a.labels) & set(b.labels):
        return a.labels + b.labels
    first, second = (a.name, b.name) if a.name != b.name else (f"{a.name}_1", f"{b.name}_2")
    return tuple(f"{first}_{label}" for label in a.labels) + tuple(f"{second}_{label}" for label in b.labels)


def semidirect(
    a: GroupLike,
    b: GroupLike,
    action: Sequence[Any] | Mapping[str, Any] | None = None,
    *,
    name: str | None = None,
) -> MatrixGroup:
    """The semidirect product in which a acts on the normal subgroup b: [A_i, B_j] = sum_k action[i][k, j] B_k.

    Args:
        a: the group that acts.
        b: the group acted on; r(n) for a vector space: semidirect(group("so3"), group("r3")) has the brackets of se3.
        action: for each basis element of a (in order, or by label) a dim(b) x dim(b) matrix of exact numbers; by default
            a's own matrices, if b is abelian of that dimension and a is real.
        name: C identifier; "<a>_on_<b>" by default.

    On an abelian b with a's own matrices the result is [[A, v], [0, 0]]; otherwise a faithful representation is found
    from the brackets, beside a's own matrices. Labels as in `product`; units are those of a and b.

    Raises:
        ShapeError: a matrix of the wrong size, or not one for each basis element.
        AlgebraError: if a matrix is no derivation of b, or the matrices do not follow a's brackets.
    """
    a, b = as_group(a, "semidirect"), as_group(b, "semidirect")
    name = check_identifier(name if name is not None else f"{a.name}_on_{b.name}", "name")
    matrices = _action(a, b, action, name)
    _check_derivations(a, b, matrices, name)
    _check_homomorphism(a, matrices, name)
    algebra = _semidirect_algebra(a, b, matrices, name)
    if not b.algebra.table and not a.is_complex and all(m == A for m, A in zip(matrices, a.exact_basis, strict=True)):
        basis = _affine(matrices, b.dim)
    else:
        found = faithful_representation(algebra)
        zero = sp.zeros(a.degree)
        beside = [*a.exact_basis, *(zero for _ in range(b.dim))]
        basis = tuple(_block_diagonal(left, right) for left, right in zip(beside, found, strict=True))
    return MatrixGroup(algebra, basis, a.units + b.units, f"{a.name} acting on {b.name}")


def _action(a: MatrixGroup, b: MatrixGroup, action: Any, name: str) -> list[sp.ImmutableMatrix]:
    if action is None:
        if b.algebra.table or a.is_complex or a.degree != b.dim:
            raise InputError(
                f"{name}: without an action, a must be real and b a vector space of dimension {a.degree}, the size of "
                f"a's matrices; give one {b.dim} x {b.dim} matrix for each of {', '.join(a.labels)}"
            )
        return list(a.exact_basis)
    if isinstance(action, Mapping):
        unknown = [label for label in action if label not in a.labels]
        if unknown:
            raise InputError(f"{name}: the action names {unknown[0]!r}, which is not one of {', '.join(a.labels)}")
        action = [action.get(label, [[0] * b.dim] * b.dim) for label in a.labels]
    if len(action) != a.dim:
        raise ShapeError(f"{name}: {len(action)} matrices for the {a.dim} basis elements of {a.name}")
    matrices = [exact_matrix(f"{name}: action of {label}", m) for label, m in zip(a.labels, action, strict=True)]
    for label, matrix in zip(a.labels, matrices, strict=True):
        if matrix.rows != b.dim:
            raise ShapeError(f"{name}: the action of {label} is {matrix.rows} x {matrix.rows}, not {b.dim} x {b.dim}")
        if any(entry.is_real is not True for entry in matrix.flat()):
            raise InputError(f"{name}: the action of {label} is not real; coordinates of {b.name} are")
    return matrices


def _check_derivations(a: MatrixGroup, b: MatrixGroup, matrices: list[sp.ImmutableMatrix], name: str) -> None:
    algebra = b.algebra
    for label, D in zip(a.labels, matrices, strict=True):
        columns = [{k: D[k, j] for k in range(b.dim) if D[k, j] != 0} for j in range(b.dim)]
        for i, j in combinations(range(b.dim), 2):
            left = _image(columns, algebra.bracket({i: sp.S.One}, {j: sp.S.One}))
            right = _sum(algebra.bracket(columns[i], {j: sp.S.One}), algebra.bracket({i: sp.S.One}, columns[j]))
            if _sum(left, {k: -value for k, value in right.items()}):
                x, y = b.labels[i], b.labels[j]
                raise AlgebraError(
                    f"{name}: the action of {label} is no derivation of {b.name}: D[{x}, {y}] differs from "
                    f"[D {x}, {y}] + [{x}, D {y}]"
                )


def _check_homomorphism(a: MatrixGroup, matrices: list[sp.ImmutableMatrix], name: str) -> None:
    for i, j in combinations(range(a.dim), 2):
        wanted = sp.zeros(matrices[0].rows)
        for k, value in a.algebra.table.get((i, j), {}).items():
            wanted += value * matrices[k]
        difference = matrices[i] * matrices[j] - matrices[j] * matrices[i] - wanted
        if any(entry.equals(0) is not True for entry in difference.flat()):
            x, y = a.labels[i], a.labels[j]
            raise AlgebraError(
                f"{name}: the action does not follow the brackets of {a.name}: the commutator of the actions of {x} and "
                f"{y} is not the action of [{x}, {y}]"
            )


def _semidirect_algebra(a: MatrixGroup, b: MatrixGroup, matrices: list[sp.ImmutableMatrix], name: str) -> LieAlgebra:
    shift = a.dim
    table: dict[tuple[int, int], dict[int, Number]] = {key: dict(row) for key, row in a.algebra.table.items()}
    for i, matrix in enumerate(matrices):
        for j in range(b.dim):
            row = {k + shift: matrix[k, j] for k in range(b.dim) if matrix[k, j] != 0}
            if row:
                table[i, j + shift] = row
    for (i, j), inner in b.algebra.table.items():
        table[i + shift, j + shift] = {k + shift: value for k, value in inner.items()}
    return LieAlgebra(name, joint_labels(a, b), dict(sorted(table.items())))


def _affine(matrices: list[sp.ImmutableMatrix], n: int) -> tuple[sp.ImmutableMatrix, ...]:
    """[[A, v], [0, 0]]."""
    acting = tuple(_block_diagonal(matrix, sp.zeros(1)) for matrix in matrices)
    vectors = []
    for j in range(n):
        translation = sp.zeros(n + 1)
        translation[j, n] = 1
        vectors.append(sp.ImmutableMatrix(translation))
    return acting + tuple(vectors)


def _block_diagonal(first: sp.MatrixBase, second: sp.MatrixBase) -> sp.ImmutableMatrix:
    return sp.ImmutableMatrix(sp.diag(sp.Matrix(first), sp.Matrix(second)))


def _image(columns: list[dict[int, Number]], vector: Mapping[int, Number]) -> dict[int, Number]:
    total: dict[int, Number] = {}
    for j, value in vector.items():
        total = _sum(total, {k: value * entry for k, entry in columns[j].items()})
    return total


def _sum(x: Mapping[int, Number], y: Mapping[int, Number]) -> dict[int, Number]:
    total = dict(x)
    for k, value in y.items():
        total[k] = sp.expand(total.get(k, sp.S.Zero) + value)
    return {k: value for k, value in total.items() if value != 0}
