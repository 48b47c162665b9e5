"""A group in another basis of its algebra."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lie_codegen.errors import InputError
from lie_codegen.exact.numbers import exact_number
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.definition import from_matrices
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.on_demand import sympy as sp


def change_of_basis(
    group: GroupLike,
    combinations: Mapping[str, Mapping[str, Any]],
    *,
    name: str | None = None,
    units: Sequence[str] | None = None,
) -> MatrixGroup:
    """The same group in the basis B_label = sum coefficient * A, labels in the order given.

    change_of_basis(sl2, {"k": {"e": 1, "f": -1}, "h": {"h": 1}, "e": {"e": 1}}) is the Iwasawa basis of sl2.

    Args:
        combinations: {new label: {label of the group: exact number}}, one for each dimension.
        name: C identifier; the group's own by default.
        units: (n) units of the new components, optional.

    Raises:
        InputError: a label of the group is unknown, a coefficient is not an exact number, or their number is wrong.
        DependentBasisError: if the combinations are linearly dependent, naming the relation.
    """
    group = as_group(group, "change_of_basis")
    if not isinstance(combinations, Mapping) or not all(isinstance(row, Mapping) for row in combinations.values()):
        raise InputError("change_of_basis: give {new label: {label of the group: coefficient}}")
    if len(combinations) != group.dim:
        raise InputError(f"{group.name}: {len(combinations)} combinations for a basis of {group.dim} elements")
    matrices = []
    for label, combination in combinations.items():
        total = sp.zeros(group.degree)
        for old, value in combination.items():
            try:
                total += exact_number(value) * group.exact_basis[group.algebra.index(old)]
            except InputError as error:
                raise type(error)(f"{group.name}: basis element {label}: {error}") from None
        matrices.append(total.applyfunc(sp.expand))
    return from_matrices(
        name if name is not None else group.name,
        tuple(combinations),
        matrices,
        units=units,
        description=group.description,
    )
