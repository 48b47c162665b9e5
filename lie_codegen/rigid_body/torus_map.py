"""From osculating to mean H and D on the torus (phi, alpha hat): a Fourier series of the rates, divided by its frequencies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import gcd
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array

NODES = 24
_ORDERS = np.fft.fftfreq(NODES, 1 / NODES)
_N1, _N2 = _ORDERS[:, None], _ORDERS[None, :]
#: Divisors below this part of the smaller frequency are dropped, and listed.
SMALLEST_DIVISOR = 0.02
#: Resonances looked for: |n1| of the phase, |n2| of the precession.
LARGEST = (12, 4)


@dataclass(frozen=True)
class TorusSeries:
    """Rates of (H, D) on the torus as a Fourier series.

    Attributes:
        waves: (NODES, NODES, 4) coefficients, first index of phi.
        rate, m: Lambda [1/s] and the mean precession [rad/s].
        torque: the largest |N| met [N m].
    """

    waves: Any
    rate: float
    m: float
    torque: float

    def correction(self, phi: float, alpha: float) -> Array:
        """W (4,) at a point, osculating = mean + W."""
        divisor, small = _divisors(self.rate, self.m)
        # a wave is integrated by its frequency; the outermost, NODES/2, stands for both of its signs, which have two, and is left out
        kept = ~small & (np.abs(_N1) < NODES / 2) & (np.abs(_N2) < NODES / 2)
        factor = np.zeros_like(divisor, dtype=complex)
        factor[kept] = np.exp(1j * (2 * np.pi * _N1 * phi + _N2 * alpha))[kept] / (1j * divisor[kept])
        return np.asarray(np.real(np.einsum("ij,ijk->k", factor, self.waves)))

    def harmonic(self, n1: int, n2: int) -> float:
        """|coefficient (n1, n2) of H'| over |mean of H'|; infinite where the mean is 0."""
        mean = float(np.linalg.norm(self.waves[0, 0, :3].real))
        size = float(np.linalg.norm(self.waves[n1 % NODES, n2 % NODES, :3]))
        return 2 * size / mean if mean > 0 else float("inf") if size > 0 else 0.0


def torus_series(sample: Callable[[Array, Array], tuple[Array, Array]], rate: float, m: float, b: Array) -> TorusSeries:
    """The series of `sample(phi, alpha) -> (rates (.., 4), N (.., 3))`; alpha = alpha hat + sum b_n sin(4 pi n phi)."""
    phi, hat = np.meshgrid(np.arange(NODES) / NODES, 2 * np.pi * np.arange(NODES) / NODES, indexing="ij")
    orders = np.arange(1, len(b) + 1)
    alpha = hat + np.sin(4 * np.pi * phi[..., None] * orders) @ b
    rates, torque = sample(phi, alpha)
    waves = np.fft.fft2(rates, axes=(0, 1)) / NODES**2
    return TorusSeries(waves, rate, m, float(np.linalg.norm(torque, axis=-1).max()))


def small_divisors(rate: float, m: float) -> list[tuple[int, int]]:
    """The (n1, n2) that the periodic part leaves out."""
    _, small = _divisors(rate, m)
    return [(int(_ORDERS[i]), int(_ORDERS[j])) for i, j in zip(*small.nonzero(), strict=True) if i or j]


def _divisors(rate: float, m: float) -> tuple[Array, NDArray[np.bool_]]:
    """n1 2 pi Lambda + n2 m, and where it is too small to divide by, (0, 0) among them."""
    divisor = 2 * np.pi * rate * _N1 + m * _N2
    return divisor, np.abs(divisor) < SMALLEST_DIVISOR * min(2 * np.pi * abs(rate), abs(m))


@cache
def resonant_ratios() -> tuple[tuple[int, int], ...]:
    """Coprime (n1, n2), n2 > 0, n1 of either sign."""
    most1, most2 = LARGEST
    signed = range(-most1, most1 + 1)
    pairs = ((n1, n2) for n2 in range(1, most2 + 1) for n1 in signed)
    return tuple((n1, n2) for n1, n2 in pairs if n1 and gcd(n1, n2) == 1)
