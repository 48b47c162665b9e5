"""The attitude loops of `lie-codegen bench propagate`: numbers, a right side and a stored value, nothing of this package.

X' = X hat(w), J w' = -k_p log X - k_d w on SO(3): the gyroscopic torque is cancelled. In unit quaternions q of X, with |v| the length of
the vector part, log X = 2 atan2(|v|, q_0) v / |v|.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.benchmarks.loop_reference import SECONDS, STATES

#: The start, a unit quaternion.
START = np.array([2.0, 1.0, 2.0, 4.0]) / 5


@dataclass(frozen=True, eq=False)
class LoopCase:
    """Loops from one attitude.

    Attributes:
        name: as it is printed.
        inertia: (N, 3) principal moments.
        k_p, k_d: (N,) gains.
        xi0: (N, 3) starting velocities.
        t: (T,) seconds at which states are wanted, those of `loop_reference` among them.
    """

    name: str
    inertia: Array
    k_p: Array
    k_d: Array
    xi0: Array
    t: Array

    @property
    def command(self) -> tuple[str, ...]:
        """Module and arguments of the process that runs it."""
        return "lie_codegen.benchmarks.loop_peers", str(len(self.k_p))

    def error(self, found: Array, ours: Array) -> float:
        """Of X and w of the first member at the times of the stored states; of further members how far they are from ours."""
        if found.shape != ours.shape:
            return float("inf")
        stored = found[np.searchsorted(self.t, SECONDS), 0] - stored_states()
        others = found[:, 1:] - ours[:, 1:]
        return float(max(np.max(np.abs(stored)), np.max(np.abs(others), initial=0.0)))


def loop_case(members: int = 1) -> LoopCase:
    """J = (1, 2, 3), k_p = 4, k_d = 6 over ten seconds; others with numbers of their own, none of which passes a half turn."""
    rng = np.random.default_rng(0)
    inertia = rng.uniform(1, 3, (members, 3))
    k_p, k_d, xi0 = rng.uniform(2, 6, members), rng.uniform(4, 6, members), 0.5 * rng.uniform(-1, 1, (members, 3))
    inertia[0], k_p[0], k_d[0], xi0[0] = (1, 2, 3), 4, 6, (1.0, 0.5, -0.2)
    name = "PD loop" if members == 1 else f"{members:,} PD loops"
    return LoopCase(name, inertia, k_p, k_d, xi0, np.linspace(0, 10, 101 if members == 1 else 6))


def loop_error(state: Array) -> float:
    """Of (12,) X and w of the first member at t = 2."""
    return float(np.max(np.abs(state - stored_states()[0])))


def stored_states() -> Array:
    """(5, 12) X and w of the first member after so many `SECONDS`."""
    q, w = np.split(np.array([[float(x) for x in row.split()] for row in STATES]), [4], axis=1)
    return states_of(q, w)


def rate_of(sqrt: Callable[[Any], Any], atan2: Callable[[Any, Any], Any]) -> Callable[..., tuple[Any, ...]]:
    """(q, w)' of seven numbers for a body of five, by any square root and arc tangent."""

    def rate(
        q0: Any, q1: Any, q2: Any, q3: Any, a: Any, b: Any, c: Any, J1: Any, J2: Any, J3: Any, k_p: Any, k_d: Any
    ) -> tuple[Any, ...]:
        length = sqrt(q1 * q1 + q2 * q2 + q3 * q3)
        spring = 2.0 * k_p * atan2(length, q0) / length
        return (
            -0.5 * (q1 * a + q2 * b + q3 * c),
            0.5 * (q0 * a + q2 * c - q3 * b),
            0.5 * (q0 * b + q3 * a - q1 * c),
            0.5 * (q0 * c + q1 * b - q2 * a),
            -(spring * q1 + k_d * a) / J1,
            -(spring * q2 + k_d * b) / J2,
            -(spring * q3 + k_d * c) / J3,
        )

    return rate


def states_of(q: Array, w: Array) -> Array:
    """(..., 12) X row by row and w of quaternions (..., 4) and velocities (..., 3)."""
    q0, q1, q2, q3 = np.moveaxis(q, -1, 0)
    X = [
        1 - 2 * (q2 * q2 + q3 * q3), 2 * (q1 * q2 - q0 * q3), 2 * (q1 * q3 + q0 * q2),
        2 * (q1 * q2 + q0 * q3), 1 - 2 * (q1 * q1 + q3 * q3), 2 * (q2 * q3 - q0 * q1),
        2 * (q1 * q3 - q0 * q2), 2 * (q2 * q3 + q0 * q1), 1 - 2 * (q1 * q1 + q2 * q2),
    ]  # fmt: skip
    return np.concatenate([np.stack(X, axis=-1), w], axis=-1)
