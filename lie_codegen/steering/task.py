"""Task: a steering problem, proved well posed before anything is computed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.algebra.controllability import Controllability, control_indices, controllability
from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, SteeringInputError, UncontrollableError
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.flow.elements import group_element
from lie_codegen.groups.matrix_group import MatrixGroup, require_group
from lie_codegen.identifiers import shown
from lie_codegen.runtime.records import recalled
from lie_codegen.steering.accessibility import with_drift

#: Durations in seconds that double precision carries.
SHORTEST = 1e-100
LONGEST = 1e100


@dataclass(frozen=True)
class Task:
    """Steer X' = X sum_i u_i A_i from the identity to the target in the given time.

    Attributes:
        group: the group.
        target: (d, d) element.
        controls: positions of the actuated basis elements.
        duration: seconds.
        tolerance: endpoint error below which a plan counts as solved.
        report: the controllability of the controls; not controllable alone where a drift, or inertia, makes up for it.
        free: (k, n) directions of the algebra the goal leaves free: the end is in target exp(hat(their span)).
    """

    group: MatrixGroup
    target: Array = field(repr=False)
    controls: tuple[int, ...]
    duration: float
    tolerance: float
    report: Controllability
    free: Array | None = field(default=None, repr=False)

    @property
    def freedom(self) -> int:
        """k, how many directions are free; zero where the goal is an element."""
        return 0 if self.free is None else len(self.free)

    def moved(self, h: Array) -> Array:
        """(d, d) target exp(hat(sum_i h_i free_i)): another element of the goal, which is as good."""
        if self.free is None:
            return self.target
        return np.asarray(self.target @ expm(self.group.hat(h @ self.free)))

    def elements(self, more: int) -> tuple[Array, ...]:
        """The target, and some other elements of a set of goals: what none would come to from the target, for what lies between."""
        if not self.freedom:
            return (self.target,)
        rng = np.random.default_rng(0)
        return (self.target, *(self.moved(h) for h in rng.uniform(-np.pi, np.pi, (more, self.freedom))))


def check_duration(duration: object, where: str) -> None:
    """A duration in seconds whose square, and that of controls of about 1 / duration, stay in the range of a double.

    Raises:
        SteeringInputError: it is no such number.
    """
    real = isinstance(duration, int | float | np.number) and not isinstance(duration, bool)
    if not real or not SHORTEST <= duration <= LONGEST:  # type: ignore[operator]  # NaN fails the comparison
        raise SteeringInputError(
            f"{where}: duration must be a positive number of seconds between {SHORTEST:g} and {LONGEST:g}, "
            f"got {shown(duration)}"
        )


def make_task(
    group: MatrixGroup,
    target: ArrayLike,
    controls: Sequence[str | int],
    duration: float,
    tolerance: float,
    *,
    torques: bool = False,
    drift: Any = None,
) -> Task:
    """The task, checked; a drift may help controls that do not reach everything alone, and whether torques do depends on
    the inertia, and is checked with it.

    Raises:
        InputError: an unknown or repeated control, a duration that is not positive and finite.
        UncontrollableError: with the growth vector and the missing directions; not for torques.
        ShapeError, NotFiniteError, NotOnGroupError: about the target.
    """
    require_group(group, "steer")
    report = reach(group, control_indices(group.algebra, controls))
    if not report.controllable and not torques:
        _require_drift_helps(group, report, drift)
    check_duration(duration, f"steer({group.name})")
    if not tolerance > 0:
        raise InputError(f"steer({group.name}): tolerance must be positive, got {tolerance!r}")
    element = group_element(group, target, f"steer({group.name}): target")
    return Task(group, element, report.controls, float(duration), float(tolerance), report)


@lru_cache(maxsize=64)
def reach(group: MatrixGroup, controls: tuple[int, ...]) -> Controllability:
    """The report, exact: made, or from its record in the cache."""
    source = [group.definition.text, controls]
    return recalled("controllability", source, Controllability, lambda: controllability(group.algebra, controls))


def _require_drift_helps(group: MatrixGroup, report: Controllability, drift: Any) -> None:
    """Refuses controls that reach too little even with the drift; one that is no drift is left to the method to refuse."""
    try:
        b = np.asarray(0.0 if drift is None else drift, dtype=float)
    except (TypeError, ValueError):
        b = np.zeros(0)
    usable = b.shape == (group.dim,) and bool(np.all(np.isfinite(b)))
    if usable and with_drift(group.algebra, report.controls, b) == group.dim:
        return
    helped = ", even with the drift" if usable else ""
    raise UncontrollableError(f"not controllable{helped}: {report.reason}; add a control in a missing direction")
