"""States of second-order motion as the compiled loops hold them: varying entries of X, then xi."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lie_codegen.arrays import Array
from lie_codegen.errors import ShapeError
from lie_codegen.groups.maps.admission import admitted, admitted_all
from lie_codegen.groups.maps.element_pattern import packed_size, varying_entries
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.runtime.outputs import copied, empty


class _Form(NamedTuple):
    """How elements of a group are packed.

    Attributes:
        square, line: (d, d) and (n,).
        dtype: of the entries.
        size: doubles of a packed element.
        places: of the entries that vary, row by row among all; None where all do.
        identity, rest: the start of a motion of which nothing is said; nobody writes to them.
    """

    square: tuple[int, int]
    line: tuple[int]
    dtype: np.dtype[Any]
    size: int
    places: NDArray[np.intp] | None
    identity: Array
    rest: Array


@lru_cache(maxsize=128)
def _form(group: MatrixGroup) -> _Form:
    d, dtype = group.degree, group.basis.dtype
    rows, columns = np.array(varying_entries(group), dtype=np.intp).T
    places = None if len(rows) == d**2 else rows * d + columns
    identity, rest = np.eye(d, dtype=dtype), np.zeros(group.dim)
    identity.flags.writeable = rest.flags.writeable = False
    return _Form((d, d), (group.dim,), dtype, packed_size(group), places, identity, rest)


def initial_states(group: MatrixGroup, X0: ArrayLike | None, xi0: ArrayLike | None) -> tuple[Array, bool]:
    """(N, m) packed states, and whether several were given.

    Raises:
        ShapeError: X0 or xi0 has another shape.
        NotOnGroupError: X0 is off the group by more than 1e-5; nearer ones are projected.
    """
    form = _form(group)
    X = form.identity if X0 is None else np.asarray(X0, dtype=form.dtype)
    xi = form.rest if xi0 is None else np.asarray(xi0, dtype=float)
    if X.shape == form.square and xi.shape == form.line:
        return np.concatenate((_packed(form, X if X is form.identity else admitted(group, X, "X0").X), xi))[None], False
    (d, _), (n,) = form.square, form.line
    if X.shape[-2:] != (d, d) or X.ndim not in (2, 3) or xi.shape[-1:] != (n,) or xi.ndim not in (1, 2):
        raise ShapeError(
            f"initial states on {group.name}: X0 {X.shape} and xi0 {xi.shape}; give ({d}, {d}) and ({n},), or N of either: (N, {d}, {d}), (N, {n})"
        )
    counts = {*X.shape[:-2], *xi.shape[:-1]} - {1}
    if len(counts) > 1:
        raise ShapeError(f"initial states on {group.name}: {len(X)} X0 and {len(xi)} xi0; give one of each, or as many")
    count = max(counts, default=1)
    if X.ndim == 3:
        X = admitted_all(group, X, "X0")[0]
    elif X is not form.identity:
        X = admitted(group, X, "X0").X
    states = np.empty((count, form.size + n))
    states[:, : form.size], states[:, form.size :] = _packed(form, X), xi
    return states, True


def _packed(form: _Form, X: Array) -> Array:
    """(..., size) entries of elements (..., d, d) that vary."""
    entries = X.reshape(*X.shape[:-2], -1)
    if form.places is not None:
        entries = entries.take(form.places, axis=-1)
    return entries.view(float)


def split_states(group: MatrixGroup, states: Array) -> tuple[Array, Array]:
    """X (..., d, d) and xi (..., n) of packed states (..., m)."""
    form = _form(group)
    behind = form.size + form.line[0]
    return elements_of(group, states[..., : form.size]), copied(states[..., form.size : behind])


def elements_of(group: MatrixGroup, packed: Array) -> Array:
    """X (..., d, d) of packed elements (..., size), in memory of its own."""
    form = _form(group)
    shape = (*packed.shape[:-1], *form.square)
    if form.places is None:  # row by row, as they stand in the matrix
        return copied(packed).view(form.dtype).reshape(shape)
    X = empty(shape, form.dtype)
    X[...] = form.identity
    flat = X.reshape(*packed.shape[:-1], -1)
    flat[..., form.places] = np.ascontiguousarray(packed).view(form.dtype)
    return X
