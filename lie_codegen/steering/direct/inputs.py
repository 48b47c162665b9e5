"""The controls of a plan as plain data: linear on each piece, continuous or not, and the velocity they make."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.steering.direct.system import System
from lie_codegen.values import Value


@dataclass(frozen=True, eq=False, repr=False)
class Inputs(Value):
    """m inputs of time, linear on each piece; at a breakpoint the later piece counts.

    Attributes:
        knots: (K + 1,) from 0 to the duration.
        first, last: (K, m) at the ends of each piece.
    """

    knots: Array
    first: Array
    last: Array

    @staticmethod
    def constant(knots: Array, values: Array) -> Inputs:
        """Constant on each piece."""
        return Inputs(knots, values, values)

    @staticmethod
    def linear(knots: Array, values: Array) -> Inputs:
        """Continuous and linear between the (K + 1, m) values at the knots."""
        return Inputs(knots, values[:-1], values[1:])

    def __call__(self, t: ArrayLike) -> Array:
        """(m,) at a time, (k, m) at (k,) times."""
        times = np.asarray(t, dtype=float)
        flat = np.atleast_1d(times)
        piece = np.clip(np.searchsorted(self.knots, flat, side="right") - 1, 0, len(self.first) - 1)
        length = np.diff(self.knots)[piece]
        with np.errstate(invalid="ignore", divide="ignore"):
            s = np.where(length > 0, (flat - self.knots[piece]) / length, 0.0)[:, None]
        values = np.asarray((1 - s) * self.first[piece] + s * self.last[piece])
        return values[0] if times.ndim == 0 else values

    def integral_of_squares(self, weights: Array) -> float:
        """int sum_i w_i u_i^2 dt, exactly."""
        a, b = self.first, self.last
        return float(np.diff(self.knots) @ ((a * a + a * b + b * b) @ weights) / 3)

    def integral_of_sizes(self, weights: Array) -> float:
        """int sum_i w_i |u_i| dt, exactly: two triangles where the sign changes."""
        a, b = self.first, self.last
        total = np.abs(a) + np.abs(b)
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = np.where(a * b < 0, (a * a + b * b) / total, total) / 2
        return float(np.diff(self.knots) @ (mean @ weights))

    def peaks(self) -> tuple[float, ...]:
        """(m,) largest |u_i|."""
        return tuple(float(x) for x in np.maximum(np.max(np.abs(self.first), 0), np.max(np.abs(self.last), 0)))

    def reversed(self) -> Inputs:
        """u(T - t)."""
        return Inputs(self.knots[-1] - self.knots[::-1], self.last[::-1].copy(), self.first[::-1].copy())


@dataclass(frozen=True, eq=False, repr=False)
class Drive(Value):
    """(k,) times -> (k, n): the velocity sum_i u_i(t) b_i(t), with the drift or without."""

    system: System
    inputs: Inputs
    drifting: bool = False

    def __call__(self, t: Array) -> Array:
        """(k,) times -> (k, n)."""
        u = self.inputs(t)
        if self.drifting:
            return self.system.velocity(t, u)
        return np.asarray(np.einsum("km,kmn->kn", u, self.system.directions_at(t)))
