"""Four phases with a free amplitude: a line, q ellipses about where it should have ended, a line back. Any two controls with
[A_i, A_j] = c A_k, and also where a coordinate of the target vanishes.

The integrals of the controls go from (0, 0) straight to (gd_i + a, gd_j), q times around (gd_i + a cos, gd_j + a' sin), and straight back to
(gd_i, gd_j). In product coordinates of H(3), where the second-order average is exact,

    c (pi q a a' + gd_j a / 2 - gd_i gd_j / 2) = gd_k;

with circles, a' = +-a, both signs are solved and the smaller root taken: one of them always has a real root. Everything is driven at one
speed. The paper's own four phases (`four_phase`) have the loop's shape tied to gd_i gd_j and blow up as that goes to zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lie_codegen.arrays import Array


@dataclass(frozen=True)
class LineAndCircles:
    """The controls as plain data, at constant speed.

    Attributes:
        dim, positions: n, and the positions of the two controls.
        goal: (gd_i, gd_j).
        amplitude, side: a, and a' = side a with side +-1.
        periods: q.
        duration: s.
    """

    dim: int
    positions: tuple[int, int]
    goal: tuple[float, float]
    amplitude: float
    side: int
    periods: int
    duration: float

    @property
    def lengths(self) -> Array:
        """(3,) of the line, the circles and the line back."""
        a = abs(self.amplitude)
        out = float(np.hypot(self.goal[0] + self.amplitude, self.goal[1]))
        return np.array([out, 2 * np.pi * self.periods * a, a])

    @property
    def switches(self) -> tuple[float, float]:
        """Times at which the circles begin and end."""
        if self.amplitude == 0:
            return self.duration, self.duration  # the line is all there is
        way = np.cumsum(self.lengths)
        scale = self.duration / way[2]
        return float(scale * way[0]), float(scale * way[1])

    def __call__(self, t: Array) -> Array:
        """(k,) times -> (k, n)."""
        u = np.zeros((len(t), self.dim))
        lengths = self.lengths
        speed = float(np.sum(lengths)) / self.duration
        first, last = self.switches
        a = self.amplitude
        direction = np.array([self.goal[0] + a, self.goal[1]]) / lengths[0] if lengths[0] > 0 else np.zeros(2)
        rate = speed / abs(a) if a else 0.0
        angle = rate * (t - first)
        phases = [(t < first) | (a == 0), t < last]
        back = -np.sign(a) * speed
        u[:, self.positions[0]] = np.select(phases, [speed * direction[0], -a * rate * np.sin(angle)], back)
        u[:, self.positions[1]] = np.select(phases, [speed * direction[1], self.side * a * rate * np.cos(angle)], 0.0)
        return u


def free_amplitude(goal: tuple[float, float], area: float, periods: int) -> tuple[float, int]:
    """(a, side) with pi q side a^2 + gd_j a / 2 = area, the smaller |a|; `area` is gd_k / c + gd_i gd_j / 2."""
    best: tuple[float, int] | None = None
    for side in (1, -1):
        lead, half = np.pi * periods * side, goal[1] / 4
        root = half * half + lead * area
        if root < 0:
            continue
        for sign in (1, -1):
            # the stable form of (-half +- sqrt(root)) / lead, for the root nearer to zero as well
            total = -half + sign * np.sqrt(root)
            other = -half - sign * np.sqrt(root)
            a = total / lead if abs(total) >= abs(other) else -area / other if other else 0.0
            if best is None or abs(a) < abs(best[0]):
                best = (float(a), side)
    # lead and area of one sign make the root real: one of the two sides always has it
    return (0.0, 1) if best is None else best
