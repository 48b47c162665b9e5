"""Groups of rotations: their bases in body axes."""

from __future__ import annotations

from lie_codegen.errors import InputError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.on_demand import sympy as sp


def body_frame(group: MatrixGroup, where: str) -> sp.ImmutableMatrix:
    """(3, 3) the basis of the group in body axes, a column each, exact.

    Raises:
        InputError: the group is not one of rotations.
    """
    table = {key: dict(row) for key, row in group.algebra.table.items()}
    if group.dim == 3 and table == {(0, 1): {2: 1}, (0, 2): {1: -1}, (1, 2): {0: 1}}:
        return sp.ImmutableMatrix(sp.eye(3))  # hat(e_i) of SO(3), or of SU(2)
    if group.dim == 3 and group.degree == 3 and all(-m == m.T for m in group.exact_basis):
        return sp.ImmutableMatrix.hstack(*(sp.Matrix([m[2, 1], m[0, 2], m[1, 0]]) for m in group.exact_basis))
    raise InputError(
        f"{where}: {group.name} is not a group of rotations: give so3 in any basis (3 x 3 matrices), or su2"
    )
