"""lc.cartan_involution: the Cartan involution of the semisimple part of a group, decided on its brackets."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.algebra.cartan import Involution, cartan_involution_of
from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.algebra.structure import structure
from lie_codegen.algebra.subspace import Subspace, bracket
from lie_codegen.errors import AlgebraError
from lie_codegen.exact.numbers import domain_matrix, to_numbers
from lie_codegen.groups.catalogue_load import as_group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import sympy as sp


@dataclass(frozen=True, eq=False, repr=False)
class CartanInvolution(Saved):
    """theta, with fixed points k (compact) and -1 on p: -K(x, theta y) is positive.

    Attributes:
        theta: (m, m) doubles on the rows of `levi`; column j holds the coordinates of theta of row j.
        compact: dim k = (m + tr theta) / 2.
        exact: whether theta was proved exactly; otherwise it is numeric, checked to 1e-7.
        exact_theta: (m, m) exact, or None.
        levi: (m, n) a basis of the semisimple part; the identity for a semisimple group.
    """

    theta: NDArray[Any]
    compact: int
    exact: bool
    exact_theta: sp.ImmutableMatrix | None
    levi: NDArray[Any]


def cartan_involution(group: MatrixGroup | str | Path) -> CartanInvolution:
    """The Cartan involution of the semisimple (Levi) part of a group, from its brackets alone.

    Raises:
        AlgebraError: the group is solvable, or no involution is found.
    """
    found = as_group(group)
    levi = structure(found.algebra).levi if not _semisimple(found.algebra) else None
    if levi == ():
        raise AlgebraError(f"{found.name} is solvable: it has no semisimple part and no Cartan involution")
    algebra = found.algebra if levi is None else restricted_to(found.algebra, levi)
    made: Involution = cartan_involution_of(algebra)
    rows = np.eye(found.dim) if levi is None else np.array([[float(value) for value in row] for row in levi])
    return CartanInvolution(np.array(made.numeric), made.compact, made.exact is not None, made.exact, rows)


def _semisimple(algebra: LieAlgebra) -> bool:
    return structure(algebra).semisimple


def restricted_to(algebra: LieAlgebra, basis: Subspace) -> LieAlgebra:
    """The subalgebra with the given basis of coordinate vectors."""
    size = len(basis)
    pairs = [(i, j) for i in range(size) for j in range(i + 1, size)]
    images = [bracket(algebra, basis[i], basis[j]) for i, j in pairs]
    # One elimination solves for all brackets: [basis | images] as columns.
    table = [list(column) for column in zip(*basis, *images, strict=True)]
    reduced = to_numbers(domain_matrix(table).rref()[0])[:size]
    constants = {
        pair: {k: reduced[k][size + place] for k in range(size) if reduced[k][size + place] != 0}
        for place, pair in enumerate(pairs)
    }
    labels = tuple(f"s{i + 1}" for i in range(size))
    return LieAlgebra(algebra.name, labels, {pair: row for pair, row in constants.items() if row})
