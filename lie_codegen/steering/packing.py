"""Elements of a group as the doubles that vary."""

from __future__ import annotations

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.groups.maps.element_pattern import varying_entries
from lie_codegen.groups.matrix_group import MatrixGroup


def pack_element(group: MatrixGroup, X: Array) -> Array:
    """The varying entries of X, row by row, complex ones as (re, im)."""
    entries = np.array([X[i, j] for i, j in varying_entries(group)], dtype=complex if group.is_complex else float)
    return np.ascontiguousarray(entries).view(float)
