"""Areas and moments of area of the loops that the primitives of an input trace.

    Area_ij = 1/2 int_0^T (ut_i u_j - ut_j u_i) dt,   m_ijk = 1/3 int_0^T (ut_i u_j - ut_j u_i) ut_k dt,

ut = int_0^t u. Area_ij is the projected area of TR 93-59, (21); m_ijk is the first moment of that area about the
starting point of the loop, and with zero mean the third-order rate is sum_{i<j,k} m_ijk [A_k, [A_i, A_j]] / T. Both are
brackets in an auxiliary nilpotent algebra, so they cost no arithmetic of their own.
"""

from __future__ import annotations

from itertools import combinations

from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.on_demand import sympy as sp
from lie_codegen.signals.periodic_reader import PeriodicLike, as_periodic


def areas(u: PeriodicLike) -> sp.ImmutableMatrix:
    """Area_ij = 1/2 int_0^T (ut_i u_j - ut_j u_i) dt, ut = int_0^t u: the area of the loop, projected on the plane (i, j); TR 93-59, (21).

    Args:
        u: n components of period T, or a list of their formulas.

    Returns:
        (n, n), antisymmetric; exact where the input is. [u unit^2 time unit^2]

    Raises:
        InputError: u is no `PeriodicInput`, nor formulas of one.
    """
    u = as_periodic(u, "areas")
    n = u.dim
    pairs = list(combinations(range(n), 2))
    brackets = {pair: {n + p: sp.S.One} for p, pair in enumerate(pairs)}
    dim = n + len(pairs)
    calculus, signal = u.waveform.calculus(brackets, dim)
    wedge = calculus.bracket(calculus.primitive(signal), signal)
    total = u.waveform.integral(calculus, wedge, dim)
    matrix = sp.zeros(n, n)
    for p, (i, j) in enumerate(pairs):
        value = sp.expand(total[n + p] / (2 * u.waveform.omega**2))
        matrix[i, j], matrix[j, i] = value, -value
    return sp.ImmutableMatrix(matrix)


def moments(u: PeriodicLike) -> sp.ImmutableDenseNDimArray:
    """m_ijk = 1/3 int_0^T (ut_i u_j - ut_j u_i) ut_k dt, ut = int_0^t u: the first moments of the areas, of the third-order rate (area-moment rule).

    Args:
        u: n components of period T, or a list of their formulas.

    Returns:
        (n, n, n), antisymmetric in i and j; exact where the input is. [u unit^3 time unit^3]

    Raises:
        InputError: u is no `PeriodicInput`, nor formulas of one.
    """
    u = as_periodic(u, "moments")
    n = u.dim
    pairs = list(combinations(range(n), 2))
    dim = n + len(pairs)
    first = {pair: {n + p: sp.S.One} for p, pair in enumerate(pairs)}
    second = {(k, n + p): {k * len(pairs) + p: sp.S.One} for k in range(n) for p in range(len(pairs))}
    calculus, signal = u.waveform.calculus(first, dim)
    primitive = calculus.primitive(signal)
    wedge = calculus.bracket(primitive, signal)
    size = max(dim, n * len(pairs))
    calculus, _ = u.waveform.calculus(second, size)
    total = u.waveform.integral(calculus, calculus.bracket(primitive, wedge), size)
    flat = [sp.S.Zero] * n**3
    for p, (i, j) in enumerate(pairs):
        for k in range(n):
            value = sp.expand(total[k * len(pairs) + p] / (3 * u.waveform.omega**3))
            flat[(i * n + j) * n + k], flat[(j * n + i) * n + k] = value, -value
    return sp.ImmutableDenseNDimArray(flat, (n, n, n))


def area_rate(algebra: LieAlgebra, area: sp.ImmutableMatrix, period: sp.Expr) -> sp.ImmutableMatrix:
    """(n, 1) sum_{i<j} Area_ij Gamma_ij^k / T: the second-order rate, TR 93-59, (25)."""
    rate = sp.zeros(algebra.dim, 1)
    for (i, j), row in algebra.table.items():
        for k, c in row.items():
            rate[k] += area[i, j] * c / period
    return sp.ImmutableMatrix(rate.applyfunc(sp.expand))


def moment_rate(algebra: LieAlgebra, moment: sp.ImmutableDenseNDimArray, period: sp.Expr) -> sp.ImmutableMatrix:
    """(n, 1) sum_{i<j} sum_k m_ijk [A_k, [A_i, A_j]] / T: the third-order rate of an input with zero mean."""
    rate = sp.zeros(algebra.dim, 1)
    for (i, j), row in algebra.table.items():
        for k in range(algebra.dim):
            for m, c in algebra.bracket({k: sp.S.One}, row).items():
                rate[m] += moment[i, j, k] * c / period
    return sp.ImmutableMatrix(rate.applyfunc(sp.expand))
