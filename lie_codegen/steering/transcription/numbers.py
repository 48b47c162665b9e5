"""What a user asks of a transcription, and its numbers in units of the task's duration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.steering.constraints import Obstacle


@dataclass(frozen=True)
class Options:
    """What a user asks for.

    Attributes:
        bounds: of the controls: a number (both signs), a (low, high) pair, or {label: either}; units of u.
        rate_bounds: of the controls' time derivatives, as bounds.
        obstacles: `Cone`s (attitude exclusion), `Ball`s, `Box`es and `Cylinder`s (position), for all of the way.
        via: (fraction of the duration, element or coordinates of the second kind) to pass through.
        drift: (n,) constant velocity added to the controls' own: X' = X hat(drift + u).
        rest: controls are zero at both ends.
        periodic: controls end as they begin: a gait, whose repetition moves by the target each time.
        objective: "energy", int sum w_i u_i^2, or "time".
        longest: for "time": the longest duration allowed, in units of the task's.
        dynamics: "first_order": u is a velocity; "second_order": u is a torque, or force, on the controlled components,
            X' = X hat(xi), J xi' = ad*_xi J xi + u, from rest to rest.
        inertia: J: a number, (n,) or (n, n), symmetric positive definite; for second order, as what follows.
        velocity_bounds: of any component of xi, as bounds.
        start_velocity, end_velocity: (n,) xi at the ends, zero if not given.
        weights: (m,) positive w_i, ones if not given.
        intervals: N, pieces of the controls.
        starts: first guesses tried; the cheapest admissible result wins; if not given 8 among
            boxes and cylinders, or in least time among any obstacles, else 3.
        solver: "auto": fatrop, and ipopt where no start of fatrop's leads anywhere; ipopt alone where the controls are periodic,
            or do not reach all without the drift or the inertia. Or "fatrop" or "ipopt".
        classes: shortest classes of ways between discs in the plane (`Ball`s on SE(2)) tried beside the other guesses, each with three
            end headings; 0 for none. All that were found are in details["classes"]: word, cost, clearance.
        guess: controls to start from beside the others: a Plan, or samples (k, m) at equal times.
    """

    bounds: Any = None
    rate_bounds: Any = None
    obstacles: Sequence[Obstacle] = ()
    via: Sequence[tuple[float, ArrayLike]] = ()
    drift: ArrayLike | None = None
    rest: bool = False
    periodic: bool = False
    objective: str = "energy"
    longest: float = 20.0
    dynamics: str = "first_order"
    inertia: Any = None
    velocity_bounds: Any = None
    start_velocity: ArrayLike | None = None
    end_velocity: ArrayLike | None = None
    weights: ArrayLike | None = None
    intervals: int = 64
    starts: int | None = None
    solver: str = "auto"
    classes: int = 4
    guess: Any = None


@dataclass(frozen=True)
class Dynamics:
    """Second order: J xi' = ad*_xi J xi + torque.

    Attributes:
        inertia: (n, n) J.
        ends: xi at both ends, (n,) each.
        speeds: lower and upper limits of xi, (n,) each.
    """

    inertia: Array
    ends: tuple[Array, Array]
    speeds: tuple[Array, Array]


@dataclass(frozen=True)
class Numbers:
    """The numbers of a problem, in units of the task's duration.

    Attributes:
        bounds, rates: lower and upper limits of the controls and of their rates, (m,) each.
        obstacles: cones first.
        obstacle_names: what messages call them, by the user's order.
        via: (d, d) elements, in order.
        drift: (n,).
        weights: (m,).
        rest: whether the controls vanish at both ends.
        longest: duration allowed.
        dynamics: None to first order.
    """

    bounds: tuple[Array, Array]
    rates: tuple[Array, Array]
    obstacles: tuple[Obstacle, ...]
    obstacle_names: tuple[str, ...]
    via: tuple[Array, ...]
    drift: Array
    weights: Array
    rest: bool
    longest: float
    dynamics: Dynamics | None

    @property
    def power(self) -> int:
        """The power of the duration that makes a control a pure number times its unit: 1, or 2 for torques."""
        return 1 if self.dynamics is None else 2

    def ratios(self, v: Array) -> Array:
        """(k, m) how many times their bounds controls v (k, m) are; zero where there are none."""
        return over(v, self.bounds)


def over(values: Array, between: tuple[Array, Array]) -> Array:
    """How many times their limits values are, 0 where there are none; infinite where a limit of 0 is passed."""
    low, high = between
    with np.errstate(divide="ignore", invalid="ignore"):
        above = np.where(values > 0, values / np.maximum(high, 0), 0.0)
        below = np.where(values < 0, values / np.minimum(low, 0), 0.0)
    return np.asarray(np.nan_to_num(np.maximum(above, below), nan=0.0, posinf=np.inf))
