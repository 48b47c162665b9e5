"""Two wheels, bounded rates, and a star tracker that must not see the sun: solved, drawn, integrated once more."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from lie_codegen.arrays import Array
from lie_codegen.flow.simulate import simulate
from lie_codegen.groups.catalogue_load import group
from lie_codegen.pictures.result import GalleryResult, save
from lie_codegen.pictures.steering_picture import draw_plan
from lie_codegen.pictures.style import caption
from lie_codegen.steering.constraints import Cone
from lie_codegen.steering.front import steer
from lie_codegen.steering.plan import Plan

_TARGET = (0.4, -0.3, 1.2)
_CONTROLS = ("w1", "w2")
_DURATION = 60.0
_BOUND = 0.08
_RATE = 0.02
_HALF_ANGLE = 0.15
_TRACKER = (0.0, 0.0, 1.0)


def steering_star_tracker(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """The sun stands where the unconstrained optimum would point the star tracker; the limits make it go around."""
    so3 = group("so3")
    free = steer(so3, _TARGET, _CONTROLS, _DURATION)
    middle = simulate(so3, free.u, t=[0.0, _DURATION / 2]).X[-1] @ np.array(_TRACKER)
    sun = (float(middle[0]), float(middle[1]), float(middle[2]))
    cone = Cone(_TRACKER, sun, _HALF_ANGLE)
    progress("solving with bounds on rates, on their derivatives, at rest at both ends, and outside the cone")
    plan = steer(
        so3,
        _TARGET,
        _CONTROLS,
        _DURATION,
        bounds=_BOUND,
        rate_bounds=_RATE,
        rest=True,
        obstacles=[cone],
        progress=progress,
    )
    progress("integrating again, with SciPy")
    X = _integrated(plan, np.linspace(0, _DURATION, 1201))
    angles = np.arccos(np.clip(X @ np.array(_TRACKER) @ middle, -1, 1))
    numbers = {
        "energy": plan.cost,
        "energy_without_limits": free.cost,
        "attitude_error_rad": plan.error,
        "attitude_error_by_scipy": float(np.max(np.abs(X[-1] - plan.target))),
        "smallest_angle_to_the_sun_rad": float(np.min(angles)),
        "angle_to_keep_rad": _HALF_ANGLE,
        "angle_without_limits_rad": 0.0,
        "largest_rate_rad_s": float(np.max(np.abs(plan.u(np.linspace(0, _DURATION, 2001))))),
        "bound_rad_s": _BOUND,
        "winner": plan.details["winner"],
    }
    figure = draw_plan(plan, free.cost, [cone])
    figure.suptitle("Two wheels, bounded rates, and a star tracker (body axis 3) that keeps off the sun")
    caption(
        figure,
        f"Rates at most {_BOUND:g} rad/s, their slopes at most {_RATE:g} rad/s$^2$, at rest at both ends; the cone has a "
        f"half angle of {_HALF_ANGLE:g} rad. Endpoint error {plan.error:.1e}.",
    )
    return save("steering_star_tracker", folder, figure, numbers)


def _integrated(plan: Plan, t: Array) -> Array:
    """X at the times t by DOP853 on the entries of the matrix, from knot to knot of the controls."""

    def rate(s: float, x: Array) -> Array:
        return np.asarray((x.reshape(3, 3) @ plan.group.hat(plan.u(s))).ravel())

    knots = np.unique(np.concatenate([[0.0], plan.u.breakpoints, [plan.duration]]))
    state, states = np.eye(3).ravel(), np.zeros((len(t), 3, 3))
    for a, b in pairwise(knots):
        inside = (t >= a) & (t <= b)
        asked = np.unique(np.append(t[inside], b))
        run = solve_ivp(rate, (a, b), state, method="DOP853", rtol=1e-11, atol=1e-13, t_eval=asked)
        states[inside] = run.y.T[np.isin(asked, t[inside])].reshape(-1, 3, 3)
        state = run.y[:, -1]
    return states
