"""States of second-order motion as the compiled loops hold them: varying entries of X, then xi."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import ShapeError
from lie_codegen.groups.maps.admission import admitted, admitted_all
from lie_codegen.groups.maps.element_pattern import packed_size
from lie_codegen.groups.maps.packed_arrays import elements_of, form_of, packed_by, packed_elements
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.runtime.outputs import copied


def initial_states(group: MatrixGroup, X0: ArrayLike | None, xi0: ArrayLike | None) -> tuple[Array, bool]:
    """(N, m) packed states, and whether several were given.

    Raises:
        ShapeError: X0 or xi0 has another shape.
        NotOnGroupError: X0 is off the group by more than 1e-5; nearer ones are projected.
    """
    n, form = group.dim, form_of(group)
    identity = form.identity
    d = len(identity)
    X = identity if X0 is None else np.asarray(X0, dtype=identity.dtype)
    xi = np.zeros(n) if xi0 is None else np.asarray(xi0, dtype=float)
    if X.shape == (d, d) and xi.shape == (n,):
        packed = packed_by(form, X if X is identity else admitted(group, X, "X0").X)
        size = len(packed)
        state = np.empty(size + n)
        state[:size], state[size:] = packed, xi
        return state[None], False
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
    elif X is not identity:
        X = admitted(group, X, "X0").X
    size = packed_size(group)
    states = np.empty((count, size + n))
    states[:, :size], states[:, size:] = packed_elements(group, X), xi
    return states, True


def split_states(group: MatrixGroup, states: Array) -> tuple[Array, Array]:
    """X (..., d, d) and xi (..., n) of packed states (..., m)."""
    size = packed_size(group)
    return elements_of(group, states[..., :size]), copied(states[..., size : size + group.dim])
