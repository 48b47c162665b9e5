"""The constants of Theorem 4.2 on a level, from samples: b_1, b_2 (A1), the bound h of the Hessian, the bound t of the transport.

    b_1 = sup phi/|d phi|^2,  b_2 = inf phi/|d phi|^2,   |d phi|^2 = d phi^T I^-1 d phi            (A1), dual norm
    h   = sup |H - d phi . nabla|_I,  (d phi . nabla)_ab = d phi(nabla_a e_b)
    t   = sup |nabla_Z X|_I over unit X, Z, which bounds the derivative of the transport: (nabla_X T) r' = nabla_nu X - ...

At the reference the quotient is 0/0 and depends on the direction: phi/|d phi|^2 -> x^T S x/(2 x^T S I^-1 S x), between 1/(2 mu_max) and
1/(2 mu_min), mu the eigenvalues of I^-1 S. Bullo and Murray, CIT-CDS 97-003, (A1), (B2), Theorem 4.2.
"""

from __future__ import annotations

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.control.level_search import LevelSearch, Places
from lie_codegen.exact.counts import seeded
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.on_demand import scipy


class Metric:
    """An inertia with its inverse, its connection and what feedforwards do with it.

    Attributes:
        I, inverse, root: (n, n), the last lower triangular with root root^T = I.
        bracket: (n, n, n), [e_a, e_b] = bracket[a, b].
        nabla: (n, n, n), nabla_a e_b = nabla[a, b]  (8).
    """

    def __init__(self, group: MatrixGroup, inertia: Array) -> None:
        self.I = inertia
        self.inverse = np.linalg.inv(inertia)
        self.root = np.linalg.cholesky(inertia)
        self.bracket = np.asarray(group.algebra.structure_constants, dtype=float)
        # ad*_a I e_b, component c: <I e_b, [e_a, e_c]>
        coadjoint = np.einsum("acd,db->abc", self.bracket, inertia)
        self.coadjoint = coadjoint
        symmetric = coadjoint + np.swapaxes(coadjoint, 0, 1)
        lowered = (np.einsum("abd,dc->abc", self.bracket, inertia) - symmetric) / 2
        self.nabla = lowered @ self.inverse

    def norm(self, matrices: Array) -> Array:
        """(N,) largest |x^T M x| over |x|_I = 1, for symmetric (N, n, n)."""
        half = np.linalg.solve(self.root, matrices)
        whole = np.linalg.solve(self.root, np.swapaxes(half, -1, -2))
        return np.asarray(np.max(np.abs(np.linalg.eigvalsh((whole + np.swapaxes(whole, -1, -2)) / 2)), axis=-1))

    def turning(self, starts: int = 24, seed: int = 0) -> float:
        """t = sup |nabla_Z X|_I: of the trilinear form <nabla_Z X, Y> over unit vectors, by turns, each exact given the others."""
        # T[z, x, y] in orthonormal coordinates: e = root^-T f
        frame = np.linalg.inv(self.root).T
        T = np.einsum("abc,cd,ai,bj,dk->ijk", self.nabla, self.I, frame, frame, frame)
        rng, best = seeded(seed, "certificate"), 0.0
        for _ in range(starts):
            z, x = rng.normal(size=(2, len(self.I)))
            value = 0.0
            for _ in range(200):
                # the best of one vector, the others held, is the contraction itself: no turn makes the value smaller
                y = np.einsum("ijk,i,j->k", T, z, x)
                y /= max(1e-300, np.linalg.norm(y))
                x = np.einsum("ijk,i,k->j", T, z, y)
                x /= max(1e-300, np.linalg.norm(x))
                z = np.einsum("ijk,j,k->i", T, x, y)
                size = float(np.linalg.norm(z))
                z /= max(1e-300, size)
                if size - value <= 1e-14 * size:
                    break
                value = size
            best = max(best, size)
        return best


def quadratic_bounds(search: LevelSearch, metric: Metric, stiffness: Array) -> tuple[float, float]:
    """b_1 and b_2 on the level."""
    limits = scipy.linalg.eigh(stiffness, metric.I, eigvals_only=True)

    def ratio(places: Places) -> Array:
        phi, slope = search.samples.first(places.X, places.X_d)
        with np.errstate(all="ignore"):
            return np.asarray(phi / np.einsum("na,ab,nb->n", slope, metric.inverse, slope))

    upper = max(1 / (2 * limits[0]), search.extreme(ratio, largest=True))
    lower = min(1 / (2 * limits[-1]), search.extreme(ratio))
    return float(upper), float(lower)


def hessian_bound(search: LevelSearch, metric: Metric) -> float:
    """h on the level."""

    def size(places: Places) -> Array:
        found = search.samples.at(places.X, places.X_d)
        M = found.hessian - np.einsum("abc,nc->nab", metric.nabla, found.slope)
        return metric.norm((M + np.swapaxes(M, 1, 2)) / 2)

    return search.extreme(size, largest=True)
