"""method="swing_twist": every target of SO(3) and SU(2) with two controls, exactly and in closed form: a swing, then a circle.

R = exp(s_1 A_1 + s_2 A_2) exp(g A_3) from the unit quaternion (w, x, y, z) of R: g = 2 atan2(z, w), and the swing is R without that
twist. The swing is a constant control. The twist is u = r (cos W t, sin W t) for a time T_2 with

    W T_2 = 2 pi sgn(g) - g,   r T_2 = sqrt(4 pi^2 - (W T_2)^2) = sqrt(4 pi |g| - g^2),

because the circle leads to exp(T_2 (r A_1 + W A_3)) exp(-W T_2 A_3), of which the first factor is a full turn: 1 on SO(3), -1 on SU(2),
where the second one makes up for it. Times in the ratio |s| : r T_2 keep the speed constant; the energy is (|s| + r T_2)^2 / T.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import SteeringInputError
from lie_codegen.flow.second_kind_coordinates import element_coordinates
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.plan import Controls, Plan, Status
from lie_codegen.steering.simulated_plan import simulated_plan
from lie_codegen.steering.task import Task

_TINY = 1e-15


@dataclass(frozen=True)
class SwingAndCircle:
    """The controls as plain data.

    Attributes:
        dim, positions: n, and the positions of the two controls.
        swing: (s_1, s_2), the integral of the first phase, rad.
        radius, turn: r T_2 and W T_2 of the second phase, rad.
        switch, duration: T_1 and T_1 + T_2, s.
    """

    dim: int
    positions: tuple[int, int]
    swing: tuple[float, float]
    radius: float
    turn: float
    switch: float
    duration: float

    def __call__(self, t: Array) -> Array:
        """(k,) times -> (k, n)."""
        u = np.zeros((len(t), self.dim))
        second = self.duration - self.switch
        angle = self.turn * (t - self.switch) / second if second > 0 else np.zeros_like(t)
        swinging = (t < self.switch) if second > 0 else np.ones(len(t), bool)
        for position, s, wave in zip(self.positions, self.swing, (np.cos, np.sin), strict=True):
            straight = s / self.switch if self.switch > 0 else 0.0
            circle = self.radius / second * wave(angle) if second > 0 else 0.0
            u[:, position] = np.where(swinging, straight, circle)
        return u


def swing_twist(task: Task) -> Plan:
    """The exact plan of a swing and a circle.

    Raises:
        SteeringInputError: not two controls, or a group that is not SO(3) or SU(2) in a basis with [A_1, A_2] = +-A_3 and so on.
    """
    started = time.perf_counter()
    i, j, k, sign, double = _axes(task)
    w, x, y, z = quaternion(task.group, (i, j, k), sign, task.target)
    g = 2 * float(np.arctan2(z, w))
    if not double:
        g = (g + np.pi) % (2 * np.pi) - np.pi
    # with [A_1, A_2] = -A_3 the quaternion is that of the basis A_1, A_2, -A_3, where the formulas hold as they stand
    twist = np.array([np.cos(g / 2), np.sin(g / 2)])
    # q conj(twist): the quaternion of the swing, without a component along A_3
    ws, xs, ys = twist[0] * w + twist[1] * z, twist[0] * x - twist[1] * y, twist[0] * y + twist[1] * x
    half = float(np.hypot(xs, ys))
    angle = 2 * float(np.arctan2(half, ws))
    if not double and angle > np.pi:
        angle -= 2 * np.pi
    direction = np.array([xs, ys]) / half if half > _TINY else np.zeros(2)
    if half <= _TINY and double and ws < 0:
        direction = np.array([1.0, 0.0])  # the swing is a full turn: -1 on SU(2)
    swing = angle * direction
    turn = 2 * np.pi * np.sign(g) - g
    radius = float(np.sqrt(max(0.0, 4 * np.pi * abs(g) - g * g)))
    length = float(np.linalg.norm(swing)) + radius
    switch = task.duration * (float(np.linalg.norm(swing)) / length if length > 0 else 1.0)
    start = (float(swing[0]), float(swing[1]))
    law = SwingAndCircle(task.group.dim, (i, j), start, radius, float(turn), switch, task.duration)
    inner = [switch] if 0 < switch < task.duration else []
    details = {
        "winner": "swing_twist",
        "swing": tuple(map(float, swing)),
        "twist": g,
        "radius": radius,
        "turn": float(turn),
        "switch": switch,
        "discretisation": "none: closed form, exact",
    }
    seconds = {"plan": time.perf_counter() - started}
    return simulated_plan(
        task,
        "swing_twist",
        Controls(law, inner),
        details,
        seconds,
        solved=Status.SOLVED,
        otherwise=Status.NOT_CONVERGED,
        accuracy=1e-13,
    )


def _axes(task: Task) -> tuple[int, int, int, int, bool]:
    """Positions of A_1, A_2, A_3, the sign of [A_1, A_2] = sign A_3, and whether a full turn is -1."""
    group = task.group
    c = group.algebra.structure_constants
    if len(task.controls) == 2 and group.dim == 3:
        i, j = task.controls
        k = 3 - i - j
        cyclic = np.array([c[i, j], c[j, k], c[k, i]])
        for sign in (1, -1):
            if np.allclose(cyclic, sign * np.eye(3)[[k, i, j]], atol=1e-12):
                turned = _exponential(group, 2 * np.pi * np.eye(3)[k])
                if np.allclose(turned, np.eye(group.degree), atol=1e-9):
                    return i, j, k, sign, False
                if np.allclose(turned, -np.eye(group.degree), atol=1e-9):
                    return i, j, k, sign, True
    raise SteeringInputError(
        f"swing_twist needs two controls on SO(3) or SU(2) in a basis with [A_1, A_2] = A_3 and so on, not {group.name} with "
        f"{len(task.controls)}; use method='optimal' or 'direct'"
    )


def quaternion(group: MatrixGroup, axes: tuple[int, int, int], sign: int, X: Any) -> Array:
    """(w, x, y, z) with X = exp of the turn 2 acos(w) about (x, y, z) in the basis A_1, A_2, sign A_3."""
    frame = np.array([1.0, 1.0, float(sign)])
    if group.is_complex and group.degree == 2:
        # exp(a A) = cos(a/2) + 2 sin(a/2) A
        w = float(np.trace(X).real) / 2
        v = group.project(X - w * np.eye(2)) / 2
    else:
        turn = element_coordinates(group, X)
        angle = float(np.linalg.norm(turn))
        w = float(np.cos(angle / 2))
        v = np.sinc(angle / (2 * np.pi)) / 2 * turn
    q = np.array([w, *(frame * v[list(axes)])])
    return np.asarray(q / np.linalg.norm(q))


def _exponential(group: MatrixGroup, x: Array) -> Array:
    from scipy.linalg import expm

    return np.asarray(expm(group.hat(x)))
