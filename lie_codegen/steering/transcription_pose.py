"""The numbers of a transcription, checked and brought to units of the task's duration."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lie_codegen.control.positive_matrix import as_floats, positive_matrix
from lie_codegen.errors import ShapeError, SteeringInputError
from lie_codegen.simulation.metric import group_element
from lie_codegen.steering.constraints import Cone, Obstacle, check_obstacles, limits
from lie_codegen.steering.task import Task
from lie_codegen.steering.transcription_problem import Structure

Array = NDArray[Any]


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


def pose(
    task: Task,
    *,
    bounds: Any = None,
    rate_bounds: Any = None,
    obstacles: Sequence[Obstacle] = (),
    via: Sequence[tuple[float, ArrayLike]] = (),
    drift: ArrayLike | None = None,
    rest: bool = False,
    periodic: bool = False,
    objective: str = "energy",
    longest: float = 20.0,
    dynamics: str = "first_order",
    inertia: Any = None,
    velocity_bounds: Any = None,
    start_velocity: ArrayLike | None = None,
    end_velocity: ArrayLike | None = None,
    weights: ArrayLike | None = None,
    intervals: int = 64,
    starts: int = 3,
    solver: str = "ipopt",
) -> tuple[Structure, Numbers]:
    """The structure and the numbers; the options are those of `transcription`.

    Raises:
        SteeringInputError, ShapeError: about an option.
    """
    group, D, m = task.group, task.duration, len(task.controls)
    where = f"steer({group.name})"
    for name, value, least in (("intervals", intervals, 4), ("starts", starts, 1)):
        if operator.index(value) < least:
            raise SteeringInputError(f"{where}: {name} must be at least {least}, got {value}")
    if objective not in ("energy", "time"):
        raise SteeringInputError(f'{where}: objective is "energy" or "time", got {objective!r}')
    if solver not in ("ipopt", "fatrop"):
        raise SteeringInputError(f'{where}: solver is "ipopt" or "fatrop", got {solver!r}')
    low, high = limits(group, task.controls, bounds, f"{where}: bounds")
    slow, fast = limits(group, task.controls, rate_bounds, f"{where}: rate_bounds")
    if objective == "time" and not np.all(np.isfinite(low) & np.isfinite(high)):
        free = [group.labels[i] for i, a, b in zip(task.controls, low, high, strict=True) if not np.isfinite(b - a)]
        raise SteeringInputError(f"{where}: minimum time needs bounds on every control; {', '.join(free)} has none")
    if rest and (np.any(low > 0) or np.any(high < 0)):
        raise SteeringInputError(f"{where}: rest needs bounds that allow zero")
    nodes, elements = [], []
    for fraction, element in via:
        node = round(float(fraction) * intervals)
        if not 0 < node < intervals or node in nodes:
            raise SteeringInputError(
                f"{where}: via fractions must fall on different inner nodes of {intervals} intervals, got {fraction!r}"
            )
        nodes.append(node)
        elements.append(group_element(group, element, f"{where}: via point at {fraction}"))
    order = [int(i) for i in np.argsort(nodes)]
    w = np.ones(m) if weights is None else np.array(weights, dtype=float)
    shift = np.zeros(group.dim) if drift is None else np.array(drift, dtype=float)
    if w.shape != (m,) or not np.all(w > 0):
        raise SteeringInputError(f"{where}: weights must be {m} positive numbers, got {weights!r}")
    if shift.shape != (group.dim,) or not np.all(np.isfinite(shift)):
        raise ShapeError(f"{where}: drift must be {group.dim} finite numbers, got {drift!r}")
    checked = check_obstacles(group, obstacles)
    second = _dynamics(task, dynamics, inertia, velocity_bounds, (start_velocity, end_velocity), shift)
    if periodic and solver == "fatrop":
        raise SteeringInputError(f"{where}: periodic controls couple the ends, which fatrop cannot do; use ipopt")
    if periodic and second is not None and np.any(second.ends[0] != second.ends[1]):
        raise SteeringInputError(f"{where}: a periodic manoeuvre ends with the velocity it starts with")
    unit = D if second is None else D * D
    structure = Structure(
        group,
        task.controls,
        intervals,
        cones=sum(isinstance(each, Cone) for each in checked),
        balls=sum(not isinstance(each, Cone) for each in checked),
        via=tuple(nodes[i] for i in order),
        free_time=objective == "time",
        solver=solver,
        second_order=second is not None,
        periodic=periodic,
    )
    numbers = Numbers(
        bounds=(low * unit, high * unit),
        rates=(slow * unit * D, fast * unit * D),
        obstacles=tuple(sorted(checked, key=lambda each: not isinstance(each, Cone))),
        via=tuple(elements[i] for i in order),
        drift=shift * D,
        weights=w,
        rest=rest,
        longest=longest,
        dynamics=second,
    )
    return structure, numbers


def _dynamics(
    task: Task, dynamics: str, inertia: Any, speeds: Any, ends: tuple[ArrayLike | None, ArrayLike | None], drift: Array
) -> Dynamics | None:
    where, n, D = f"steer({task.group.name})", task.group.dim, task.duration
    if dynamics not in ("first_order", "second_order"):
        raise SteeringInputError(f'{where}: dynamics is "first_order" or "second_order", got {dynamics!r}')
    if dynamics == "first_order":
        given = {"inertia": inertia, "velocity_bounds": speeds, "start_velocity": ends[0], "end_velocity": ends[1]}
        extra = [name for name, value in given.items() if value is not None]
        if extra:
            raise SteeringInputError(f'{where}: {", ".join(extra)} belongs to dynamics="second_order"')
        return None
    if inertia is None:
        raise SteeringInputError(f"{where}: second-order dynamics need an inertia: a number, {n} numbers or a matrix")
    if np.any(drift):
        raise SteeringInputError(f"{where}: drift is a velocity of the first-order system; use start_velocity")
    velocities = []
    for name, value in zip(("start_velocity", "end_velocity"), ends, strict=True):
        xi = np.zeros(n) if value is None else np.array(value, dtype=float)
        if xi.shape != (n,) or not np.all(np.isfinite(xi)):
            raise ShapeError(f"{where}: {name} must be {n} finite numbers, got {value!r}")
        velocities.append(xi * D)
    low, high = limits(task.group, range(n), speeds, f"{where}: velocity_bounds")
    for xi in velocities:
        if np.any(xi < low * D) or np.any(xi > high * D):
            raise SteeringInputError(
                f"{where}: velocity_bounds exclude the velocity {(xi / D).tolist()} asked for at an end"
            )
    metric = as_floats(positive_matrix(inertia, n, f"{where}: inertia"))
    return Dynamics(metric, (velocities[0], velocities[1]), (low * D, high * D))
