"""A plan flown from rest to rest: X_d(t) = X(s(t)), xi_d = s' u, xi_d' = s'' u + s'^2 u'.

s is a quintic of rest to rest on each piece of the plan; where the controls jump, s stops. Without this the plan's first and last velocity, and its
jumps, are jumps of the reference. Only without drift: X' = X hat(u + drift) does not follow the same path at another speed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError


@dataclass(frozen=True)
class RetimedControls:
    """u of the plan at the new speed; `breakpoints` are the times at which it rests."""

    u: Callable[[Any], Any]
    ends: Array
    own: Array

    @property
    def breakpoints(self) -> Array:
        """[s]."""
        return self.ends

    def clock(self, t: Any) -> tuple[Array, Array]:
        """s(t) and s'(t): quintics of rest to rest."""
        times = np.atleast_1d(np.asarray(t, dtype=float))
        k = np.clip(np.searchsorted(self.ends, times, side="right") - 1, 0, len(self.ends) - 2)
        span = self.ends[k + 1] - self.ends[k]
        x = np.clip((times - self.ends[k]) / span, 0, 1)
        length = self.own[k + 1] - self.own[k]
        place = self.own[k] + length * x**3 * (10 - 15 * x + 6 * x**2)
        # Inside its piece by a hair, so that the plan is asked for the controls on the right side of a jump; there s' is 0 anyway.
        hair = 1e-12 * length
        place = np.clip(place, self.own[k] + hair, self.own[k + 1] - hair)
        return place, length / span * 30 * x**2 * (1 - x) ** 2

    def __call__(self, t: Any) -> Array:
        place, speed = self.clock(t)
        return np.asarray(speed[:, None] * np.asarray(self.u(place), dtype=float))


@dataclass(frozen=True)
class RetimedPlan:
    """The plan as it is flown."""

    plan: Any
    u: RetimedControls
    duration: float

    @property
    def group(self) -> Any:
        """That of the plan."""
        return getattr(self.plan, "group", None)

    def X(self, t: Any, /) -> Array:
        """(k,) times -> (k, d, d)."""
        place, _ = self.u.clock(t)
        return np.asarray(self.plan.X(place))


def retimed(plan: Any, duration: float) -> Any:
    """The plan in another time, at rest wherever its controls jump.

    Raises:
        InputError: a duration that is not positive; a plan with drift, whose speed is its own.
    """
    if not (np.isfinite(duration) and duration > 0):
        raise InputError(f"reference: duration = {duration} must be positive")
    details = getattr(plan, "details", None) or {}
    drift = details.get("drift")
    if drift is not None and np.any(np.asarray(drift, dtype=float) != 0):
        raise InputError(
            "reference: the plan has a drift, so its speed is its own and it cannot be re-timed: leave duration= away"
        )
    length = float(plan.duration)
    marks = np.asarray(getattr(plan.u, "breakpoints", ()), dtype=float).ravel()
    inner = np.unique(marks[(marks > 1e-9 * length) & (marks < length * (1 - 1e-9))])
    own = np.concatenate([[0.0], inner, [length]])
    return RetimedPlan(plan, RetimedControls(plan.u, own * duration / length, own), duration)
