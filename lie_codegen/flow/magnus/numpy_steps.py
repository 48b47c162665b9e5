"""The same Magnus steps by numpy: where there is no compiler, and for single steps at scattered times.

Signs are those of X' = X A: the printed right-invariant formulas with c(a, b) = -[a, b].
"""

from __future__ import annotations

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow.magnus.drive import Drive
from lie_codegen.flow.magnus.exponent import eighth_order, reversed_bracket, sixth_order
from lie_codegen.flow.magnus.steps import Steps
from lie_codegen.groups.matrix_group import MatrixGroup

#: Gauss-Legendre nodes in a step: enough for the moments of one radian of a sine to rounding.
_NODES, _WEIGHTS = (each / 2 for each in np.polynomial.legendre.leggauss(10))
#: From values at the nodes to generators over h: alpha = T^-1 B of the moments B_0 .. B_3, T_ij = int s^(i + j) ds.
_MOMENTS = np.array([_WEIGHTS * _NODES**i for i in range(4)])
_GRAM = np.array([[(0 if (i + j) % 2 else 1 / ((i + j + 1) * 2.0 ** (i + j))) for j in range(4)] for i in range(4)])
PROJECTION = np.linalg.solve(_GRAM, _MOMENTS)
_BLOCK = 4096


def generators(drive: Drive, moments: Array, lengths: Array) -> Array:
    """(..., k, 4, n) the generators a_1 .. a_4 of steps that begin at `moments`, each within one piece of u."""
    u = drive.values(moments, lengths, _NODES + 0.5)
    return np.asarray(lengths[:, None, None] * np.einsum("jg,...gi->...ji", PROJECTION, u))


def exponent(group: MatrixGroup, a: Array, order: int) -> Array:
    """(..., n) Omega of generators (..., 4, n), to order 4, 6 or 8.

    Order 8 is Blanes, Casas and Ros, BIT 40 (2000) 434; from moments of four orders, a_2 of three is a_2 + 3 a_4 / 20.
    """
    c = reversed_bracket(group.algebra)
    a1, a2, a3, a4 = (a[..., j, :] for j in range(4))
    if order == 8:
        return eighth_order(c, a1, a2, a3, a4)
    b = a2 + 3 * a4 / 20
    return np.asarray(a1 + a3 / 12 - c(a1, b) / 12) if order == 4 else sixth_order(c, a1, b, a3)


def expm1(A: Array) -> Array:
    """exp(A) - 1 of (..., d, d): Taylor of degree 18 of A / 2^k, squared k times as (1 + D)^2 - 1 = D^2 + 2 D."""
    size = float(np.max(np.linalg.norm(A, axis=(-2, -1)), initial=0.0))
    halvings = max(0, int(np.ceil(np.log2(size)))) if size > 1 else 0
    A = A / 2**halvings
    D = A / 18
    for k in range(17, 0, -1):
        D = (A + A @ D) / k
    for _ in range(halvings):
        D = 2 * D + D @ D
    return np.asarray(D)


def increments(group: MatrixGroup, drive: Drive, order: int, moments: Array, lengths: Array) -> Array:
    """(..., k, d, d) exp(Omega) - 1 of single steps within one piece of u each."""
    return expm1(group.hat(exponent(group, generators(drive, moments, lengths), order)))


def flow(group: MatrixGroup, drive: Drive, steps: Steps, order: int, X0: Array) -> Array:
    """X at the slots: (slots, d, d), or (slots, N, d, d); as the compiled loops."""
    moments, lengths = steps.moments
    ends = np.full(steps.count, -1)
    ends[steps.first[1:] - 1] = steps.slot
    state, kept = X0, {}
    for begin in range(0, steps.count, _BLOCK):
        part = slice(begin, begin + _BLOCK)
        D = increments(group, drive, order, moments[part], lengths[part])
        for k, slot in enumerate(ends[part]):
            state = state + state @ D[..., k, :, :]
            if slot >= 0:
                kept[int(slot)] = state
    return np.stack([kept[slot] for slot in range(steps.slots)])
