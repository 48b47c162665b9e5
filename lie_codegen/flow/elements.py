"""Elements that a user gives, as a matrix or by coordinates of the second kind."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import NotFiniteError, ShapeError
from lie_codegen.flow.libraries import integrators
from lie_codegen.groups.maps.admission import Admitted, admitted
from lie_codegen.groups.matrix_group import MatrixGroup


def group_element(group: MatrixGroup, value: ArrayLike, where: str) -> Array:
    """An element of the group from a (d, d) matrix, projected where it is near the group, or from (n,) coordinates of the
    second kind.

    Raises:
        ShapeError, NotFiniteError: naming `where`.
        NotOnGroupError: a matrix off the group; says how far.
    """
    return admitted_element(group, value, where).X


def admitted_element(group: MatrixGroup, value: ArrayLike, where: str) -> Admitted:
    """As `group_element`, with the distance to what was given.

    Raises:
        ShapeError, NotFiniteError, NotOnGroupError: as `group_element`.
    """
    if np.shape(value) != (group.dim,):
        try:
            return admitted(group, value, where)
        except ShapeError as error:
            raise ShapeError(f"{error}; or give ({group.dim},) coordinates of the second kind") from None
    try:
        g = np.ascontiguousarray(value, dtype=float)
    except (TypeError, ValueError):
        raise ShapeError(f"{where}: coordinates of the second kind are real numbers, got {value!r:.60}") from None
    if not np.all(np.isfinite(g)):
        raise NotFiniteError(f"{where} holds NaN or infinity")
    return Admitted(np.asarray(integrators(group).product_exp(g)), 0.0)
