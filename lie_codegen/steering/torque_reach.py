"""What torques reach from rest: the growth of brackets of velocities is not the question there, inertia takes part.

J xi' = ad*_xi J xi + sum u_a f_a, X' = X hat(xi). From rest the configurations that can be reached fill the Lie span of
the symmetric products <x : y> = -J^-1 (ad*_x J y + ad*_y J x) of the Y_a = J^-1 f_a (Bullo, Leonard and Lewis, as cited in
`mechanics/accessibility.py`, which has the exact test). Here in floating point, for any inertia.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from lie_codegen.algebra.brackets import bracket, symmetric_product
from lie_codegen.arrays import Array
from lie_codegen.errors import UncontrollableError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.accessibility import closure

_RANK = 1e-8


def require_torques_reach(group: MatrixGroup, controls: tuple[int, ...], inertia: Array) -> None:
    """Nothing, if torques on the controlled components move the configuration in every direction from rest.

    Raises:
        UncontrollableError: with the dimensions that are reached and the directions that are not.
    """
    symmetric, reached = torque_growth(group, controls, inertia)
    if len(reached) < group.dim:
        projector = reached.T @ reached
        gap = 1 - np.diag(projector)
        missing = ", ".join(label for label, share in zip(group.labels, gap, strict=True) if share > _RANK)
        raise UncontrollableError(
            f"not controllable by torques on {', '.join(group.labels[i] for i in controls)}: with this inertia, from rest, "
            f"symmetric products span {len(symmetric)} and their brackets {len(reached)} of {group.dim} dimensions; out of "
            f"reach, at least in part: {missing}; add a torque or a start_velocity"
        )


def torque_growth(group: MatrixGroup, controls: tuple[int, ...], inertia: Array) -> tuple[Array, Array]:
    """Orthonormal rows that span the closure of J^-1 f_a under symmetric products, and that closure's Lie span."""
    inverse = np.linalg.inv(inertia)
    symmetric = partial(symmetric_product, group.algebra, inertia, inverse)
    products = closure(_span(inverse[list(controls)]), symmetric, _span)
    return products, closure(products, partial(bracket, group.algebra), _span)


def _span(rows: Array) -> Array:
    """As `independent`, whatever the sizes of the rows: an inertia has units."""
    scaled = rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-300)
    _, sizes, right = np.linalg.svd(np.where(np.linalg.norm(rows, axis=1, keepdims=True) > _RANK, scaled, 0.0))
    return np.asarray(right[: int(np.sum(sizes > _RANK * max(1.0, float(sizes[0]))))])
