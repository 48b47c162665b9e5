"""What is taken for an element of a group: on it, projected onto it, or refused with the figure that is off.

With `defect` as in `groups.maps.defect`, relative to the entries that each condition reads:
    defect <= 1e-12          taken as it is;
    defect <= 1e-5           the nearest element is taken and its distance reported: rotations in single precision and printed
                             with seven digits lie here; so are matrices whose entries are all within 1e-5 of the nearest
                             element's, as printed with five digits (their defect, of second degree in X, is up to twice that);
    above                    refused. A wrong component (a determinant of -1) is above at any tolerance.
"""

from __future__ import annotations

from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import NotFiniteError, NotOnGroupError, ShapeError
from lie_codegen.groups.build import library_of
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.runtime.rows import row_by_row

#: On the group to rounding.
ON_GROUP = 1e-12
#: Projected up to here.
NEAR_GROUP = 1e-5
#: Up to here the entries decide.
_DOUBTFUL = 5 * NEAR_GROUP


class Admitted(NamedTuple):
    """An element, and how far what was given was from it.

    Attributes:
        X: (d, d).
        projected: Frobenius distance to the matrix given; 0.0 where it was taken as it is.
    """

    X: Array
    projected: float


def admitted(group: MatrixGroup, X: ArrayLike, where: str) -> Admitted:
    """The element of the group that X stands for.

    Raises:
        ShapeError, NotFiniteError: naming `where`.
        NotOnGroupError: naming `where`, the condition that fails with its figure, and the distance of the nearest element.
    """
    matrix = _matrix(group, X, where)
    off = float(library_of(group).defect(matrix))
    if off <= ON_GROUP:
        return Admitted(matrix, 0.0)
    # what mends and explains is imported for the few elements that are off
    if off <= _DOUBTFUL:
        from lie_codegen.groups.maps.nearest import nearest

        found = nearest(group, matrix)
        if off <= NEAR_GROUP or np.max(np.abs(found.X - matrix)) <= NEAR_GROUP:
            return Admitted(found.X, float(found.distance))
    from lie_codegen.groups.maps.refusal import why_refused

    reason = why_refused(group, matrix, lambda other: float(library_of(group).defect(other)))
    raise NotOnGroupError(f"{where} is not on the group {group.name}: {reason}")


def admitted_all(group: MatrixGroup, X: Array, where: str) -> tuple[Array, Array]:
    """(N, d, d) elements and their (N,) distances, as `admitted` of each.

    Raises:
        NotOnGroupError: naming the first that is refused by its number.
    """
    several = np.ascontiguousarray(X, dtype=group.basis.dtype)
    if np.all(row_by_row(library_of(group).defect, several)[0] <= ON_GROUP):
        return several, np.zeros(len(several))
    each = [admitted(group, matrix, f"{where}[{number}]") for number, matrix in enumerate(several)]
    return np.array([one.X for one in each]), np.array([one.projected for one in each])


def _matrix(group: MatrixGroup, X: ArrayLike, where: str) -> Array:
    d, dtype = group.basis.shape[1], group.basis.dtype
    try:
        given = np.asarray(X)
        if given.dtype is not dtype and given.dtype.kind == "c" and dtype.kind != "c":
            if np.any(given.imag != 0):
                raise ShapeError(f"{where}: complex entries, but {group.name} is a group of real matrices")
            given = given.real
        matrix = np.ascontiguousarray(given, dtype=dtype)
    except (TypeError, ValueError) as error:
        if isinstance(error, ShapeError):
            raise
        raise ShapeError(f"{where}: no array of numbers; give a ({d}, {d}) matrix") from None
    if matrix.shape != (d, d):
        raise ShapeError(f"{where} has shape {matrix.shape}; an element of {group.name} is ({d}, {d})")
    # a sum of squares is finite only where all of them are; one of finite entries may leave the range
    entries = matrix.reshape(-1)
    if not isfinite(abs(entries.dot(entries))) and not np.all(np.isfinite(matrix)):
        raise NotFiniteError(f"{where} holds NaN or infinity")
    return matrix
