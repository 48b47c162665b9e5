"""Structure constants of rational matrices that are orthogonal to each other, by inner products of whole numbers.

With <A, B> = Re tr(A^H B) and <A_i, A_j> = 0 for i != j, [A_i, A_j] = sum_k <A_k, [A_i, A_j]> / <A_k, A_k> A_k if and only if the squared
norms of both sides agree (Bessel's inequality is an equality inside the span alone). Unitary bases, Pauli strings among them,
are of this kind; elimination takes a hundred times as long.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import combinations
from math import lcm
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.exact.numbers import Number
from lie_codegen.on_demand import sympy as sp

#: Sums of products of that many bits stay exact in 64.
_BITS = 62

Table = dict[tuple[int, int], dict[int, Number]]


def orthogonal_table(matrices: Sequence[sp.ImmutableMatrix], columns: Sequence[Sequence[Number]]) -> Table | None:
    """(i, j) -> {k: c[i, j, k]}; None where the matrices are not rational, not orthogonal, not closed, or their numbers large.

    Args:
        matrices: (n) d x d.
        columns: their entries, real parts and imaginary parts in turn.
    """
    if not all(value.is_Rational for column in columns for value in column):
        return None
    scale = lcm(*(int(value.q) for column in columns for value in column))
    whole = [[int(value * scale) for value in column] for column in columns]
    n, d = len(matrices), int(matrices[0].rows)
    largest = max((abs(value) for column in whole for value in column), default=0)
    # entries of a commutator: 2 d products of complex numbers, twice; their inner products, and squares of those
    if (16 * d * max(largest, 1) ** 2) ** 2 * 2 * d * d >= 2**_BITS:
        return None
    parts = np.array(whole, dtype=np.int64).reshape(n, d, d, 2)
    flat = parts.reshape(n, -1)
    gram = flat @ flat.T
    norms = np.diag(gram)
    if np.any(gram != np.diag(norms)) or np.any(norms == 0):
        return None
    table: Table = {}
    for i, j in combinations(range(n), 2):
        commutator = (_product(parts[i], parts[j]) - _product(parts[j], parts[i])).ravel()
        if not np.any(commutator):
            continue
        overlaps = flat @ commutator
        inside = np.flatnonzero(overlaps)
        spanned = sum((Fraction(int(overlaps[k]) ** 2, int(norms[k])) for k in inside), Fraction(0))
        if spanned != int(commutator @ commutator):
            return None
        # A = whole / scale, so that a commutator of whole matrices carries scale^2 and its coordinates one scale too many
        table[i, j] = {int(k): sp.Rational(int(overlaps[k]), int(norms[k]) * scale) for k in inside}
    return table


def _product(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """Product of (d, d, 2) complex whole matrices."""
    real = a[..., 0] @ b[..., 0] - a[..., 1] @ b[..., 1]
    return np.stack([real, a[..., 0] @ b[..., 1] + a[..., 1] @ b[..., 0]], axis=-1)
