"""The numbers of a transcription, checked and brought to units of the task's duration."""

from __future__ import annotations

import operator

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import ShapeError, SteeringInputError
from lie_codegen.exact.positive_matrix import as_floats, positive_matrix
from lie_codegen.flow.elements import group_element
from lie_codegen.steering.blocks import Block, Box, Cylinder
from lie_codegen.steering.constraints import Ball, Cone, check_obstacles, limits
from lie_codegen.steering.task import Task
from lie_codegen.steering.torque_reach import require_torques_reach
from lie_codegen.steering.transcription.numbers import Dynamics, Numbers, Options
from lie_codegen.steering.transcription.structure import Structure

#: Solvers; "auto" is fatrop, and ipopt where fatrop cannot or does not.
SOLVERS = ("auto", "fatrop", "ipopt")


def nondimensional(task: Task, asked: Options) -> tuple[Structure, Numbers]:
    """The structure and the numbers.

    Raises:
        SteeringInputError, ShapeError: about an option.
    """
    group, D, m = task.group, task.duration, len(task.controls)
    where = f"steer({group.name})"
    _check_choices(asked, where)
    low, high = limits(group, task.controls, asked.bounds, f"{where}: bounds")
    slow, fast = limits(group, task.controls, asked.rate_bounds, f"{where}: rate_bounds")
    if asked.objective == "time" and not np.all(np.isfinite(low) & np.isfinite(high)):
        free = [group.labels[i] for i, a, b in zip(task.controls, low, high, strict=True) if not np.isfinite(b - a)]
        raise SteeringInputError(f"{where}: minimum time needs bounds on every control; {', '.join(free)} has none")
    for what, lower, upper in (("bounds", low, high), ("rate_bounds", slow, fast)):
        if (asked.rest or what == "rate_bounds") and (np.any(lower > 0) or np.any(upper < 0)):
            raise SteeringInputError(
                f"{where}: {'rest needs' if asked.rest else 'there must be'} {what} that allow zero"
            )
    nodes, elements = _via(task, asked, where)
    w = np.ones(m) if asked.weights is None else np.array(asked.weights, dtype=float)
    shift = np.zeros(group.dim) if asked.drift is None else np.array(asked.drift, dtype=float)
    if w.shape != (m,) or not np.all(np.isfinite(w)) or not np.all(w > 0):
        raise SteeringInputError(f"{where}: weights must be {m} positive numbers, got {asked.weights!r}")
    if shift.shape != (group.dim,) or not np.all(np.isfinite(shift)):
        raise ShapeError(f"{where}: drift must be {group.dim} finite numbers, got {asked.drift!r}")
    checked = check_obstacles(group, asked.obstacles)
    second = _dynamics(task, asked, shift)
    if asked.periodic and second is not None and np.any(second.ends[0] != second.ends[1]):
        raise SteeringInputError(f"{where}: a periodic manoeuvre ends with the velocity it starts with")
    # In units of the duration D the manoeuvre lasts 1: velocities are multiplied by D, torques by D^2, and rates of either once
    # more. The solver then sees numbers of order one whatever the task's clock.
    unit = D if second is None else D * D
    named = [(each, f"obstacle {number} ({type(each).__name__})") for number, each in enumerate(checked, start=1)]
    # Cones, balls, solids: the constraints of a stage are numbered so, and the sort keeps the user's order otherwise.
    named.sort(key=lambda pair: (Cone, Ball, Box, Cylinder).index(type(pair[0])))
    structure = Structure(
        group,
        task.controls,
        asked.intervals,
        cones=sum(isinstance(each, Cone) for each in checked),
        balls=sum(isinstance(each, Ball) for each in checked),
        solids=sum(isinstance(each, Block) for each in checked),
        via=tuple(nodes),
        free_time=asked.objective == "time",
        second_order=second is not None,
        periodic=asked.periodic,
        free=task.freedom,
    )
    numbers = Numbers(
        bounds=(low * unit, high * unit),
        rates=(slow * unit * D, fast * unit * D),
        obstacles=tuple(each for each, _ in named),
        obstacle_names=tuple(name for _, name in named),
        via=tuple(elements),
        drift=shift * D,
        weights=w,
        rest=asked.rest,
        longest=float(asked.longest),
        dynamics=second,
    )
    return structure, numbers


def _check_choices(asked: Options, where: str) -> None:
    for name, value, least in (
        ("intervals", asked.intervals, 4),
        ("starts", asked.starts, 1),
        ("classes", asked.classes, 0),
    ):
        if value is not None and operator.index(value) < least:
            raise SteeringInputError(f"{where}: {name} must be at least {least}, got {value}")
    if asked.objective not in ("energy", "time"):
        raise SteeringInputError(f'{where}: objective is "energy" or "time", got {asked.objective!r}')
    if asked.solver not in SOLVERS:
        raise SteeringInputError(f'{where}: solver is "auto", "fatrop" or "ipopt", got {asked.solver!r}')
    if asked.periodic and asked.solver == "fatrop":
        raise SteeringInputError(f"{where}: periodic controls couple the ends, which fatrop cannot do; use ipopt")
    if not isinstance(asked.longest, int | float | np.number) or not np.isfinite(asked.longest) or asked.longest <= 0:
        raise SteeringInputError(f"{where}: longest must be a positive multiple of the duration, got {asked.longest!r}")


def _via(task: Task, asked: Options, where: str) -> tuple[list[int], list[Array]]:
    """Nodes in order, and the elements to pass through there."""
    N, found = asked.intervals, {}
    for pair in asked.via:
        try:
            fraction, element = pair
            node = round(float(fraction) * N)
        except (TypeError, ValueError):
            raise SteeringInputError(
                f"{where}: a via point is a pair (fraction of the duration, element), got {pair!r}"
            ) from None
        if not 0 < node < N or node in found:
            raise SteeringInputError(
                f"{where}: via fractions must fall on different inner nodes of {N} intervals, got {fraction!r}"
            )
        found[node] = group_element(task.group, element, f"{where}: via point at {fraction}")
    return sorted(found), [found[node] for node in sorted(found)]


def _dynamics(task: Task, asked: Options, drift: Array) -> Dynamics | None:
    where, n, D = f"steer({task.group.name})", task.group.dim, task.duration
    dynamics, inertia, speeds = asked.dynamics, asked.inertia, asked.velocity_bounds
    ends: tuple[ArrayLike | None, ArrayLike | None] = (asked.start_velocity, asked.end_velocity)
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
    if not np.any(velocities[0]):
        require_torques_reach(task.group, task.controls, metric)
    return Dynamics(metric, (velocities[0], velocities[1]), (low * D, high * D))
