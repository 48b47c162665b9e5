"""Where an element lies: logarithm, distance, membership, coordinates of the second kind; numeric, any group."""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import NotFiniteError, NotOnGroupError, ShapeError
from lie_codegen.flow.chart import mismatch, newton
from lie_codegen.flow.libraries import integrators, logarithms
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.maps.admission import Admitted, admitted
from lie_codegen.groups.matrix_group import MatrixGroup

#: Nearer to the identity than this the series of the logarithm to third order is exact to rounding.
_NEAR = 1e-5
_BEFORE_CUT = 3.1
_MOST_PARALLEL = 1e2
_IN_ALGEBRA = 1e-13
_SEED = 20
#: Dimensions up to which exp and log are derived and compiled in a fraction of a second.
_SMALL = 6


def matrix_log(group: MatrixGroup, X: ArrayLike) -> tuple[Array, float]:
    """Coordinates x of the principal logarithm of X, and max |exp(hat(x)) - X|: zero where X = exp(hat(x))."""
    matrix = np.asarray(X)
    small = matrix - np.eye(group.degree)
    if float(np.max(np.abs(small))) <= _NEAR / group.degree:
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
    maps = logarithms(group)
    with np.errstate(all="ignore"):
        x = np.asarray(maps.log(np.ascontiguousarray(matrix, dtype=group.basis.dtype)))
        if not np.all(np.isfinite(x)):
            return None
        off = np.max(np.abs(maps.exp(x) - matrix))
    return x if off <= _IN_ALGEBRA * max(1.0, float(np.max(np.abs(matrix)))) else None


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
    """
    group = as_group(group, "distance")
    relative = np.linalg.solve(np.asarray(X), np.asarray(Y))
    x, off = matrix_log(group, relative)
    if off <= 1e-6:
        return float(np.linalg.norm(x))
    return float(np.linalg.norm(relative - np.eye(group.degree)))


def element_coordinates(group: MatrixGroup, X: ArrayLike) -> Array:
    """(n,) the logarithm of X where it has one, else its coordinates of the second kind, else 0: a first guess."""
    x, off = matrix_log(group, X)
    if off <= 1e-6:
        return x
    try:
        return second_kind(group, X)
    except NotOnGroupError:
        return np.zeros(group.dim)


def second_kind(group: GroupLike, X: ArrayLike) -> Array:
    """g with exp(g_1 A_1) ... exp(g_n A_n) = X, the one nearest to 0 that Newton's method finds.

    Raises:
        NotOnGroupError: if none is found from 0, from log X, or from random starts.
    """
    group = as_group(group, "second_kind")
    target = np.asarray(X)
    rng = np.random.default_rng(_SEED)
    starts = np.vstack([np.zeros(group.dim), matrix_log(group, target)[0], rng.uniform(-2, 2, (200, group.dim))])
    found = _damped(group, starts, target)
    off = mismatch(group, found, np.broadcast_to(target, (len(found), *target.shape)))
    scale = max(1.0, float(np.max(np.abs(target))))
    good = off <= 1e-10 * scale
    if not np.any(good):
        raise NotOnGroupError(
            f"{group.name}: no coordinates of the second kind found; the nearest element reached differs by "
            f"{np.nanmin(off):.3g}; the matrix is not on the group, or not in the image of the chart "
            f"{', '.join(group.labels)}"
        )
    sizes = np.where(good, np.linalg.norm(found, axis=1), np.inf)
    return np.asarray(found[np.argmin(sizes)])


def _damped(group: MatrixGroup, g: Array, target: Array) -> Array:
    """Gauss-Newton on |Phi(g) - X|^2 with Levenberg's damping, for all starts at once; then Newton."""
    lib = integrators(group)
    damping = np.full(len(g), 1e-2)
    residual, columns = _linearised(group, g, target)
    cost = np.sum(residual**2, axis=1)
    for _ in range(40):
        normal = np.einsum("kri,krj->kij", columns, columns) + damping[:, None, None] * np.eye(group.dim)
        step = np.linalg.solve(normal, -np.einsum("kri,kr->ki", columns, residual)[..., None])[..., 0]
        trial = g + step
        with np.errstate(all="ignore"):
            values = lib.product_exp.batch(trial)
        new_cost = np.sum(np.abs(values - target) ** 2, axis=(1, 2))
        better = new_cost < cost
        g = np.where(better[:, None], trial, g)
        damping = np.clip(np.where(better, damping / 4, damping * 8), 1e-14, 1e8)
        residual, columns = _linearised(group, g, target)
        cost = np.sum(residual**2, axis=1)
    with np.errstate(all="ignore"):
        return newton(group, g, np.broadcast_to(target, (len(g), *target.shape)))


def _linearised(group: MatrixGroup, g: Array, target: Array) -> tuple[Array, Array]:
    """Residual Phi(g) - X and its derivative by g, real and imaginary parts stacked: d/dg_k Phi = Phi hat(M^-1 e_k)."""
    lib = integrators(group)
    phi = lib.product_exp.batch(np.ascontiguousarray(g))
    difference = (phi - target).reshape(len(g), -1)
    with np.errstate(all="ignore"):
        inverse = np.linalg.pinv(
            np.nan_to_num(lib.wei_norman_matrix.batch(np.ascontiguousarray(g)), posinf=0, neginf=0)
        )
    directions = group.hat(np.swapaxes(inverse, 1, 2))
    moved = (phi[:, None] @ directions).reshape(len(g), group.dim, -1)
    residual = np.concatenate([difference.real, difference.imag], axis=1)
    columns = np.concatenate([moved.real, moved.imag], axis=2).swapaxes(1, 2)
    return residual, columns


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
