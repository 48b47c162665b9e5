"""States of second-order motion as the compiled loops hold them: varying entries of X, then xi."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lie_codegen.arrays import Array
from lie_codegen.errors import ShapeError
from lie_codegen.groups.maps.admission import admitted, admitted_all
from lie_codegen.groups.maps.element_pattern import packed_size, varying_entries
from lie_codegen.groups.matrix_group import MatrixGroup


def initial_states(group: MatrixGroup, X0: ArrayLike | None, xi0: ArrayLike | None) -> tuple[Array, bool]:
    """(N, m) packed states, and whether several were given.

    Raises:
        ShapeError: X0 or xi0 has another shape.
        NotOnGroupError: X0 is off the group by more than 1e-5; nearer ones are projected.
    """
    d, n = group.degree, group.dim
    kind = complex if group.is_complex else float
    X = np.eye(d, dtype=kind) if X0 is None else np.asarray(X0, dtype=kind)
    xi = np.zeros(n) if xi0 is None else np.asarray(xi0, dtype=float)
    if X.shape[-2:] != (d, d) or X.ndim not in (2, 3) or xi.shape[-1:] != (n,) or xi.ndim not in (1, 2):
        raise ShapeError(
            f"initial states on {group.name}: X0 {X.shape} and xi0 {xi.shape}; give ({d}, {d}) and ({n},), or N of either: (N, {d}, {d}), (N, {n})"
        )
    many = X.ndim == 3 or xi.ndim == 2
    counts = {*X.shape[:-2], *xi.shape[:-1]} - {1}
    if len(counts) > 1:
        raise ShapeError(f"initial states on {group.name}: {len(X)} X0 and {len(xi)} xi0; give one of each, or as many")
    count = max(counts, default=1)
    X = admitted(group, X, "X0").X if X.ndim == 2 else admitted_all(group, X, "X0")[0]
    if many:
        X, xi = np.broadcast_to(X, (count, d, d)), np.broadcast_to(xi, (count, n))
    else:
        X, xi = X[None], xi[None]
    rows, columns = _places(group)
    entries = np.ascontiguousarray(X[:, rows, columns])
    flat = entries.view(float) if group.is_complex else entries
    return np.concatenate([flat.reshape(count, -1), xi], axis=1), many


@lru_cache(maxsize=128)
def _places(group: MatrixGroup) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns of the entries that vary."""
    rows, columns = np.array(varying_entries(group), dtype=np.intp).T
    return rows, columns


def split_states(group: MatrixGroup, states: Array) -> tuple[Array, Array]:
    """X (..., d, d) and xi (..., n) of packed states (..., m)."""
    size = packed_size(group)
    packed = np.ascontiguousarray(states[..., :size])
    values = packed.view(complex) if group.is_complex else packed
    shape = *states.shape[:-1], group.degree, group.degree
    rows, columns = _places(group)
    xi = np.ascontiguousarray(states[..., size : size + group.dim])
    if len(rows) == group.degree**2:  # row by row, as they stand in the matrix; not the states' own memory
        return (values.copy() if values.base is not None else values).reshape(shape), xi
    X = np.broadcast_to(np.eye(group.degree, dtype=values.dtype), shape).copy()
    X[..., rows, columns] = values
    return X, xi
