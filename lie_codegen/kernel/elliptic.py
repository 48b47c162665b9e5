"""Jacobi's elliptic functions over any arithmetic: the Gauss (descending Landen) ladder, fixed depth, no branch.

    k' = sqrt((1 - k)(1 + k)),   k_1 = (k / (1 + k'))^2,   k_1' = 2 sqrt(k') / (1 + k'),
    K(k) = (1 + k_1) K(k_1),     sn(u, k) = (1 + k_1) s D, cn = c d D, dn = (1 - k_1 s^2) D, D = 1 / (1 + k_1 s^2),

with (s, c, d) the functions of modulus k_1 at u / (1 + k_1). After seven steps the modulus is below rounding
for k <= 0.999999 and (s, c, d) = (sin, cos, 1) of 2 pi phi. The phase phi = u / (4 K(k)), of period 1, is the
argument, not u: no derivative in k then grows with time.
Whittaker and Watson, Modern Analysis, 22.42; the recursion of the Zeta function is derived in `jacobi`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from lie_codegen.kernel.arithmetic import Arithmetic, Scalar

#: Steps of the ladder: k_7 < 1e-17 for every k <= 0.999999.
DEPTH = 7
#: Beyond it 1 - k loses the digits that k'^2 needs, and the ladder its depth.
LARGEST_MODULUS = 0.999999


class Jacobi(NamedTuple):
    """sn, cn, dn and z = Zeta / k^2, regular at k = 0."""

    sn: Scalar
    cn: Scalar
    dn: Scalar
    z: Scalar


@dataclass(frozen=True)
class Ladder:
    """The descending moduli of one k, shared by every phase.

    Attributes:
        k, complement: the modulus and k' = sqrt(1 - k^2).
        moduli: (k_1, ..., k_N).
        factors: 1 / (1 + k_n')^2 for n = 0 .. N - 1, so that k_{n+1} = k_n^2 factors[n].
        K: the complete integral of the first kind, period / 4.
        S: the mean of sn^2 over a period, (1 - E / K) / k^2 without cancellation.
    """

    k: Scalar
    complement: Scalar
    moduli: tuple[Scalar, ...]
    factors: tuple[Scalar, ...]
    K: Scalar
    S: Scalar

    @property
    def E(self) -> Scalar:
        """The complete integral of the second kind, K (1 - k^2 S)."""
        return self.K * (1 - self.k * self.k * self.S)


def half_pi(ops: Arithmetic) -> Scalar:
    """pi / 2 in this arithmetic."""
    return 2 * ops.atan(ops.constant(1))


def ladder(ops: Arithmetic, k: Scalar, depth: int = DEPTH) -> Ladder:
    """The moduli below k and what follows from them alone.

    S = 1/2 + sum_n 2^(n-1) a_n^2 k_n (k_n / k^2) with a_n = prod_{j<=n} 1 / (1 + k_j).
    """
    complement = first = ops.sqrt((1 - k) * (1 + k))
    moduli: list[Scalar] = []
    factors: list[Scalar] = []
    product, mean, ratio, modulus = 1, ops.constant(1) / 2, 1, k
    for n in range(1, depth + 1):
        inverse = 1 / (1 + complement)
        factor = inverse * inverse
        # k_n / k^2: from k_1 / k^2 = factor, then k_n = k_{n-1}^2 factor
        ratio = factor if n == 1 else ratio * modulus * factor
        modulus = modulus * modulus * factor
        complement = 2 * ops.sqrt(complement) * inverse
        product = product * (1 + modulus)
        mean = mean + 2 ** (n - 1) * modulus * ratio / (product * product)
        moduli.append(modulus)
        factors.append(factor)
    return Ladder(k, first, tuple(moduli), tuple(factors), half_pi(ops) * product, mean)


def jacobi(ops: Arithmetic, phi: Scalar, steps: Ladder) -> Jacobi:
    """sn, cn, dn and z = Zeta / k^2 at u = 4 K phi.

    With Z_n of modulus k_n, Z_n = 2 / (1 + k_{n+1}) (Z_{n+1} + k_{n+1} s c d D); divided by k_n^2,
    z_n = 2 factors[n] / (1 + k_{n+1}) (k_{n+1} z_{n+1} + s c d D).
    """
    theta = 4 * half_pi(ops) * phi
    s, c, d, z = ops.sin(theta), ops.cos(theta), 1, 0
    for modulus, factor in zip(reversed(steps.moduli), reversed(steps.factors), strict=True):
        square = modulus * s * s
        inverse = 1 / (1 + square)
        z = 2 * factor / (1 + modulus) * (modulus * z + s * c * d * inverse)
        s, c, d = (1 + modulus) * s * inverse, c * d * inverse, (1 - square) * inverse
    return Jacobi(s, c, d, z)


def sn_cn_dn(ops: Arithmetic, phi: Scalar, moduli: Sequence[Scalar]) -> tuple[Scalar, Scalar, Scalar]:
    """The three functions from the moduli of a ladder alone, for loops over phases that share it."""
    theta = 4 * half_pi(ops) * phi
    s, c, d = ops.sin(theta), ops.cos(theta), 1
    for modulus in reversed(moduli):
        square = modulus * s * s
        inverse = 1 / (1 + square)
        s, c, d = (1 + modulus) * s * inverse, c * d * inverse, (1 - square) * inverse
    return s, c, d


def phase(ops: Arithmetic, a: Scalar, b: Scalar, dn: Scalar, steps: Ladder) -> Scalar:
    """phi in (-1/2, 1/2] with sn : cn = a : b and the given dn: the ladder walked down, then one atan2.

    From k_1 s^2 = (1 - dn) / (1 + dn) the step down multiplies sn by 2 / ((1 + dn)(1 + k_1)) and cn by
    2 / ((1 + dn) d) with d^2 = ((1 - k_1) + dn (1 + k_1)) / (1 + dn): linear in a and in b, hence no scale is
    needed and k = 0 gives the plain angle.
    """
    for modulus in steps.moduli:
        below = ops.sqrt(((1 - modulus) + dn * (1 + modulus)) / (1 + dn))
        a, b, dn = a * below, b * (1 + modulus), below
    return ops.atan2(a, b) / (4 * half_pi(ops))


def jacobi_derivatives(steps: Ladder, at: Jacobi) -> tuple[Sequence[Scalar], Sequence[Scalar]]:
    """Derivatives of (sn, cn, dn, Zeta) in phi at fixed k and in k at fixed phi; every entry regular at k = 0.

    d/dphi: 4 K (cn dn, -sn dn, -k^2 sn cn, dn^2 - E / K).
    d/dk:   k / k'^2 (cn w, -sn w, sn (k^2 cn z - sn dn), k'^2 z + dn w) with w = sn cn - z dn.
    """
    sn, cn, dn, z = at
    k, period = steps.k, 4 * steps.K
    square = k * k
    w = sn * cn - z * dn
    scale = k / (steps.complement * steps.complement)
    by_phi = (period * cn * dn, -period * sn * dn, -period * square * sn * cn, period * square * (steps.S - sn * sn))
    by_k = (scale * cn * w, -scale * sn * w, scale * sn * (square * cn * z - sn * dn), k * z + scale * dn * w)
    return by_phi, by_k


def nome(k: float) -> float:
    """q = exp(-pi K(k') / K(k)), which measures how fast Fourier series of elliptic functions converge."""
    if k <= 0:
        return 0.0
    return math.exp(-math.pi * _agm(1.0, math.sqrt((1 - k) * (1 + k))) / _agm(1.0, k))


def _agm(a: float, b: float) -> float:
    for _ in range(40):
        a, b = (a + b) / 2, math.sqrt(a * b)
    return a
