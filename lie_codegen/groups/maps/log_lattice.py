"""Every logarithm of X looked through, where the principal one is not in the algebra.

Each logarithm lies in z = ker(Ad_X - 1). A random h of z has a centraliser T in z; where h is elliptic enough, T is abelian, and in the Schur basis of a
generic element of T all of T and X are triangular: weights W (imaginary parts of the diagonals of a basis of T) and angles theta of X, one of each a
joint eigenspace. Every c with Im W c = theta modulo 2 pi gives y = T c such that X exp(-hat y) has a positive spectrum, and so
    x = y + log(X exp(-hat y)),
the last a principal logarithm far from every cut. Of all c the one with the smallest sum of squares of W c is taken; the certificate decides.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np

from lie_codegen.algebra.brackets import ad
from lie_codegen.arrays import Array
from lie_codegen.groups.maps.log_iterations import matrix_log
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.on_demand import scipy

#: Random elements of z tried, logarithms found before the search ends, and turns on either side.
TRIES, ENOUGH, TURNS = 30, 3, 2
#: Singular values (of 1) that count as zero, weights that count as zero, and how well angles must fit.
NULL, WEIGHT, FIT = 1e-7, 1e-7, 1e-5


def lattice_log(group: MatrixGroup, X: Array, certified: Callable[[Array], bool]) -> Array | None:
    """A logarithm of X with the least sum of squares of turning angles; None where none is found.

    Args:
        certified: whether x is a logarithm, mended in place.
    """
    Ad = np.array([group.project(X @ A @ np.linalg.inv(X)) for A in group.basis]).T
    z = _null(Ad - np.eye(group.dim))
    best: tuple[float, Array] | None = None
    found = 0
    seed = 1
    for _ in range(TRIES):
        if not z.size or found == ENOUGH:
            break
        weights, seed = random_numbers(z.shape[1], seed)
        T = z @ _null(ad(group.algebra, z @ weights) @ z)
        weights, seed = random_numbers(T.shape[1], seed)
        cost_y = _turned(group, X, T, T @ weights)
        if cost_y is None:
            continue
        cost, y = cost_y
        A = matrix_log(X @ scipy.linalg.expm(-group.hat(y)))
        x = y + group.project(A)
        if certified(x):
            found += 1
            if best is None or cost < best[0] - 1e-6:
                best = cost, x
    return None if best is None else best[1]


def random_numbers(count: int, seed: int) -> tuple[Array, int]:
    """Numbers in (-1, 1) of a fixed sequence, the same as in C."""
    values = []
    for _ in range(count):
        seed = (seed * 1103515245 + 12345) % 2**31
        values.append(seed / 2**30 - 1)
    return np.array(values), seed


def _null(matrix: Array) -> Array:
    """Columns that span the kernel."""
    _, values, rows = np.linalg.svd(matrix)
    values = np.append(values, np.zeros(len(rows) - len(values)))
    return np.asarray(rows[values <= NULL * max(1.0, float(values[0]))].T)


def _turned(group: MatrixGroup, X: Array, T: Array, generic: Array) -> tuple[float, Array] | None:
    """The y of T with the angles of X, and the sum of squares of its own."""
    eigenvalues, Q = scipy.linalg.schur(group.hat(generic).astype(complex), output="complex")
    mu = np.diag(eigenvalues)
    W = np.array([np.diag(Q.conj().T @ group.hat(t) @ Q).imag for t in T.T]).T
    xi = np.diag(Q.conj().T @ X @ Q)
    scale = max(1.0, float(np.max(np.abs(mu))))
    groups: list[list[int]] = []
    for j in range(len(mu)):
        same = next((g for g in groups if abs(mu[g[0]] - mu[j]) < 1e-6 * scale), None)
        groups.append([j]) if same is None else same.append(j)
    W = np.array([np.mean(W[g], axis=0) for g in groups])
    theta = np.array([np.angle(np.sum(xi[g])) for g in groups])
    size = np.array([len(g) for g in groups])
    rows: list[int] = []
    for r in np.argsort(np.linalg.norm(W, axis=1), kind="stable"):
        if np.linalg.norm(W[r]) > WEIGHT and np.linalg.matrix_rank(W[[*rows, r]], tol=1e-6) > len(rows):
            rows.append(int(r))
    if not rows:
        return None
    solve = np.linalg.pinv(W[rows])
    turns = range(-TURNS, TURNS + 1) if len(rows) <= 5 else range(-1, 2)
    best: tuple[float, Array] | None = None
    for m in product(turns, repeat=len(rows)):
        c = solve @ (theta[rows] + 2 * np.pi * np.array(m))
        angles = W @ c
        off = angles - theta
        if np.max(np.abs(off - 2 * np.pi * np.round(off / (2 * np.pi)))) > FIT:
            continue
        cost = float(np.sum(size * angles**2))
        if best is None or cost < best[0] - 1e-9:
            best = cost, T @ c
    return best
