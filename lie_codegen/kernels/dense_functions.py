"""exp, log and the Jacobian of exp for a full matrix, where no closed form is known: fixed depth, no branches.

exp: Taylor polynomial of degree 16 at A / 2^4, squared four times: 1e-15 relative up to |A| = 11 (any norm), after Al-Mohy and
Higham, SIAM J. Matrix Anal. Appl. 31 (2009) 970, without their choice of the degree.

log: four square roots by the product form of the Denman-Beavers iteration, then the [7/7] Pade approximant as a sum of
partial fractions, after Cheng, Higham, Kenney and Laub, SIAM J. Matrix Anal. Appl. 22 (2001) 1112. Right to rounding for
eigenvalues e^(a + i b) with |a| <= 4 and |b| <= 3; beyond, digits are lost towards the cut at b = pi.

Jacobian: (e^{ad x} - 1)/ad x = Ad(H) int_{-1/2}^{1/2} Ad(exp(s A)) ds with H = exp(A/2), by Gauss-Legendre quadrature with 12
nodes: 1e-15 relative for eigenvalues of ad x below 9 in modulus.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from math import factorial

from lie_codegen.kernels.arithmetic import Arithmetic, Scalar
from lie_codegen.kernels.block_solve import add, is_zero, product
from lie_codegen.kernels.linear import Matrix, identity, matadd, matmul, scaled
from lie_codegen.kernels.small_inverse import inverse

_DEGREE = 16
_SQUARINGS = 4
_ROOT_STEPS = (10, 6, 5, 5)
_PADE = 7
#: Gauss-Legendre nodes, in pairs +-s.
_PAIRS = 6
_EVEN_DEGREE = 19


def exponential(ops: Arithmetic, A: Matrix) -> Matrix:
    """exp(A) by scaling and squaring."""
    scale = ops.constant(Fraction(1, 2**_SQUARINGS))
    small = [scaled(scale, row) for row in A]
    value = polynomial(ops, [Fraction(1, factorial(k)) for k in range(_DEGREE + 1)], matrix_powers(small, 4))
    for _ in range(_SQUARINGS):
        value = matmul(value, value)
    return value


def polynomial(ops: Arithmetic, coefficients: Sequence[Fraction], powers: Sequence[Matrix]) -> Matrix:
    """sum_k coefficients[k] A^k from I, A, .., A^b: Horner's rule in A^b (Paterson and Stockmeyer, 1973)."""
    block = len(powers) - 1
    chunks = [coefficients[start : start + block] for start in range(0, len(coefficients), block)]
    total = _combination(ops, chunks[-1], powers)
    for chunk in reversed(chunks[:-1]):
        total = matadd(_combination(ops, chunk, powers), matmul(powers[block], total))
    return total


def _combination(ops: Arithmetic, coefficients: Sequence[Fraction], powers: Sequence[Matrix]) -> Matrix:
    total = [scaled(_number(ops, coefficients[0]), row) for row in powers[0]]
    for value, power in zip(coefficients[1:], powers[1:], strict=False):
        total = matadd(total, power, _number(ops, value))
    return total


def _number(ops: Arithmetic, value: Fraction) -> Scalar:
    return int(value) if value.denominator == 1 else ops.constant(value)


def matrix_powers(A: Matrix, highest: int) -> list[Matrix]:
    """I, A, A^2, ..., A^highest."""
    powers = [identity(len(A)), A]
    while len(powers) <= highest:
        half = len(powers) // 2
        powers.append(matmul(powers[half], powers[len(powers) - half]))
    return powers


class EvenOddExponentials:
    """cosh(s A) and sinh(s A) for several s, from shared powers of A^2: right to rounding for |s A| <= 5."""

    def __init__(self, ops: Arithmetic, A: Matrix) -> None:
        self.ops = ops
        self.A = A
        self.powers = matrix_powers(matmul(A, A), 5)

    def cosh(self, s: Fraction) -> Matrix:
        """cosh(s A)."""
        coefficients = [s ** (2 * k) / factorial(2 * k) for k in range(_EVEN_DEGREE + 1)]
        return polynomial(self.ops, coefficients, self.powers)

    def sinh(self, s: Fraction) -> Matrix:
        """sinh(s A)."""
        coefficients = [s ** (2 * k + 1) / factorial(2 * k + 1) for k in range(_EVEN_DEGREE + 1)]
        return matmul(self.A, polynomial(self.ops, coefficients, self.powers))


def logarithm(ops: Arithmetic, X: Matrix) -> Matrix:
    """log(X) by inverse scaling and squaring."""
    root = X
    for steps in _ROOT_STEPS:
        root = _square_root(ops, root, steps)
    Z = matadd(root, identity(len(X)), -1)
    total: Matrix | None = None
    for node, weight in gauss_legendre(_PADE):
        shifted = matadd(identity(len(X)), Z, ops.constant(node))
        term = matmul(Z, inverse(ops, shifted))
        factor = ops.constant(weight * 2 ** len(_ROOT_STEPS))
        total = [scaled(factor, row) for row in term] if total is None else matadd(total, term, factor)
    return total if total is not None else Z


def _square_root(ops: Arithmetic, X: Matrix, steps: int) -> Matrix:
    """M -> (2 I + M + M^{-1}) / 4, Y -> Y (I + M^{-1}) / 2 from M = Y = X: Y tends to the principal root."""
    half, quarter = ops.constant(Fraction(1, 2)), ops.constant(Fraction(1, 4))
    eye = identity(len(X))
    M, Y = X, X
    for step in range(steps):
        M_inverse = inverse(ops, M)
        moved = [scaled(half, row) for row in matadd(eye, M_inverse)]
        Y = matmul(Y, moved)
        if step + 1 < steps:
            summed = matadd(M, M_inverse)
            M = [
                [
                    add(product(quarter, entry), half if i == j else 0) if not is_zero(entry) else half * int(i == j)
                    for j, entry in enumerate(row)
                ]
                for i, row in enumerate(summed)
            ]
    return Y


@cache
def gauss_legendre(count: int) -> tuple[tuple[Fraction, Fraction], ...]:
    """(node, weight) on [0, 1], to 40 digits."""
    import mpmath

    with mpmath.workdps(60):
        result = []
        for k in range(count):
            x = mpmath.cos(mpmath.pi * (k + mpmath.mpf(3) / 4) / (count + mpmath.mpf(1) / 2))
            for _ in range(8):
                value = mpmath.legendre(count, x)
                slope = count * (x * value - mpmath.legendre(count - 1, x)) / (x**2 - 1)
                x = x - value / slope
            weight = 2 / ((1 - x**2) * slope**2)
            result.append((Fraction(mpmath.nstr((1 - x) / 2, 45)), Fraction(mpmath.nstr(weight / 2, 45))))
    return tuple(result)


def symmetric_nodes() -> tuple[tuple[Fraction, Fraction], ...]:
    """(s, weight) with s > 0 of the even Gauss-Legendre rule on [-1/2, 1/2]; each stands for +-s."""
    nodes = [(Fraction(1, 2) - node, weight) for node, weight in gauss_legendre(2 * _PAIRS)]
    return tuple((s, weight) for s, weight in nodes if s > 0)
