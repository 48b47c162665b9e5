"""The problem of the direct method, checked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import ShapeError, SteeringInputError
from lie_codegen.flow.elements import group_element
from lie_codegen.groups.matrix_group import MatrixGroup, require_group
from lie_codegen.steering.constraints import box_limits
from lie_codegen.steering.direct.assemble import Manoeuvre
from lie_codegen.steering.direct.reach import require_reach
from lie_codegen.steering.direct.system import System, controls_of, velocity
from lie_codegen.steering.goals import end_of
from lie_codegen.steering.task import check_duration

_OBJECTIVES = ("energy", "fuel", "time", "none")


def manoeuvre(
    group: MatrixGroup,
    target: Any,
    controls: Sequence[Any],
    duration: float,
    drift: Any,
    bounds: Any,
    weights: ArrayLike | None,
    start: ArrayLike | None,
    equation: str,
) -> Manoeuvre:
    """The problem, checked.

    Raises:
        As `direct`.
    """
    require_group(group, "steer")
    where = f"steer({group.name})"
    check_duration(duration, where)
    labels, directions = controls_of(group, controls, where)
    free = velocity(group, np.zeros(group.dim) if drift is None else drift, f"{where}: drift")
    eye = np.eye(group.degree, dtype=group.basis.dtype)
    here = eye if start is None else group_element(group, start, f"{where}: start")
    system = System(group, labels, directions, free, here, equation == "right")
    end = end_of(group, target, f"{where}: target")
    low, high = box_limits(labels, bounds, f"{where}: bounds")
    w = control_weights(weights, len(labels), where)
    require_reach(system, float(duration), end)
    return Manoeuvre(system, end, float(duration), low, high, w)


def control_weights(weights: ArrayLike | None, m: int, where: str) -> Array:
    """(m,) weights of the objective, ones if not given.

    Raises:
        ShapeError, SteeringInputError: not m positive numbers.
    """
    w = np.ones(m) if weights is None else np.array(weights, dtype=float)
    if w.shape != (m,):
        raise ShapeError(f"{where}: weights have shape {w.shape}; give one for each of {m} controls")
    if not np.all(np.isfinite(w)) or np.any(w <= 0):
        raise SteeringInputError(f"{where}: weights must be positive, got {w.tolist()}")
    return w


def piece_count(task: Manoeuvre) -> int:
    """Constant pieces of the first search: more where there are more equations a control."""
    n, m = task.system.group.dim, task.controls
    return max(48 if n <= 8 else 32, -(-4 * n // m))


def check_options(
    objective: str, equation: str, starts: int, rounds: int, pieces: int | None, iterations: int, tolerance: float
) -> None:
    """Refuse options that the method does not know.

    Raises:
        SteeringInputError: naming the option.
    """
    if objective not in _OBJECTIVES:
        raise SteeringInputError(f"objective is one of {', '.join(_OBJECTIVES)}, got {objective!r}")
    if equation not in ("left", "right"):
        raise SteeringInputError(f'equation is "left" (X\' = X hat(u)) or "right" (X\' = hat(u) X), got {equation!r}')
    for name, value in (
        ("starts", starts),
        ("rounds", rounds),
        ("iterations", iterations),
        ("pieces", 1 if pieces is None else pieces),
    ):
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
            raise SteeringInputError(f"{name} must be a whole number of at least 1, got {value!r}")
    if not tolerance > 0:
        raise SteeringInputError(f"tolerance must be positive, got {tolerance!r}")
