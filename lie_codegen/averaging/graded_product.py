"""Eigenvalues of a product of matrices whose sizes lie apart by more than a double can tell: multipliers of strong contractions.

M = P_m ... P_1 as one matrix holds its small eigenvalues to 1e-16 of its largest only: of a relaxation oscillation, whose
second multiplier is 1e-40, it knows nothing. The factors know it. Orthogonal iteration round them,

    P_k Q_(k-1) = Q_k R_k,   Q_0 = the Q_m of the round before,

takes Q_0 to flags of invariant subspaces, each in ratio of the moduli on either side of it, and the volume of a leading
subspace grows by the diagonals of its R_k: to relative accuracy, whatever the volume is. Where moduli lie within a factor of 3
their subspace is one block, whose own product is of one size.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array

#: Moduli within this factor share a block; 40 rounds at a factor of 3 leave 1e-19 of the subspaces beside.
_APART, _ROUNDS = np.log(3.0), 40


def log_eigenvalues(factors: Sequence[Array]) -> NDArray[np.complex128]:
    """(n,) logarithms of the eigenvalues of factors[-1] ... factors[0], largest modulus first, imaginary parts in (-pi, pi]."""
    n = len(factors[0])
    if len(factors) == 1:
        return _ordered(_logarithms(factors[0]))
    # a generic start: one along the axes would never leave the invariant planes of a system in parts
    turned = np.linalg.qr(np.random.default_rng(0).normal(size=(n, n)))[0]
    for _ in range(_ROUNDS):
        first, upper = turned, []
        for factor in factors:
            turned, R = np.linalg.qr(factor @ turned)
            upper.append(R)
    closing = first.T @ turned
    with np.errstate(divide="ignore", invalid="ignore"):
        sizes = np.sum([np.log(np.abs(np.diag(R))) for R in upper], axis=0)
        cuts = [0, *(i for i in range(1, n) if sizes[:i].min() - sizes[i:].max() > _APART), n]
    blocks = [slice(a, b) for a, b in pairwise(cuts)]
    return _ordered(np.concatenate([_of_block([R[b, b] for R in upper], closing[b, b]) for b in blocks]))


def _of_block(upper: Sequence[Array], closing: Array) -> NDArray[np.complex128]:
    """Of closing @ upper[-1] ... upper[0], each divided by its size on the way."""
    product, size = np.eye(len(closing)), 0.0
    for R in upper:
        product = R @ product
        largest = float(np.abs(product).max())
        if largest == 0:
            return np.full(len(closing), -np.inf + 0j)
        product, size = product / largest, size + np.log(largest)
    return _logarithms(closing @ product) + size


def _logarithms(matrix: Array) -> NDArray[np.complex128]:
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(np.linalg.eigvals(matrix).astype(complex)))


def _ordered(logs: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """By modulus, those with the larger imaginary part first among equals."""
    values = np.exp(logs)
    return logs[np.lexsort((-values.imag, -logs.real.round(11)))]
