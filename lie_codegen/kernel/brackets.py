"""[x, y], ad_x, ad*_x and what is made of them over any arithmetic; plain zeros stay plain.

The same for arrays of doubles are in `algebra/brackets.py`; exact and sparse, `LieAlgebra.bracket`.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.linear import Matrix, Vector, dot, identity, number, plus, scaled, transpose
from lie_codegen.kernel.structural_zeros import add, product

#: B_2k / (2k)! for k = 1 .. 6. For |ad Theta| <= 1 the next term is 3e-11 of the first.
BERNOULLI = (
    Fraction(1, 12),
    Fraction(-1, 720),
    Fraction(1, 30240),
    Fraction(-1, 1209600),
    Fraction(1, 47900160),
    Fraction(-691, 1307674368000),
)


def bracket(ops: Arithmetic, algebra: LieAlgebra, x: Sequence[Scalar], y: Sequence[Scalar]) -> Vector:
    """[x, y] = ad_x y."""
    result: Vector = [0] * algebra.dim
    for (i, j), row in algebra.table.items():
        value = add(product(x[i], y[j]), product(-1, product(x[j], y[i])))
        for k, c in row.items():
            result[k] = add(result[k], product(number(ops, c), value))
    return result


def ad(ops: Arithmetic, algebra: LieAlgebra, x: Sequence[Scalar]) -> Matrix:
    """(n, n) the matrix of ad_x: column j is [x, A_j]."""
    return transpose([bracket(ops, algebra, x, unit) for unit in identity(algebra.dim)])


def ad_star(ops: Arithmetic, algebra: LieAlgebra, x: Sequence[Scalar], a: Sequence[Scalar]) -> Vector:
    """ad*_x a, the transpose of the matrix of ad_x: <ad*_x a, y> = <a, [x, y]>."""
    result: Vector = [0] * algebra.dim
    for (i, j), row in algebra.table.items():
        paired = dot([number(ops, c) for c in row.values()], [a[k] for k in row])  # <a, [A_i, A_j]>
        result[j] = add(result[j], product(x[i], paired))
        result[i] = add(result[i], product(-1, product(x[j], paired)))
    return result


def bracket_form(ops: Arithmetic, algebra: LieAlgebra, a: Sequence[Scalar]) -> Matrix:
    """(n, n) the matrix of (x, y) -> <a, [x, y]>: row i is ad*_{A_i} a."""
    return [ad_star(ops, algebra, unit, a) for unit in identity(algebra.dim)]


def dexp_inverse(
    ops: Arithmetic, algebra: LieAlgebra, theta: Sequence[Scalar], v: Sequence[Scalar], terms: int = 1
) -> Vector:
    """Theta' of X = X_0 exp(Theta), X' = X hat(v): v + [Theta, v]/2 + sum_k B_2k/(2k)! ad_Theta^2k v, k = 1 .. terms.

    The sign of the first bracket is that of X' = X hat(v). One term is what steps of fourth order need.
    """
    once = bracket(ops, algebra, theta, v)
    total, power = plus(v, scaled(ops.constant(Fraction(1, 2)), once)), once
    for k, coefficient in enumerate(BERNOULLI[:terms]):
        power = bracket(ops, algebra, theta, power)
        if k:
            power = bracket(ops, algebra, theta, power)
        total = plus(total, scaled(ops.constant(coefficient), power))
    return total
