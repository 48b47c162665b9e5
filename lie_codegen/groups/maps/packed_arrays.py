"""Arrays of group elements as the doubles that vary, and back: `element_pattern` in NumPy, for any number of elements at once."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.groups.maps.element_pattern import varying_entries
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.runtime.outputs import copied, empty


class Form(NamedTuple):
    """How elements of a group are packed.

    Attributes:
        dtype: of the entries.
        places: of the entries that vary, row by row among all; None where all do.
        identity: the identity, to which nobody writes.
    """

    dtype: np.dtype[Any]
    places: NDArray[np.intp] | None
    identity: Array


@lru_cache(maxsize=128)
def form_of(group: MatrixGroup) -> Form:
    """How elements of the group are packed, found once."""
    d, dtype = group.degree, group.basis.dtype
    rows, columns = np.array(varying_entries(group), dtype=np.intp).T
    identity = np.eye(d, dtype=dtype)
    identity.flags.writeable = False
    return Form(dtype, None if len(rows) == d**2 else rows * d + columns, identity)


def identity_of(group: MatrixGroup) -> Array:
    """(d, d) the identity, one array for all who ask, which cannot be written to."""
    return form_of(group).identity


def packed_elements(group: MatrixGroup, X: Array) -> Array:
    """(..., size) the varying entries of elements (..., d, d), row by row, complex ones as re, im; X itself where all entries vary."""
    return packed_by(form_of(group), X)


def packed_by(form: Form, X: Array) -> Array:
    """The same by a form."""
    entries = np.ascontiguousarray(X, dtype=form.dtype)
    entries = entries.reshape(-1) if entries.ndim == 2 else entries.reshape(*X.shape[:-2], -1)
    if form.places is not None:
        entries = entries.take(form.places, axis=-1)
    return entries if entries.dtype.kind == "f" else entries.view(float)


def elements_of(group: MatrixGroup, packed: Array) -> Array:
    """X (..., d, d) of packed elements (..., size), in memory of its own."""
    form = form_of(group)
    shape = (*packed.shape[:-1], *form.identity.shape)
    if form.places is None:  # row by row, as they stand in the matrix
        entries = copied(packed)
        return (entries if form.dtype.kind == "f" else entries.view(form.dtype)).reshape(shape)
    X = empty(shape, form.dtype)
    X[...] = form.identity
    flat = X.reshape(*packed.shape[:-1], -1)
    flat[..., form.places] = np.ascontiguousarray(packed).view(form.dtype)
    return X
