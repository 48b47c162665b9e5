"""Task: a steering problem, proved well posed before anything is computed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lie_codegen.algebra.controllability import Controllability, controllability, require_controllable
from lie_codegen.errors import InputError, SteeringInputError
from lie_codegen.groups.matrix_group import MatrixGroup, require_group
from lie_codegen.simulation.metric import group_element

Array = NDArray[Any]


@dataclass(frozen=True)
class Task:
    """Steer X' = X sum_i u_i A_i from the identity to the target in the given time.

    Attributes:
        group: the group.
        target: (d, d) element.
        controls: positions of the actuated basis elements.
        duration: seconds.
        tolerance: endpoint error below which a plan counts as solved.
        report: the controllability of the controls.
    """

    group: MatrixGroup
    target: Array = field(repr=False)
    controls: tuple[int, ...]
    duration: float
    tolerance: float
    report: Controllability


def make_task(
    group: MatrixGroup,
    target: ArrayLike,
    controls: Sequence[str | int],
    duration: float,
    tolerance: float,
    *,
    torques: bool = False,
) -> Task:
    """The task, checked; whether torques reach everything depends on the inertia, and is checked with it.

    Raises:
        InputError: an unknown or repeated control, a duration that is not positive and finite.
        UncontrollableError: with the growth vector and the missing directions; not for torques.
        ShapeError, NotFiniteError, NotOnGroupError: about the target.
    """
    require_group(group, "steer")
    report = (controllability if torques else require_controllable)(group.algebra, controls)
    if not isinstance(duration, int | float | np.number) or not np.isfinite(duration) or not duration > 0:
        raise SteeringInputError(
            f"steer({group.name}): duration must be a positive number of seconds, got {duration!r}"
        )
    if not tolerance > 0:
        raise InputError(f"steer({group.name}): tolerance must be positive, got {tolerance!r}")
    element = group_element(group, target, f"steer({group.name}): target")
    return Task(group, element, report.controls, float(duration), float(tolerance), report)
