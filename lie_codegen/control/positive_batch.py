"""Inverses of many small symmetric positive definite matrices at once, entry by entry over all of them.

LAPACK is called matrix by matrix, which for 10,000 of 3 x 3 takes ten times as long as the arithmetic.
"""

from __future__ import annotations

from itertools import combinations_with_replacement
from math import prod

import numpy as np

from lie_codegen.arrays import Array

#: Eigenvalues of a symmetric matrix are found to some roundings of its trace: one larger than this part of it is seen to be positive.
_CLEAR = 1e-11


def clear_inverses(matrices: Array) -> Array | None:
    """(N, n, n) inverses of (N, n, n) matrices that are symmetric to the last bit and clearly positive definite.

    None where one of them is not, which is no verdict: it may be positive definite, but its eigenvalues have to be found.
    """
    n = matrices.shape[-1]
    by_entry = np.ascontiguousarray(np.moveaxis(matrices, 0, -1))
    if not np.array_equal(by_entry, by_entry.swapaxes(0, 1)):
        return None
    a = {(i, j): by_entry[i, j].copy() for i, j in combinations_with_replacement(range(n), 2)}
    trace = sum(a[i, i] for i in range(n))
    pivots = []
    with np.errstate(all="ignore"):
        for k in range(n):  # the sweep of row k: behind the last, -A^-1; every pivot is a quotient of leading minors
            pivot = a[k, k]
            pivots.append(pivot)
            part = 1 / pivot
            others = [i for i in range(n) if i != k]
            column = {i: a[min(i, k), max(i, k)] for i in others}
            shared = {i: column[i] * part for i in others}
            for i, j in combinations_with_replacement(others, 2):
                a[i, j] = a[i, j] - column[i] * shared[j]
            for i in others:
                a[min(i, k), max(i, k)] = shared[i]
            a[k, k] = -part
        # the least eigenvalue is at least det A ((n - 1) / trace)^(n - 1): the others have no larger product than their mean to the n - 1
        least = prod(pivots) * ((n - 1) / trace) ** (n - 1) if n > 1 else trace
        clear = np.all(np.array(pivots) > 0, axis=0) & (least > _CLEAR * trace) & np.isfinite(least)
    if not np.all(clear):
        return None
    inverses = np.empty(matrices.shape)
    for (i, j), entries in a.items():
        np.negative(entries, out=inverses[:, i, j])
        if i != j:
            inverses[:, j, i] = inverses[:, i, j]
    return inverses
