"""The Euler characteristic of a group, by which a list of critical points is found complete or not."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from lie_codegen.control.error_samples import basis_scales
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.structure import structure


@lru_cache(maxsize=64)
def euler_characteristic(group: MatrixGroup) -> int | None:
    """chi of the group: 0 where it holds a circle, 1 where it is contractible; None where neither is seen.

    A group is homotopic to its maximal compact subgroup. A turning basis element with commensurable frequencies closes to a circle; a linear
    semisimple group has a compact subgroup of positive dimension; where all hat(x) have real eigenvalues exp is a diffeomorphism.
    """
    for matrix in group.basis:
        values, vectors = np.linalg.eig(matrix)
        turns = np.abs(values.imag)
        size = float(np.max(turns))
        if size > 1e-9 and np.max(np.abs(values.real)) < 1e-9 * size and np.linalg.cond(vectors) < 1e8:
            ratios = turns[turns > 1e-9 * size] / np.min(turns[turns > 1e-9 * size])
            if np.max(np.abs(ratios * 12 - np.round(ratios * 12))) < 1e-6:
                return 0
    if structure(group).killing.det() != 0:
        return 0
    rng = np.random.default_rng(0)
    generic = np.linalg.eigvals(group.hat(rng.normal(size=(8, group.dim)) * basis_scales(group)))
    return 1 if np.max(np.abs(generic.imag)) < 1e-3 * (1 + np.max(np.abs(generic.real))) else None
