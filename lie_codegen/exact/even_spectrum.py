"""Families A(x) whose eigenvalues come as +-lambda_1, .., +-lambda_r, each equally often, and zero.

so(n), so(p, q), sp(n) and ad of the semisimple algebras are such families. The nonzero mu_i = lambda_i^2 follow from
traces, sum_i mu_i^k = tr A^{2k} / m with m the multiplicity of each as an eigenvalue of A^2.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from lie_codegen.exact.modular import modular_images, random_point
from lie_codegen.on_demand import sympy as sp

_POINTS = 2

_Rows = list[list[int]]


@dataclass(frozen=True)
class EvenSpectrum:
    """The product of (A^2 - mu_i) over i < pairs, times A^2 if has_zero, vanishes for every x.

    Attributes:
        pairs: r.
        multiplicity: m.
        has_zero: whether zero is an eigenvalue for every x.
        zero_is_defective: whether A times the product over i < pairs does not vanish: A^2 is needed for the eigenvalue zero,
            as in se(3), where a screw has a Jordan block.
    """

    pairs: int
    multiplicity: int
    has_zero: bool
    zero_is_defective: bool = False


def even_spectrum(matrices: Sequence[sp.MatrixBase], most_pairs: int = 6) -> EvenSpectrum | None:
    """The spectrum with the fewest pairs, or None; tested at seeded random points modulo a prime near 2^61."""
    size = int(matrices[0].rows)
    images = modular_images([entry for m in matrices for entry in m.flat()])
    if images is None:
        return None
    prime, flat = images
    points = [_at(flat, size, prime, random_point(random.Random(k), prime, len(matrices))) for k in range(_POINTS)]
    squares = [(A, _product(A, A, prime)) for A in points]
    for pairs in range(1, min(size // 2, most_pairs) + 1):
        for multiplicity in range(2, size // pairs + 1, 2):
            has_zero = pairs * multiplicity < size
            products = [_remaining(B, pairs, multiplicity, prime) for _, B in squares]
            cases = list(zip(squares, products, strict=True))
            if has_zero and all(_is_zero(_product(total, B, prime)) for (_, B), total in cases):
                defective = not all(_is_zero(_product(total, A, prime)) for (A, _), total in cases)
                return EvenSpectrum(pairs, multiplicity, True, defective)
            if not has_zero and all(_is_zero(total) for total in products):
                return EvenSpectrum(pairs, multiplicity, False)
    return None


def _at(flat: list[int], size: int, prime: int, x: list[int]) -> _Rows:
    A = [[0] * size for _ in range(size)]
    for place, value in enumerate(flat):
        if value:
            k, (i, j) = place // size**2, divmod(place % size**2, size)
            A[i][j] = (A[i][j] + x[k] * value) % prime
    return A


def _remaining(B: _Rows, pairs: int, multiplicity: int, prime: int) -> _Rows:
    """The product of (B - mu_i) over i < pairs, with the mu_i that the traces of B would give."""
    powers = [B]
    while len(powers) < pairs:
        powers.append(_product(powers[-1], B, prime))
    share = pow(multiplicity, -1, prime)
    sums = [sum(P[i][i] for i in range(len(B))) * share % prime for P in powers]
    coefficients = newton_coefficients(sums, lambda total, k: total * pow(k, -1, prime) % prime)
    size = len(B)
    total = [[int(i == j) for j in range(size)] for i in range(size)]
    for value in reversed(coefficients):
        total = _product(total, B, prime)
        for i in range(size):
            total[i][i] = (total[i][i] + value) % prime
    return total


def _is_zero(rows: _Rows) -> bool:
    return not any(entry for row in rows for entry in row)


def newton_coefficients(
    sums: Sequence[Any], divide: Callable[[Any, int], Any] = lambda total, k: total / k
) -> list[Any]:
    """c with prod (t - mu_i) = t^r + c_{r-1} t^{r-1} + .. + c_0, lowest first, from the power sums.

    Newton's identities, k c_{r-k} = -(s_k + c_{r-1} s_{k-1} + .. + c_{r-k+1} s_1); zeros that are plain integers stay so.
    """
    upper: list[Any] = []
    for k in range(1, len(sums) + 1):
        total = sums[k - 1]
        for i in range(1, k):
            if not (_plain_zero(upper[i - 1]) or _plain_zero(sums[k - i - 1])):
                term = upper[i - 1] * sums[k - i - 1]
                total = term if _plain_zero(total) else total + term
        upper.append(0 if _plain_zero(total) else divide(-total, k))
    return upper[::-1]


def _plain_zero(value: Any) -> bool:
    return isinstance(value, int) and value == 0


def _product(a: _Rows, b: _Rows, prime: int) -> _Rows:
    columns = list(zip(*b, strict=True))
    return [[sum(x * y for x, y in zip(row, column, strict=True)) % prime for column in columns] for row in a]
