"""[x, y], ad_x and ad*_x of coordinates as arrays of doubles, with any leading shape.

The same three over any arithmetic are in `kernel/brackets.py`; exact and sparse, `LieAlgebra.bracket`.
"""

from __future__ import annotations

import numpy as np

from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.arrays import Array


def bracket(algebra: LieAlgebra, x: Array, y: Array) -> Array:
    """[x, y] = sum_ijk x_i y_j c_ijk A_k: (..., n) and (..., n) -> (..., n)."""
    n = algebra.dim
    # one product of matrices for the whole batch: einsum of three operands is a plain loop
    outer = x[..., :, None] * y[..., None, :]
    constants = algebra.structure_constants.reshape(n * n, n)
    return np.asarray(outer.reshape(*outer.shape[:-2], n * n) @ constants)


def ad(algebra: LieAlgebra, x: Array) -> Array:
    """The matrices of [x, .]: (..., n) -> (..., n, n)."""
    n = algebra.dim
    return np.asarray((x @ algebra.ad_matrices.reshape(n, n * n)).reshape(*np.shape(x)[:-1], n, n))


def ad_star(algebra: LieAlgebra, x: Array, a: Array) -> Array:
    """ad*_x a, <ad*_x a, y> = <a, [x, y]>: (..., n) and (..., n) -> (..., n)."""
    return np.asarray((a[..., None, :] @ ad(algebra, x))[..., 0, :])


def dexp_inverse(algebra: LieAlgebra, theta: Array, v: Array) -> Array:
    """v + [theta, v]/2 + [theta, [theta, v]]/12, Theta' of X = X_0 exp(Theta), X' = X hat(v), as steps of fourth order need it."""
    once = bracket(algebra, theta, v)
    return np.asarray(v + once / 2 + bracket(algebra, theta, once) / 12)


def symmetric_product(algebra: LieAlgebra, inertia: Array, inverse: Array, x: Array, y: Array) -> Array:
    """<x : y> = -J^-1 (ad*_x J y + ad*_y J x): (n,) and (n,) -> (n,), J and its inverse (n, n)."""
    return np.asarray(-inverse @ (ad_star(algebra, x, inertia @ y) + ad_star(algebra, y, inertia @ x)))
