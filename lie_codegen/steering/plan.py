"""Plan: what steering returns, whatever the method."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.groups.matrix_group import MatrixGroup


class Status(Enum):
    """How a plan ended; the value says what it means for the user."""

    SOLVED = "solved: the endpoint error is below the tolerance"
    APPROXIMATE = "approximate: the method reaches the target up to its own order; see .error"
    LOCAL = "solved: a local minimum of the objective, the best of the starts tried; more starts may find a better one"
    NOT_FOUND = "not found: the nearest of the starts tried, see .violation; that none exists is not proved"
    NOT_CONVERGED = "not converged: the best found is returned, see .error; more starts may find more"

    ADMISSIBLE = "admissible: all conditions are met, the iteration limit was reached before the cost settled"
    NOT_ADMISSIBLE = "not admissible: a condition is violated; see .worst and .violation"
    DIVERGED = "diverged: the first trajectory is not finite; give another guess"

    def __str__(self) -> str:
        return self.value


class Controls:
    """u(t) on all n components (zeros where there is no control), for a float or an array of times.

    Attributes:
        breakpoints: times at which u is not smooth.
    """

    def __init__(self, evaluate: Callable[[Array], Array], breakpoints: ArrayLike) -> None:
        self._evaluate = evaluate
        self.breakpoints = np.asarray(breakpoints, dtype=float)

    def __call__(self, t: ArrayLike) -> Array:
        """u at t: (n,) for a number, (k, n) for (k,) times."""
        times = np.asarray(t, dtype=float)
        values = self._evaluate(np.atleast_1d(times))
        return values[0] if times.ndim == 0 else values

    def scaled(self, factor: Array) -> Controls:
        """factor * u(t), component by component."""
        return Controls(lambda t: self._evaluate(t) * factor, self.breakpoints)

    def plus(self, drift: Array) -> Controls:
        """u(t) + drift."""
        return Controls(lambda t: self._evaluate(t) + drift, self.breakpoints)


@dataclass(frozen=True)
class Plan:
    """A manoeuvre.

    Attributes:
        group, target, controls, duration: the task; controls are the labels of the actuated basis elements.
        method: the method that made it.
        u: u(t) -> (n,), vectorised.
        cost: int_0^duration |u|^2 dt; of objective="fuel" int sum_i w_i |u_i| dt.
        X_final: where the true system ends.
        error: |log(target^-1 X_final)|, on SO(3) the attitude error in rad.
        status: see `Status`.
        seconds: wall time spent, by stage.
        details: what the method adds (its parameters, starts tried, discretisation).
    """

    group: MatrixGroup = field(repr=False)
    target: Array = field(repr=False)
    controls: tuple[str, ...]
    duration: float
    method: str
    u: Controls = field(repr=False)
    cost: float
    X_final: Array = field(repr=False)
    error: float
    status: Status
    seconds: Mapping[str, float]
    details: Mapping[str, Any]

    @property
    def violation(self) -> Mapping[str, float]:
        """{condition: by how much it is missed}: the end, and bounds or clearances where there are any."""
        known: Mapping[str, float] = self.details.get("violation", {"end": self.error})
        return known

    def inputs(self, t: ArrayLike) -> Array:
        """What each control does: (m,) at a time, (k, m) at (k,) times; u(t) = sum_i inputs_i b_i(t), without the drift."""
        made = self.details.get("inputs")
        if made is not None:
            return np.asarray(made(t))
        return np.asarray(self.u(t)[..., [self.group.labels.index(label) for label in self.controls]])


class PlanOnDemand(Plan):
    """A plan whose end is simulated, and whose extremal is examined, when one of the results is first read.

    Both take a hundred times as long as the solution itself, and who steers in a loop reads the controls alone.
    """

    def __init__(self, examine: Callable[[], Plan], **known: Any) -> None:
        """`known`: the fields that are at hand; `examine` gives the whole plan."""
        for name, value in {**known, "_examine": examine}.items():
            object.__setattr__(self, name, value)

    def __getattr__(self, name: str) -> Any:
        """Only asked for fields that are not yet known."""
        if name not in Plan.__dataclass_fields__:
            raise AttributeError(f"a Plan has no attribute {name!r}")
        whole = self._examine()
        for each in Plan.__dataclass_fields__:
            object.__setattr__(self, each, getattr(whole, each))
        return getattr(whole, name)

    def __repr__(self) -> str:
        return repr(Plan(*self._values()))

    def __reduce__(self) -> tuple[Any, ...]:
        return Plan, self._values()

    def _values(self) -> tuple[Any, ...]:
        return tuple(getattr(self, name) for name in Plan.__dataclass_fields__)
