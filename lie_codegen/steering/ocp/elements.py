"""States as the solver stores them: the varying entries of X, complex ones as (re, im), then the other states."""

from __future__ import annotations

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.groups.maps.element_pattern import packed_size
from lie_codegen.groups.maps.packed_arrays import elements_of, packed_elements
from lie_codegen.steering.ocp.problem_data import ProblemData


def pack_element(data: ProblemData, X: Array) -> Array:
    """The varying entries of an element, complex ones as re, im."""
    return packed_elements(data.group, X if data.group.is_complex else X.real)


def unpack_elements(data: ProblemData, x: Array) -> tuple[Array, Array]:
    """(k, d, d) elements and (k, q) other states of (k, stored) states."""
    size = packed_size(data.group)
    return elements_of(data.group, x[:, :size]), np.ascontiguousarray(x[:, size:])
