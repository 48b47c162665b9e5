"""The logarithm of an element and the distance of two, numeric, of any group; says where there is none."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import ShapeError
from lie_codegen.groups.build import library_of
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.on_demand import scipy

#: Nearer to the identity than this the series of the logarithm to third order is exact to rounding.
_NEAR = 1e-5
_BEFORE_CUT = 3.1
_MOST_PARALLEL = 1e2
_IN_ALGEBRA = 1e-13
#: Dimensions up to which exp and log are derived and compiled in a fraction of a second.
_SMALL = 6


def matrix_log(group: MatrixGroup, X: ArrayLike) -> tuple[Array, float]:
    """Coordinates x of the principal logarithm of X, and max |exp(hat(x)) - X|: zero where X = exp(hat(x))."""
    matrix = np.asarray(X)
    small = matrix - np.eye(group.degree)
    if float(np.abs(small).max()) <= _NEAR / group.degree:
        logarithm = small @ (np.eye(group.degree) - small @ (np.eye(group.degree) / 2 - small / 3))
        x = group.project(logarithm)
        return x, float(np.max(np.abs(group.hat(x) - logarithm)))
    for quickly in (_compiled_log, _unipotent_log, _diagonal_log):
        found = quickly(group, matrix)
        if found is not None:
            return found, 0.0
    logarithm = np.asarray(scipy.linalg.logm(matrix))
    if not np.all(np.isfinite(logarithm)):
        return np.zeros(group.dim), float("inf")
    x = group.project(logarithm)
    return x, float(np.max(np.abs(scipy.linalg.expm(group.hat(x)) - matrix)))


def _compiled_log(group: MatrixGroup, matrix: Array) -> Array | None:
    """By the group's own kernels, of a group small enough to have them at once, where exp of the result is the matrix."""
    if group.dim > _SMALL:
        return None
    maps = library_of(group)
    with np.errstate(all="ignore"):
        x = np.asarray(maps.log(np.ascontiguousarray(matrix, dtype=group.basis.dtype)))
        if not np.isfinite(x).all():
            return None
        off = np.abs(maps.exp(x) - matrix).max()
    return x if off <= _IN_ALGEBRA * max(1.0, float(np.abs(matrix).max())) else None


def _unipotent_log(group: MatrixGroup, matrix: Array) -> Array | None:
    """The logarithm of I + N by its series, where N^d = 0 and the result is in the algebra."""
    nilpotent = matrix - np.eye(group.degree)
    power, total = nilpotent, nilpotent
    for k in range(2, group.degree + 1):
        power = -power @ nilpotent
        total = total + power / k
    scale = max(1.0, float(np.max(np.abs(nilpotent))))
    if not np.max(np.abs(power)) <= 1e-16 * scale:
        return None
    x = group.project(total)
    return x if np.max(np.abs(group.hat(x) - total)) <= _IN_ALGEBRA * scale else None


def _diagonal_log(group: MatrixGroup, matrix: Array) -> Array | None:
    """The principal logarithm by eigenvectors, where they are far from parallel and the result is in the algebra."""
    if not np.all(np.isfinite(matrix)):
        return None
    values, vectors = np.linalg.eig(matrix)
    if np.any(values == 0) or np.any(np.abs(np.angle(values)) > _BEFORE_CUT):
        return None
    try:
        inverse = np.linalg.inv(vectors)
    except np.linalg.LinAlgError:
        return None
    if np.linalg.norm(inverse) > _MOST_PARALLEL:
        return None
    logarithm = (vectors * np.log(values.astype(complex))) @ inverse
    x = group.project(logarithm)
    off = np.max(np.abs(group.hat(x) - logarithm))
    return x if off <= _IN_ALGEBRA * max(1.0, float(np.max(np.abs(logarithm)))) else None


def distance(group: GroupLike, X: ArrayLike, Y: ArrayLike) -> float:
    """|log(X^-1 Y)|, Euclidean in the basis: left-invariant; on SO(3) the angle of the rotation from X to Y.

    Where X^-1 Y has no logarithm in the algebra, the Frobenius norm of X^-1 Y - I stands in.

    Args:
        group: the group, its name or its file.
        X, Y: (d, d) elements, which are not tested for being elements.

    Raises:
        ShapeError: matrices of another size.
    """
    group = as_group(group, "distance")
    d = group.degree
    for name, given in (("X", X), ("Y", Y)):
        if np.shape(given) != (d, d):
            raise ShapeError(f"distance: {name} has shape {np.shape(given)}; an element of {group.name} is ({d}, {d})")
    relative = np.linalg.solve(np.asarray(X), np.asarray(Y))
    x, off = matrix_log(group, relative)
    if off <= 1e-6:
        return float(np.linalg.norm(x))
    return float(np.linalg.norm(relative - np.eye(group.degree)))
