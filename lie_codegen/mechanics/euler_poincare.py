"""Euler-Poincare equations on any Lie group, exact: I xi' = ad*_xi I xi + f (10).

On SO(3) they are Euler's equations I omega' = I omega x omega + tau; printed (3) of Geyer's paper, I omega' - omega
x I omega = tau, has the other sign, which conserves energy and |I omega| as well: only the spatial momentum R I
omega tells them apart. On SE(3) with I = diag(J, M) they are Kirchhoff's equations (27). Bullo and Murray, CIT-CDS
97-003, section 2.3.
"""

from __future__ import annotations

from collections.abc import Sequence

from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.kernel.brackets import ad_star
from lie_codegen.kernel.exact_arithmetic import ExactArithmetic
from lie_codegen.on_demand import sympy as sp

EXACT = ExactArithmetic()


def velocity_symbols(algebra: LieAlgebra) -> tuple[sp.Symbol, ...]:
    """xi1 .. xin."""
    return tuple(sp.Symbol(f"xi{i + 1}", real=True) for i in range(algebra.dim))


def euler_poincare(
    algebra: LieAlgebra, inertia: sp.MatrixBase, xi: Sequence[sp.Expr], force: Sequence[sp.Expr] | None = None
) -> list[sp.Expr]:
    """xi' = I^{-1} (ad*_xi I xi + f), expanded."""
    momentum = list(inertia * sp.Matrix(list(xi)))
    total = ad_star(EXACT, algebra, xi, momentum)
    if force is not None:
        total = [a + b for a, b in zip(total, force, strict=True)]
    return [sp.expand(entry) for entry in inertia.inv() * sp.Matrix(total)]
