"""Exact derivatives of a Magnus flow in the parameters of its input."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow.magnus.exponent import eighth_order, reversed_bracket
from lie_codegen.flow.magnus.library import magnus_library
from lie_codegen.flow.magnus.numpy_steps import expm1
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.signals.parametric_input import ParametricInput

#: Gauss-Legendre: the moments of two waves' worth of h^11 beyond the order of the steps.
NODES, _WEIGHTS = (each / 2 for each in np.polynomial.legendre.leggauss(6))
#: From the values of u at the nodes the cubic in s, from -1/2 to 1/2, with u's own first four moments; integrals of s^(i + j) are _GRAM.
_GRAM = np.array([[(0 if (i + j) % 2 else 1 / ((i + j + 1) * 2.0 ** (i + j))) for j in range(4)] for i in range(4)])
PROJECTION = np.ascontiguousarray(np.linalg.solve(_GRAM, np.array([_WEIGHTS * NODES**i for i in range(4)])))
#: Values of u and of its derivatives that are held at once.
_MOST_VALUES = 2**22


def tangents(
    group: MatrixGroup, u: ParametricInput, parameters: Mapping[str, float], length: float, steps: int
) -> Array:
    """(m, d, d) dX/dp over [0, length], by at least so many equal steps of order 8 that do not straddle a breakpoint."""
    ends = np.array([0.0, *(b for b in u.breakpoints if 0 < b < length), length])
    m = len(u.parameters)
    most = max(1, _MOST_VALUES // (len(NODES) * group.dim * (m + 1)))
    kind = complex if group.is_complex else float
    X, dX = np.eye(group.degree, dtype=kind), np.zeros((m, group.degree, group.degree), kind)
    for a, b in pairwise(ends):
        count = max(1, int(np.ceil(steps * (b - a) / length * (1 - 1e-12))))
        # no step straddles a breakpoint, where the order would be lost; blocks keep the values that are held at once within memory
        blocks = -(-count // most)
        for k in range(blocks):
            left, right = a + (b - a) * k / blocks, a + (b - a) * (k + 1) / blocks
            Y, dY = _piece(group, u, parameters, left, right, -(-count // blocks))
            dX, X = dX @ Y + X @ dY, X @ Y
    return dX


def _piece(
    group: MatrixGroup, u: ParametricInput, parameters: Mapping[str, float], left: float, right: float, count: int
) -> tuple[Array, Array]:
    h = (right - left) / count
    t = (left + h * (np.arange(count)[:, None] + 0.5 + NODES)).ravel()
    n, m, nodes = group.dim, len(u.parameters), len(NODES)
    values = u(t, **parameters).reshape(count, nodes, n)
    slopes = np.ascontiguousarray(u.derivatives(t, **parameters).reshape(count, nodes, m, n))
    library = magnus_library(group)
    if library is not None:
        return library.tangents(np.ascontiguousarray(values), slopes, PROJECTION, right - left)
    return _by_doubling(
        group, h * np.einsum("jg,kgi->kji", PROJECTION, values), h * np.einsum("jg,kgpi->kpji", PROJECTION, slopes)
    )


def _by_doubling(group: MatrixGroup, a: Array, da: Array) -> tuple[Array, Array]:
    """The same without a compiler: the flow of the tangent group, of matrices [[X, dX], [0, X]]."""
    double = TangentAlgebra(group)
    count, m = da.shape[:2]
    d, kind = group.degree, complex if group.is_complex else float
    state = np.broadcast_to(np.eye(2 * d, dtype=kind), (m, 2 * d, 2 * d)).copy()
    for k in range(count):
        both = np.concatenate([np.broadcast_to(a[k], (m, *a[k].shape)), da[k]], axis=-1)
        state = state + state @ expm1(double.hat(double.exponent(both)))
    X = state[0, :d, :d] if m else np.eye(d, dtype=kind)
    return X, state[:, :d, d:]


class TangentAlgebra:
    """Pairs (x, dx) with [(x, dx), (y, dy)] = ([x, y], [x, dy] + [dx, y])."""

    def __init__(self, group: MatrixGroup) -> None:
        self.group = group

    def exponent(self, a: Array) -> Array:
        """Omega of order 8 and its derivative."""
        return eighth_order(self._reversed, *np.moveaxis(a, -2, 0))

    def _reversed(self, x: Array, y: Array) -> Array:
        n, c = self.group.dim, reversed_bracket(self.group.algebra)
        first, second = x[..., :n], y[..., :n]
        return np.concatenate([c(first, second), c(first, y[..., n:]) + c(x[..., n:], second)], axis=-1)

    def hat(self, x: Array) -> Array:
        """[[hat(x), hat(dx)], [0, hat(x)]]."""
        n = self.group.dim
        A, dA = self.group.hat(x[..., :n]), self.group.hat(x[..., n:])
        return np.concatenate([np.concatenate([A, dA], -1), np.concatenate([np.zeros_like(A), A], -1)], -2)
