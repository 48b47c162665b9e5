"""States as the solver stores them: the varying entries of X, complex ones as (re, im), then the other states."""

from __future__ import annotations

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.groups.maps.element_pattern import varying_entries
from lie_codegen.steering.ocp.problem_data import ProblemData


def pack_element(data: ProblemData, X: Array) -> Array:
    """The varying entries of an element, complex ones as re, im."""
    rows, columns = np.array(varying_entries(data.group)).T
    entries = np.ascontiguousarray(X[rows, columns])
    return entries.astype(complex).view(float) if data.group.is_complex else entries.real.astype(float)


def unpack_elements(data: ProblemData, x: Array) -> tuple[Array, Array]:
    """(k, d, d) elements and (k, q) other states of (k, stored) states."""
    group = data.group
    rows, columns = np.array(varying_entries(group)).T
    size = len(rows) * (2 if group.is_complex else 1)
    entries = np.ascontiguousarray(x[:, :size])
    X = np.tile(np.eye(group.degree, dtype=complex if group.is_complex else float), (len(x), 1, 1))
    X[:, rows, columns] = entries.view(complex) if group.is_complex else entries
    return X, np.ascontiguousarray(x[:, size:])
