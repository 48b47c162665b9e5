"""The torques of a plan, from its 2n numbers (xi_d, nu): windows, amplitudes, mean forces.

Profile X_d = exp(s(x) xi_d), x = t/T, s' = 140 x^3 (1-x)^3, so that the wanted acceleration

    eta = s''/T^2 xi_d + (s'/T)^2 <xi_d : xi_d>/2 + (s'/T) J^-1 D xi_d + (30/T) (x (1-x))^2 nu

is divisible by z^2, z = x (1-x). With c = z^2 c_hat the amplitudes p = P z and q = -2 c / p = -2 c_hat z / P are smooth where c changes sign (p = q = sqrt(2 |c|) has an
infinite slope there), and vanish at both ends with what they integrate to: no offset is left.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.mechanics.virtual_actuation import VirtualActuation
from lie_codegen.values import Value

_GRID = 201
#: Least amplitude of a pair that nothing is asked of at first, relative to the others: the retuning may need it.
_LEAST = 1e-3


@dataclass(frozen=True, eq=False, repr=False)
class Oscillation(Value):
    """u(t) = u^a(t) b_a, (k,) times -> (k, n): plain data.

    Attributes:
        body: forces and inertia.
        duration: T.
        cycles: N, those of the pair that oscillates slowest.
        balance: (pairs,) P.
        numbers: (2n,) xi_d and nu.
    """

    body: VirtualActuation
    duration: float
    cycles: float
    balance: Array
    numbers: Array

    @cached_property
    def multiples(self) -> Array:
        """1, 3, 5, .. for the pairs."""
        return 2 * np.arange(len(self.body.pairs)) + 1

    def wanted(self, x: Array) -> Array:
        """(k, n) eta / z^2."""
        return wanted(self.body, self.numbers, x, self.duration)

    def parts(self, t: Array) -> tuple[Array, Array, Array]:
        """v (k, m), U (k, m) and dU/dt (k, m)."""
        m, T = len(self.body.forces), self.duration
        x = t / T
        z, slope = x * (1 - x), (1 - 2 * x) / T
        eta = self.wanted(x)
        split = eta @ self.body.decomposition.T
        v, c_hat = z[:, None] ** 2 * split[:, :m], split[:, m:]
        c_hat_dot = wanted_slope(self.body, self.numbers, x, T) @ self.body.decomposition.T[:, m:] / T
        U, rate = np.zeros_like(v), np.zeros_like(v)
        for i, (a, b) in enumerate(self.body.pairs):
            angle = 2 * np.pi * self.cycles * self.multiples[i] * x
            turning = 2 * np.pi * self.cycles * self.multiples[i] / T
            P = self.balance[i]
            p, q = P * z, -2 * c_hat[:, i] * z / P
            p_dot, q_dot = P * slope, -2 * (c_hat_dot[:, i] * z + c_hat[:, i] * slope) / P
            # mean U_a U_b = p q / 2 = -c pushes by c <Y_a : Y_b>, as wanted; mean U_a^2 = p^2 / 2 pushes by -p^2/4 <Y_a : Y_a>, which v takes back
            for force, size, size_dot in ((a, p, p_dot), (b, q, q_dot)):
                U[:, force] += size * np.sin(angle)
                rate[:, force] += size_dot * np.sin(angle) + size * turning * np.cos(angle)
                v += size[:, None] ** 2 / 4 * self.body.compensation[force]
        return v, U, rate

    def __call__(self, t: Array) -> Array:
        """(k,) times -> (k, n) torques and forces."""
        v, _, rate = self.parts(t)
        return np.asarray((v + rate) @ self.body.forces)


def wanted(body: VirtualActuation, numbers: Array, x: Array, T: float) -> Array:
    """(k, n) eta / z^2."""
    n = body.group.dim
    xi, nu = numbers[:n], numbers[n:]
    z = (x * (1 - x))[:, None]
    drag = body.inverse @ body.damping @ xi
    turned = body.product(xi, xi) / 2
    return np.asarray(
        420 * (1 - 2 * x[:, None]) / T**2 * xi + (140 / T) ** 2 * z**4 * turned + 140 / T * z * drag + 30 / T * nu
    )


def wanted_slope(body: VirtualActuation, numbers: Array, x: Array, T: float) -> Array:
    """d/dx of the same."""
    xi = numbers[: body.group.dim]
    z, slope = (x * (1 - x))[:, None], (1 - 2 * x)[:, None]
    drag = body.inverse @ body.damping @ xi
    turned = body.product(xi, xi) / 2
    return np.asarray(
        -840 / T**2 * np.ones_like(z) * xi + (140 / T) ** 2 * 4 * z**3 * slope * turned + 140 / T * slope * drag
    )


def balanced(body: VirtualActuation, numbers: Array, T: float) -> Array:
    """(pairs,) P with P^2 = 2 rms(c_hat) on a uniform grid: p and q are then of one size."""
    x = np.linspace(0, 1, _GRID)
    m = len(body.forces)
    c_hat = wanted(body, numbers, x, T) @ body.decomposition.T[:, m:]
    size = np.sqrt(np.mean(c_hat**2, axis=0))
    least = _LEAST * float(np.abs(c_hat).max(initial=0.0))
    return np.asarray(np.sqrt(2 * np.maximum(size, max(least, 1e-9 / T**2))))
