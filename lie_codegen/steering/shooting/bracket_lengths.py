"""How many brackets each direction takes: the filtration of the algebra by its controls."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lie_codegen.groups.matrix_group import MatrixGroup

_RANK = 1e-9


def bracket_lengths(group: MatrixGroup, controls: Sequence[int]) -> tuple[int, ...]:
    """For each basis element the least l such that brackets of at most l controls span it; 1 for controls.

    Under controls of size r the directions of length l move like r^l (the ball-box theorem).
    """
    c, n = group.algebra.structure_constants, group.dim
    span = np.eye(n)[list(controls)]
    lengths = np.full(n, n)
    for length in range(1, n + 1):
        _, sizes, right = np.linalg.svd(span)
        inside = right[: int(np.sum(sizes > _RANK * sizes[0]))]
        outside = np.linalg.norm(np.eye(n) - inside.T @ inside, axis=1)
        lengths = np.where(outside < _RANK, np.minimum(lengths, length), lengths)
        if len(inside) == n:
            break
        span = np.vstack([inside, *(np.einsum("k,skj->sj", row, c[list(controls)]) for row in inside)])
    return tuple(int(length) for length in lengths)
