"""How large u makes hat(u): what the length of a Magnus step goes by."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.groups.matrix_group import MatrixGroup


def gram_of(group: MatrixGroup) -> Array:
    """x' G x = |hat(x)|^2, Frobenius."""
    flat = np.asarray(group.basis).reshape(group.dim, -1)
    return np.ascontiguousarray((flat @ np.conj(flat.T)).real)


@lru_cache(maxsize=32)
def norms_of(group: MatrixGroup) -> Array:
    """(n + 1, n): the rows of `gram_of`, then |A_i|_2 of the basis."""
    spectral = np.linalg.norm(np.asarray(group.basis), 2, axis=(1, 2))
    norms = np.ascontiguousarray(np.vstack([gram_of(group), spectral]))
    norms.setflags(write=False)
    return norms


def size_of(norms: Array, vectors: Array) -> Array:
    """(...) bounds of |hat(x)|_2 of (..., n): the Frobenius norm, or the sum of those of its terms, whichever is less."""
    square = np.sum((vectors @ norms[:-1]) * vectors, axis=-1)
    return np.asarray(np.minimum(np.sqrt(np.maximum(square, 0.0)), np.abs(vectors) @ norms[-1]))
