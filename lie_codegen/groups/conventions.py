"""Conventions of the neighbours, and converters between theirs and ours.

Ours: X' = X hat(u) with body velocities u; tangent vectors of SE(2) and SE(3) have the rotation first; every group element is its
matrix; `exp` and `log` are those of the matrix; `rjac` belongs to body velocities, exp(x)' = exp(x) hat(rjac(x) x').

| library | SE(2) tangent | SE(3) tangent | a plus small v | Jacobian of exp given | quaternion as four numbers |
|---|---|---|---|---|---|
| lie_codegen | omega, vx, vy | w, v | X exp(v) | left and right | none: matrices |
| scipy (Rotation, RigidTransform) | - | w, v | - | - | x, y, z, w |
| jaxlie | vx, vy, omega | v, w | X exp(v) | inverse right (jlog) | w, x, y, z |
| pinocchio | vx, vy, omega | v, w | X exp(v) | right (Jexp3, Jexp6) | x, y, z, w |
| gtsam | vx, vy, omega | w, v | X exp(v) | right (ExpmapDerivative) | w, x, y, z (Rot3.Quaternion) |
| Sophus | vx, vy, omega | v, w | X exp(v) | left (leftJacobian) | x, y, z, w |
| manif | vx, vy, omega | v, w | X exp(v) | left and right | x, y, z, w |

Quaternions are Hamilton's, with R(q) v = q v q^*, in every library of the table. A body velocity u and the spatial velocity
s of the same motion, X' = X hat(u) = hat(s) X, are related by s = Ad(X) u. SE_2(3) has tangents (w, v, p) here.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, NotOnGroupError
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.maps.admission import NEAR_GROUP, ON_GROUP
from lie_codegen.groups.maps.quaternion import quaternion_order, rotation_entries
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.shapes import shaped

#: library -> group -> our labels in the library's order.
TANGENT_ORDERS = MappingProxyType(
    {
        "lie_codegen": {"se2": ("omega", "vx", "vy"), "se3": ("w1", "w2", "w3", "v1", "v2", "v3")},
        "scipy": {"se3": ("w1", "w2", "w3", "v1", "v2", "v3")},
        "gtsam": {"se2": ("vx", "vy", "omega"), "se3": ("w1", "w2", "w3", "v1", "v2", "v3")},
        **{
            library: {"se2": ("vx", "vy", "omega"), "se3": ("v1", "v2", "v3", "w1", "w2", "w3")}
            for library in ("jaxlie", "pinocchio", "sophus", "manif")
        },
    }
)
#: library -> order of the four numbers of a quaternion.
QUATERNION_ORDERS = MappingProxyType(
    {"scipy": "xyzw", "jaxlie": "wxyz", "pinocchio": "xyzw", "gtsam": "wxyz", "sophus": "xyzw", "manif": "xyzw"}
)


def tangent_to(library: str, group: GroupLike, x: ArrayLike) -> Array:
    """Our tangent vectors (..., n) in the order of a library's own.

    Args:
        library: "manif", "sophus", "gtsam", ...; a name that is not known lists them.
        group: object, catalogue name or file.
        x: (..., n) in our order.

    Raises:
        InputError: a library or group the table does not have.
        ShapeError: the last axis is not n.
    """
    group = as_group(group, "tangent_to")
    return _vectors(group, x)[..., _permutation(library, group)]


def tangent_from(library: str, group: GroupLike, x: ArrayLike) -> Array:
    """A library's tangent vectors (..., n) in our order.

    Args:
        library: "manif", "sophus", "gtsam", ...: as `tangent_to` lists them where a name is not known.
        group: object, catalogue name or file.
        x: (..., n) in the library's order.

    Raises:
        InputError, ShapeError: as `tangent_to`.
    """
    group = as_group(group, "tangent_from")
    return _vectors(group, x)[..., np.argsort(_permutation(library, group))]


def jacobian_to(library: str, group: MatrixGroup, J: ArrayLike) -> Array:
    """A Jacobian between our tangent vectors (..., n, n), with rows and columns in a library's order.

    Raises:
        InputError, ShapeError: as `tangent_to`.
    """
    matrix = shaped(J, (..., group.dim, group.dim), "J")
    order = _permutation(library, group)
    return matrix[..., order, :][..., order]


def spatial_from_body(group: MatrixGroup, X: ArrayLike, u: ArrayLike) -> Array:
    """s with hat(s) X = X hat(u): s = Ad(X) u, for one X (d, d) and one u (n,)."""
    matrix = np.asarray(X)
    return np.asarray(group.project(matrix @ group.hat(u) @ np.linalg.inv(matrix)))


def body_from_spatial(group: MatrixGroup, X: ArrayLike, s: ArrayLike) -> Array:
    """u with X hat(u) = hat(s) X: u = Ad(X)^{-1} s, for one X (d, d) and one s (n,)."""
    matrix = np.asarray(X)
    return np.asarray(group.project(np.linalg.inv(matrix) @ group.hat(s) @ matrix))


def rotation_from_quaternion(q: ArrayLike, *, order: str | None = None) -> Array:
    """Rotation matrices (..., 3, 3) of quaternions.

    Args:
        q: (..., 4), of any length but zero.
        order: "wxyz" or "xyzw"; it has to be said.

    Raises:
        InputError: no order or another, or a zero quaternion.
        ShapeError: the last axis is not 4.
    """
    values = shaped(q, (..., 4), "q")
    places = quaternion_order(order)
    square = np.sum(values * values, axis=-1)
    if not np.all((square > 0) & np.isfinite(square)):
        raise InputError("q is zero or not finite: it stands for no rotation")
    rows = rotation_entries(list(np.moveaxis(values, -1, 0)), places)
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternion_from_rotation(R: ArrayLike, *, order: str | None = None) -> Array:
    """Unit quaternions (..., 4) of rotation matrices, with w >= 0.

    Of the rows of 4 q q^T the one with the largest diagonal entry is normalised, so that no digit is lost at any angle. At w = 0
    the component of largest modulus is positive. (Shepperd's choice.)

    Args:
        R: (..., 3, 3).
        order: "wxyz" or "xyzw"; it has to be said.

    Raises:
        InputError: no order or another.
        ShapeError: the last axes are not (3, 3).
        NotOnGroupError: a matrix is not a rotation to 1e-5; nearer ones, as in single precision, are projected.
    """
    matrix = shaped(R, (..., 3, 3), "R")
    places = quaternion_order(order)
    off = np.max(np.abs(matrix @ np.swapaxes(matrix, -1, -2) - np.eye(3)), initial=0.0)
    if not (off <= NEAR_GROUP and np.all(np.linalg.det(matrix) > 0)):
        raise NotOnGroupError(f"R is not a rotation: |R R^T - I| is {off:.3g}, or det R < 0")
    if off > ON_GROUP:
        left, _, right = np.linalg.svd(matrix)
        matrix = left @ right
    r = np.moveaxis(matrix, (-2, -1), (0, 1))
    a, b, c = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    d, e, f = r[0, 1] + r[1, 0], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1]
    x, y, z = r[0, 0], r[1, 1], r[2, 2]
    table = np.array(
        [[1 + x + y + z, a, b, c], [a, 1 + x - y - z, d, e], [b, d, 1 - x + y - z, f], [c, e, f, 1 - x - y + z]]
    )
    largest = np.argmax(np.stack([table[k, k] for k in range(4)]), axis=0)
    q = np.take_along_axis(np.moveaxis(table, (0, 1), (-2, -1)), largest[..., None, None], axis=-2)[..., 0, :]
    q = np.where(q[..., :1] < 0, -q, q) / np.linalg.norm(q, axis=-1, keepdims=True)
    return np.asarray(q[..., np.argsort(places)])


def _permutation(library: str, group: MatrixGroup) -> list[int]:
    orders: Any = TANGENT_ORDERS.get(library)
    if orders is None:
        raise InputError(f"no library {library!r} in the table of conventions: {', '.join(TANGENT_ORDERS)}")
    labels = orders.get(group.name)
    if labels is None or sorted(labels) != sorted(group.labels):
        if group.name in ("so2", "so3"):
            return list(range(group.dim))
        raise InputError(
            f"no tangent order of {library} for the group {group.name} {group.labels}; known: {', '.join(orders)}"
        )
    return [group.labels.index(label) for label in labels]


def _vectors(group: MatrixGroup, x: ArrayLike) -> Array:
    vector = shaped(x, (..., group.dim), "x")
    return vector
