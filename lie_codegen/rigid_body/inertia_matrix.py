"""Inertia as three moments or as a matrix: principal moments in increasing order, and axes."""

from __future__ import annotations

from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, NotFiniteError, ShapeError

_SYMMETRIC, _TRIANGLE = 1e-12, 1e-12
#: Moments this near to each other, relative to the largest, are those of a sphere.
SPHERE = 1e-9


def principal_axes(J: Any) -> tuple[Array, Array, Array]:
    """(J (3, 3), moments (3,) increasing, axes (3, 3) by columns with det +1) of three moments or a matrix.

    The axes of a diagonal J are the user's own, permuted.

    Raises:
        InputError: not symmetric to 1e-12, not positive, or a moment above the sum of the other two; the numbers are named.
    """
    matrix = np.array(J, dtype=float)
    if matrix.shape == (3,):
        matrix = np.diag(matrix)
    if matrix.shape != (3, 3):
        raise ShapeError(f"inertia has shape {matrix.shape}: three moments or a 3 x 3 matrix")
    if not np.all(np.isfinite(matrix)):
        raise NotFiniteError("inertia holds NaN or infinity")
    scale = float(np.abs(matrix).max())
    if float(np.abs(matrix - matrix.T).max()) > _SYMMETRIC * scale:
        i, j = divmod(int(np.argmax(np.abs(matrix - matrix.T))), 3)
        raise InputError(
            f"inertia is not symmetric: J[{i}][{j}] = {matrix[i, j]:.9g}, J[{j}][{i}] = {matrix[j, i]:.9g}"
        )
    if np.count_nonzero(matrix - np.diag(np.diag(matrix))) == 0:
        order = np.argsort(np.diag(matrix), kind="stable")
        moments, axes = np.diag(matrix)[order], np.eye(3)[:, order]
    else:
        moments, axes = np.linalg.eigh((matrix + matrix.T) / 2)
    axes = axes * np.array([np.sign(np.linalg.det(axes)), 1.0, 1.0])
    if moments[0] <= 0:
        raise InputError(f"inertia is not positive: its principal moments are {moments.tolist()}")
    if moments[2] > (moments[0] + moments[1]) * (1 + _TRIANGLE):
        raise InputError(f"no body has the principal moments {moments.tolist()}: one is above the sum of the other two")
    return matrix, moments, np.ascontiguousarray(axes)
