"""method="direct" under torques among obstacles: the search of `around` with the torques of a body as controls."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import ShapeError, SteeringInputError
from lie_codegen.exact.positive_matrix import as_floats, positive_matrix
from lie_codegen.flow.elements import group_element
from lie_codegen.groups.matrix_group import MatrixGroup, require_group
from lie_codegen.steering.constraints import Obstacle, box_limits, check_obstacles
from lie_codegen.steering.direct.around import refuse_blocked_ends, scene_settings, searched_scene
from lie_codegen.steering.direct.assemble import Manoeuvre
from lie_codegen.steering.direct.guess import guessed
from lie_codegen.steering.direct.problem import check_options, control_weights
from lie_codegen.steering.direct.system import System, Velocity, controls_of
from lie_codegen.steering.direct.torque_scene import TorqueScene
from lie_codegen.steering.goals import end_of
from lie_codegen.steering.obstacles.keep_out import KeepOut
from lie_codegen.steering.plan import Plan
from lie_codegen.steering.task import check_duration
from lie_codegen.steering.torque_reach import require_torques_reach

#: Pieces of the guess, which is stretched afterwards.
_GUESSED = 64


def torques_around(
    group: MatrixGroup,
    target: Any,
    controls: Sequence[Any],
    duration: float,
    tolerance: float,
    *,
    obstacles: Sequence[Obstacle],
    dynamics: str = "second_order",
    objective: str = "energy",
    inertia: Any = None,
    bounds: Any = None,
    weights: ArrayLike | None = None,
    start: ArrayLike | None = None,
    start_velocity: ArrayLike | None = None,
    end_velocity: ArrayLike | None = None,
    classes: int = 4,
    guess: Any = None,
    starts: int = 16,
    rounds: int = 4,
    iterations: int = 150,
    seed: int = 0,
    longest: float = 20.0,
    progress: Callable[[str], None] | None = None,
) -> Plan:
    """The cheapest torques found that keep clear: X' = X hat(xi), J xi' = ad*_xi J xi + sum u_i b_i, from velocity to velocity.

    Args:
        group, target, controls, duration, tolerance: as `steer`; sets of goals too, and (n,) vectors as controls.
        obstacles, classes, guess, starts, rounds, iterations, seed, longest, progress: as `direct`.
        dynamics, inertia, bounds, weights, start, start_velocity, end_velocity: as `steer`.
        objective: "energy" (torques linear between nodes), "fuel" or "time" (constant on pieces), or "none".

    Raises:
        SteeringInputError: an option, an obstacle, controls that depend on time; of least time, no bounds.
        UncontrollableError: from rest, torques that do not move the configuration in every direction.
        SteeringError: an end inside an obstacle; nothing was found, which proves nothing.
    """
    began = time.perf_counter()
    require_group(group, "steer")
    where = f"steer({group.name})"
    check_duration(duration, where)
    check_options(objective, "left", starts, rounds, None, iterations, tolerance)
    task, motion = _tasks(group, target, controls, duration, bounds, weights, start, where)
    if inertia is None:
        raise SteeringInputError(
            f"{where}: torques move a body of some inertia: give inertia=, a number, {group.dim} numbers or a matrix"
        )
    J = as_floats(positive_matrix(inertia, group.dim, f"{where}: inertia"))
    ends = np.array([_velocity(each, group.dim, f"{where}: {name}") for name, each in (("start_velocity", start_velocity), ("end_velocity", end_velocity))])  # fmt: skip
    labels = task.system.labels
    if not np.any(ends[0]) and all(label in group.labels for label in labels):
        require_torques_reach(group, tuple(group.labels.index(label) for label in labels), J)
    if objective == "time" and not (np.all(np.isfinite(task.low)) and np.all(np.isfinite(task.high))):
        raise SteeringInputError(
            f'{where}: objective="time" needs bounds on every torque: without them there is no least time'
        )
    checked = check_obstacles(group, obstacles)
    keep_out = KeepOut.of(group.degree, checked)
    refuse_blocked_ends(task, checked, where)
    scene = TorqueScene(
        task, keep_out, checked, scene_settings(objective, iterations), objective, longest if objective == "time" else 0.0,
        motion=motion, inertia=J, ends=ends,
    )  # fmt: skip
    guesses = guessed(task, guess, _GUESSED)
    return searched_scene(scene, target, classes, tolerance, starts, rounds, seed, guesses, progress, began)


def _tasks(
    group: MatrixGroup,
    target: Any,
    controls: Sequence[Any],
    duration: float,
    bounds: Any,
    weights: ArrayLike | None,
    start: ArrayLike | None,
    where: str,
) -> tuple[Manoeuvre, Manoeuvre]:
    """The task with torques as controls, and that of the n velocities."""
    labels, directions = controls_of(group, controls, where)
    if any(each.constant is None for each in directions):
        raise SteeringInputError(f"{where}: torques act along labels or (n,) vectors that do not depend on the time")
    here = np.eye(group.degree) if start is None else np.real(group_element(group, start, f"{where}: start"))
    end = end_of(group, target, f"{where}: target")
    low, high = box_limits(labels, bounds, f"{where}: bounds")
    n = group.dim
    none = Velocity(n, constant=np.zeros(n))
    each_own = tuple(Velocity(n, constant=row) for row in np.eye(n))
    w = control_weights(weights, len(labels), where)
    return (
        Manoeuvre(System(group, labels, directions, none, here), end, float(duration), low, high, w),
        Manoeuvre(
            System(group, group.labels, each_own, none, here), end, float(duration), np.full(n, -np.inf), np.full(n, np.inf), np.ones(n)
        ),
    )  # fmt: skip


def _velocity(value: ArrayLike | None, n: int, where: str) -> Array:
    xi = np.zeros(n) if value is None else np.array(value, dtype=float)
    if xi.shape != (n,) or not np.all(np.isfinite(xi)):
        raise ShapeError(f"{where} must be {n} finite numbers, got {value!r:.60}")
    return xi
