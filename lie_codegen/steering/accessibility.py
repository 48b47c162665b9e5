"""What controls reach with the help of a drift where their brackets alone do not fill the algebra; numeric.

The system X' = X hat(b + u) is accessible if and only if the brackets of b and the controls fill the algebra, and controllable
in long enough time on a compact group (Jurdjevic and Sussmann, J. Differential Equations 12 (1972) 313).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from lie_codegen.algebra.brackets import bracket
from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.arrays import Array

Product = Callable[[Array, Array], Array]

_RANK = 1e-9


def with_drift(algebra: LieAlgebra, controls: Sequence[int], drift: Array) -> int:
    """Dimension of what the brackets of the controls and the drift fill."""
    start = np.vstack([np.eye(algebra.dim)[list(controls)], drift])
    return len(closure(independent(start), partial(bracket, algebra), independent))


def closure(rows: Array, product: Product, span: Callable[[Array], Array]) -> Array:
    """Orthonormal rows that span what products of the rows, of products ..., fill; `span` makes rows orthonormal."""
    while len(rows) < rows.shape[1]:
        more = span(np.vstack([rows, *(product(x, y) for x in rows for y in rows)]))
        if len(more) == len(rows):
            break
        rows = more
    return rows


def independent(rows: Array) -> Array:
    """Orthonormal rows of the same span."""
    _, sizes, directions = np.linalg.svd(rows, full_matrices=False)
    return np.asarray(directions[sizes > _RANK * max(1.0, sizes[0])])
