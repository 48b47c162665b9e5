"""The unit sphere S^n in R^{n+1}: projection, covariant derivative (4), and the pair of Lemma 3.3 on every S^n.

phi = 1 - q.r,  T r' = (q.r) r' - (q.r') r = ((q.r) 1 - r q') r';  on S^2, T = (q.r) 1 + (r x q)^.
phi is quadratic with constant 2: |d phi|^2 = (1 + q.r) phi, so b_1 >= 1/eps and b_2 <= 1/2 (printed the other way
round). Lemma 5.1 prints T r' = q x (r x r') and carries that sign through F_PD and F_FF: at q = r the printed
velocity error is twice r'. Bullo and Murray, CIT-CDS 97-003, sections 3.3 and 5.1.
"""

from __future__ import annotations

from collections.abc import Sequence

from lie_codegen.on_demand import sympy as sp


def projection(q: Sequence[sp.Expr]) -> sp.Matrix:
    """pi_q = 1 - q q', onto the tangent space at q."""
    column = sp.Matrix(list(q))
    return sp.eye(len(q)) - column * column.T


def transport(q: Sequence[sp.Expr], r: Sequence[sp.Expr]) -> sp.Matrix:
    """T = (q.r) 1 - r q', from T_r S^n to T_q S^n."""
    a, b = sp.Matrix(list(q)), sp.Matrix(list(r))
    return a.dot(b) * sp.eye(len(q)) - b * a.T


def covariant_derivative(field: Sequence[sp.Expr], q: Sequence[sp.Symbol], velocity: Sequence[sp.Expr]) -> sp.Matrix:
    """nabla_v Y = pi_q (DY v) for a field Y(q) given in R^{n+1} (4)."""
    change = sp.Matrix([sum((sp.diff(f, x) * v for x, v in zip(q, velocity, strict=True)), sp.S.Zero) for f in field])
    return projection(q) * change


def feedforward(
    q: Sequence[sp.Expr],
    q_dot: Sequence[sp.Expr],
    r: Sequence[sp.Expr],
    r_dot: Sequence[sp.Expr],
    r_ddot: Sequence[sp.Expr],
) -> sp.Matrix:
    """F_FF = (nabla_{q'} T) r' + d/dt at q fixed = pi_q d/dt (T r'), exact, for any n."""
    a, v, b, w, c = (sp.Matrix(list(x)) for x in (q, q_dot, r, r_dot, r_ddot))
    change = v.dot(b) * w + a.dot(b) * c - (v.dot(w) + a.dot(c)) * b
    return projection(q) * change
