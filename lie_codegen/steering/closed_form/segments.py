"""The elementary manoeuvres of a chain: straight, a loop for a bracket, a figure of eight for a bracket of brackets.

With the integrals U~ = int u of a closed manoeuvre, averaging over it gives (Leonard and Krishnaprasad, TR 93-59, Corollary 2,
and its next order, the area-moment rule)

    log X(1) = 1/2 int [U~, u] + 1/3 int [U~, [U~, u]] + ...

A circle of area a in the plane of A_i, A_j moves by a [A_i, A_j]. In-phase harmonics 1 : 2, U~ = alpha sin(2 pi s) a
+ beta sin(4 pi s) b, draw a figure of eight: no area, so nothing to second order, and

    1/3 int [U~, [U~, u]] = -(pi / 2) alpha^2 beta [a, [a, b]] = M [a, [a, b]].

The energy is 2 pi^2 (alpha^2 + 4 beta^2), least at alpha^2 = 8 beta^2, |beta| = (|M| / (4 pi))^(1/3): 24 pi^2 beta^2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lie_codegen.algebra.brackets import bracket
from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.arrays import Array

_TINY = 1e-9


class Segment(Protocol):
    """A family of controls u(s), s in [0, 1], m of them, with as many parameters as `count`."""

    @property
    def count(self) -> int:
        """Number of parameters."""

    @property
    def harmonics(self) -> int:
        """Of the controls; for the number of integration steps."""

    def velocity(self, x: Array, s: Array) -> Array:
        """(k, m) u."""

    def slopes(self, x: Array, s: Array) -> Array | None:
        """(k, m, count) du/dx; None where it is singular and the endpoint's derivative is `limit`."""

    def limit(self, algebra: LieAlgebra, controls: tuple[int, ...]) -> Array:
        """(n, count) derivative of log X(1) at x = 0."""

    def energy(self, x: Array) -> float:
        """int_0^1 |u|^2."""


@dataclass(frozen=True)
class Straight:
    """Constant controls x (m,): exp(sum x_i A_i)."""

    count: int

    harmonics: int = 1

    def velocity(self, x: Array, s: Array) -> Array:
        return np.tile(x, (len(s), 1))

    def slopes(self, x: Array, s: Array) -> Array | None:
        return np.broadcast_to(np.eye(self.count), (len(s), self.count, self.count))

    def limit(self, algebra: LieAlgebra, controls: tuple[int, ...]) -> Array:
        return np.eye(algebra.dim)[:, list(controls)]

    def energy(self, x: Array) -> float:
        return float(x @ x)


@dataclass(frozen=True)
class Loop:
    """A circle in the plane of two controls, from the origin and back; x is its signed area.

    Attributes:
        controls: m.
        pair: the two, as positions among the controls.
    """

    controls: int
    pair: tuple[int, int]

    count: int = 1
    harmonics: int = 1

    def velocity(self, x: Array, s: Array) -> Array:
        return float(np.sqrt(abs(x[0]))) * self._shape(float(np.sign(x[0])), s)

    def slopes(self, x: Array, s: Array) -> Array | None:
        if abs(x[0]) < _TINY:
            return None
        return np.asarray(self.velocity(x, s)[:, :, None] / (2 * x[0]))

    def limit(self, algebra: LieAlgebra, controls: tuple[int, ...]) -> Array:
        a, b = self.pair
        return np.asarray(algebra.structure_constants[controls[a], controls[b]])[:, None]

    def energy(self, x: Array) -> float:
        return float(4 * np.pi * abs(x[0]))

    def _shape(self, sign: float, s: Array) -> Array:
        u = np.zeros((len(s), self.controls))
        speed = 2 * np.sqrt(np.pi)
        u[:, self.pair[0]] = -speed * np.sin(2 * np.pi * s)
        u[:, self.pair[1]] = sign * speed * np.cos(2 * np.pi * s)
        return u


@dataclass(frozen=True)
class FigureEight:
    """In-phase harmonics 1 : 2 along the directions a and b of the control space; x is the signed moment M.

    Attributes:
        a, b: (m,) unit vectors.
    """

    a: tuple[float, ...]
    b: tuple[float, ...]

    count: int = 1
    harmonics: int = 2

    def velocity(self, x: Array, s: Array) -> Array:
        beta = -np.sign(x[0]) * np.cbrt(abs(x[0]) / (4 * np.pi))
        alpha = np.sqrt(8.0) * abs(beta)
        first = 2 * np.pi * alpha * np.cos(2 * np.pi * s)
        second = 4 * np.pi * beta * np.cos(4 * np.pi * s)
        return np.outer(first, self.a) + np.outer(second, self.b)

    def slopes(self, x: Array, s: Array) -> Array | None:
        if abs(x[0]) < _TINY:
            return None
        return np.asarray(self.velocity(x, s)[:, :, None] / (3 * x[0]))

    def limit(self, algebra: LieAlgebra, controls: tuple[int, ...]) -> Array:
        return double_bracket(algebra, controls, np.array(self.a), np.array(self.b))[:, None]

    def energy(self, x: Array) -> float:
        return float(24 * np.pi**2 * np.cbrt(abs(x[0]) / (4 * np.pi)) ** 2)


def double_bracket(algebra: LieAlgebra, controls: tuple[int, ...], a: Array, b: Array) -> Array:
    """(n,) [a, [a, b]] for a and b in the span of the controls."""
    first, second = (each @ np.eye(algebra.dim)[list(controls)] for each in (a, b))
    return bracket(algebra, first, bracket(algebra, first, second))
