"""Coordinates of the second kind, X = exp(g_1 A_1) ... exp(g_n A_n), by Newton's method from several starts."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import NotOnGroupError, ShapeError
from lie_codegen.flow.chart import mismatch, newton
from lie_codegen.flow.libraries import integrators
from lie_codegen.flow.logarithm import matrix_log
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.runtime.rows import row_by_row

#: Of the random starts.
_SEED = 20
#: The distance to X, relative to its size, from which Newton's steps double the digits.
_ARRIVED = 1e-9
#: Entries of M(g) up to which it is well enough conditioned to be inverted as it is.
_INSIDE = 1e6


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

    Args:
        group: the group, its name or its file.
        X: (d, d) element; g is (n,).

    Raises:
        ShapeError: X is not (d, d).
        NotOnGroupError: if none is found from 0, from log X, or from random starts.
    """
    group = as_group(group, "second_kind")
    target, d = np.asarray(X), group.degree
    if target.shape != (d, d):
        raise ShapeError(f"second_kind: X has shape {target.shape}; an element of {group.name} is ({d}, {d})")
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
    """Gauss-Newton on |Phi(g) - X|^2 with Levenberg's damping, for all starts at once; then Newton.

    Those that have arrived wait for Newton, who brings them from there to rounding.
    """
    lib = integrators(group)
    arrived = _ARRIVED**2 * max(1.0, float(np.max(np.abs(target)))) ** 2
    ends, still = g.copy(), np.arange(len(g))
    damping = np.full(len(g), 1e-2)
    residual, columns = _linearised(group, g, target)
    cost = np.sum(residual**2, axis=1)
    for _ in range(40):
        far = ~(cost <= arrived)
        if not np.all(far):
            ends[still[~far]] = g[~far]
            still, g, damping, residual, columns, cost = (
                each[far] for each in (still, g, damping, residual, columns, cost)
            )
            if not len(still):
                break
        normal = np.einsum("kri,krj->kij", columns, columns) + damping[:, None, None] * np.eye(group.dim)
        step = np.linalg.solve(normal, -np.einsum("kri,kr->ki", columns, residual)[..., None])[..., 0]
        trial = g + step
        with np.errstate(all="ignore"):
            values = row_by_row(lib.product_exp, trial)[0]
        new_cost = np.sum(np.abs(values - target) ** 2, axis=(1, 2))
        better = new_cost < cost
        g = np.where(better[:, None], trial, g)
        damping = np.clip(np.where(better, damping / 4, damping * 8), 1e-14, 1e8)
        residual, columns = _linearised(group, g, target)
        cost = np.sum(residual**2, axis=1)
    ends[still] = g
    with np.errstate(all="ignore"):
        return newton(group, ends, np.broadcast_to(target, (len(ends), *target.shape)))


def _inverses(M: Array) -> Array:
    """(k, n, n) M(g)^-1; at the ends of a chart, where M is infinite or nearly, what is left of it by singular values."""
    with np.errstate(all="ignore"):
        inside = np.max(np.abs(M), axis=(1, 2)) < _INSIDE
        found = np.empty_like(M)
        try:
            found[inside] = np.linalg.inv(M[inside])
        except np.linalg.LinAlgError:  # of rounding, for M^-1 is finite
            inside[:] = False
        found[~inside] = np.linalg.pinv(np.nan_to_num(M[~inside], posinf=0, neginf=0))
    return found


def _linearised(group: MatrixGroup, g: Array, target: Array) -> tuple[Array, Array]:
    """Residual Phi(g) - X and its derivative by g, real and imaginary parts stacked: d/dg_k Phi = Phi hat(M^-1 e_k)."""
    lib = integrators(group)
    phi = row_by_row(lib.product_exp, np.ascontiguousarray(g))[0]
    difference = (phi - target).reshape(len(g), -1)
    directions = group.hat(np.swapaxes(_inverses(row_by_row(lib.wei_norman_matrix, np.ascontiguousarray(g))[0]), 1, 2))
    moved = (phi[:, None] @ directions).reshape(len(g), group.dim, -1)
    residual = np.concatenate([difference.real, difference.imag], axis=1)
    columns = np.concatenate([moved.real, moved.imag], axis=2).swapaxes(1, 2)
    return residual, columns
