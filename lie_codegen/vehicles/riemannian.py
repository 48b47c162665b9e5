"""The Levi-Civita connection in coordinates, exact: Christoffel symbols (5), covariant derivatives (6), (7),
equations of motion.

nabla_q' q' = M^{-1}(F - dV); (9) is printed with + dV, under which energy is not conserved. Bullo and Murray, CIT-CDS 97-003,
section 2.2.
"""

from __future__ import annotations

from collections.abc import Sequence

from lie_codegen.errors import ShapeError
from lie_codegen.on_demand import sympy as sp


def christoffel(M: sp.MatrixBase, q: Sequence[sp.Symbol]) -> tuple[sp.ImmutableMatrix, ...]:
    """(n) matrices G[k] with G[k][i, j] = M^{mk} (d_i M_mj + d_j M_mi - d_m M_ij)/2.

    Raises:
        ShapeError: M is not (n, n) for n coordinates.
    """
    n = _size(M, q)
    inverse = M.inv()
    first = first_kind(M, q)
    return tuple(
        sp.ImmutableMatrix(
            n, n, lambda i, j, k=k: sp.simplify(sum((inverse[k, m] * first[m][i, j] for m in range(n)), sp.S.Zero))
        )
        for k in range(n)
    )


def first_kind(M: sp.MatrixBase, q: Sequence[sp.Symbol]) -> tuple[sp.ImmutableMatrix, ...]:
    """(n) matrices [ij, m] = (d_i M_mj + d_j M_mi - d_m M_ij)/2, without the inverse of M."""
    n = _size(M, q)
    return tuple(
        sp.ImmutableMatrix(
            n, n, lambda i, j, m=m: (sp.diff(M[m, j], q[i]) + sp.diff(M[m, i], q[j]) - sp.diff(M[i, j], q[m])) / 2
        )
        for m in range(n)
    )


def coriolis(M: sp.MatrixBase, q: Sequence[sp.Symbol], velocity: Sequence[sp.Expr]) -> sp.ImmutableMatrix:
    """C(q, v) with C[m, j] = [ij, m] v_i: M q'' + C(q, q') q' + dV = F, and M' - 2 C is antisymmetric."""
    n = _size(M, q)
    symbols = first_kind(M, q)
    return sp.ImmutableMatrix(
        n, n, lambda m, j: sp.expand(sum((symbols[m][i, j] * velocity[i] for i in range(n)), sp.S.Zero))
    )


def covariant_derivative(
    gamma: Sequence[sp.MatrixBase], q: Sequence[sp.Symbol], X: Sequence[sp.Expr], Y: Sequence[sp.Expr]
) -> list[sp.Expr]:
    """(nabla_X Y)^k = d_j Y^k X^j + G[k][i, j] X^i Y^j (6)."""
    n = len(q)
    return [
        sum((sp.diff(Y[k], q[j]) * X[j] for j in range(n)), sp.S.Zero)
        + sum((gamma[k][i, j] * X[i] * Y[j] for i in range(n) for j in range(n)), sp.S.Zero)
        for k in range(n)
    ]


def covariant_derivative_of_form(
    gamma: Sequence[sp.MatrixBase], q: Sequence[sp.Symbol], X: Sequence[sp.Expr], w: Sequence[sp.Expr]
) -> list[sp.Expr]:
    """(nabla_X w)_i = d_j w_i X^j - G[k][i, j] w_k X^j (7)."""
    n = len(q)
    return [
        sum((sp.diff(w[i], q[j]) * X[j] for j in range(n)), sp.S.Zero)
        - sum((gamma[k][i, j] * w[k] * X[j] for k in range(n) for j in range(n)), sp.S.Zero)
        for i in range(n)
    ]


def acceleration(
    M: sp.MatrixBase,
    q: Sequence[sp.Symbol],
    velocity: Sequence[sp.Expr],
    force: Sequence[sp.Expr],
    potential: sp.Expr | int = 0,
) -> list[sp.Expr]:
    """q'' of M q'' + C q' + dV = F."""
    bias = coriolis(M, q, velocity) * sp.Matrix(list(velocity)) + sp.Matrix([sp.diff(potential, x) for x in q])
    return list(M.inv() * (sp.Matrix(list(force)) - bias))


def _size(M: sp.MatrixBase, q: Sequence[sp.Symbol]) -> int:
    if M.shape != (len(q), len(q)):
        raise ShapeError(f"the inertia is {M.rows} x {M.cols}; {len(q)} coordinates need {len(q)} x {len(q)}")
    return len(q)
