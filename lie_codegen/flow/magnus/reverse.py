"""Reverse derivatives of a Magnus flow: from a covector of X(T) back to the values of u, at the cost of a few steps."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow.magnus.library import MagnusLibrary, magnus_library
from lie_codegen.flow.magnus.numpy_steps import expm1
from lie_codegen.flow.magnus.tangents import PROJECTION, TangentAlgebra
from lie_codegen.groups.matrix_group import MatrixGroup

#: Steps that are held at once.
_BLOCK = 65_536


def pullback(group: MatrixGroup, values: Array, lengths: Array, covector: Array) -> Array:
    """What a covector of the end is on the values of u at the nodes of every step.

    With X(T) the product of the steps of order 8 and d X = X hat(eta): Re tr(C^H hat(eta)) = sum of slopes * d values, exactly of what
    is computed.

    Args:
        group: the group.
        values: (steps, 6, n) u at the Gauss nodes of every step.
        lengths: (steps,) h.
        covector: (d, d) C.

    Returns:
        (steps, 6, n).
    """
    library, C = magnus_library(group), _skew_part(group, covector)
    parts = []
    for end in range(len(lengths), 0, -_BLOCK):
        part = slice(max(0, end - _BLOCK), end)
        v, h = np.ascontiguousarray(values[part]), np.ascontiguousarray(lengths[part])
        slopes, C = _by_numpy(group, v, h, C) if library is None else _by_lanes(library, v, h, C)
        parts.append(slopes)
    return np.concatenate(parts[::-1])


def _skew_part(group: MatrixGroup, C: Array) -> Array:
    """On a group of unitary matrices a covector sees the skew-Hermitian part alone; on a real group the real one."""
    matrix = np.asarray(C, dtype=complex) if group.is_complex else np.asarray(C).real.astype(float)
    return np.asarray((matrix - matrix.conj().T) / 2 if _is_unitary(group) else matrix)


@lru_cache(maxsize=32)
def _is_unitary(group: MatrixGroup) -> bool:
    basis = np.asarray(group.basis)
    return bool(np.all(basis == -np.conj(np.swapaxes(basis, 1, 2))))


def _moved(C: Array, X: Array) -> Array:
    """The covector before X of a covector after it: Re tr(C^H X^-1 hat(x) X) for all x; of several X at once."""
    star = np.swapaxes(X, -1, -2).conj()
    return np.asarray(np.linalg.solve(star, C @ star))


def _by_lanes(library: MagnusLibrary, values: Array, lengths: Array, C: Array) -> tuple[Array, Array]:
    products = library.lane_products(values, lengths, PROJECTION)
    # what follows each run, and last all of them: the covectors after the runs and before the first come from one solve
    following = np.empty((len(products) + 1, *C.shape), products.dtype)
    following[-1] = np.eye(len(C))
    for lane in range(len(products), 0, -1):
        np.matmul(products[lane - 1], following[lane], out=following[lane - 1])
    covectors = _moved(C, following)
    return library.pullback(values, lengths, PROJECTION, covectors[1:]), covectors[0]


def _by_numpy(group: MatrixGroup, values: Array, lengths: Array, C: Array) -> tuple[Array, Array]:
    """The same without a compiler: the flow of the tangent group over each step, along each generator."""
    steps, n = len(values), group.dim
    double, d = TangentAlgebra(group), group.degree
    a = lengths[:, None, None] * np.einsum("jg,kgi->kji", PROJECTION, values)
    along = np.eye(4 * n).reshape(4 * n, 4, n)
    slopes = np.empty((steps, 4 * n))
    for k in range(steps - 1, -1, -1):
        both = np.concatenate([np.broadcast_to(a[k], (4 * n, 4, n)), along], axis=-1)
        move = expm1(double.hat(double.exponent(both)))
        X, dX = move[0, :d, :d] + np.eye(d), move[:, :d, d:]
        slopes[k] = np.einsum("ij,pij->p", np.conj(C), np.linalg.solve(X, dX)).real
        C = _moved(C, X)
    on_a = slopes.reshape(steps, 4, n)
    return lengths[:, None, None] * np.einsum("jg,kji->kgi", PROJECTION, on_a), C
