"""Plan: what steering returns, whatever the method."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property
from importlib import import_module
from math import isfinite
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.codegen.parts import PackageParts
from lie_codegen.errors import InputError, NotFiniteError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.saved import Saved, json_value, table_text
from lie_codegen.values import Value, settle
from lie_codegen.whole_files import write_whole

#: What writes a plan as C stands above this file, and is loaded when it is asked for.
PACKAGE = "lie_codegen.steering.plan_package"
#: What simulates a plan, the same.
PATH = "lie_codegen.steering.plan_path"
#: Times beyond the ends, relative to the duration, that are rounding.
_ROUNDING = 1e-9


class Status(Enum):
    """How a plan ended; the value says what it means for the user."""

    SOLVED = "solved: the end and every condition are met to the tolerance"
    APPROXIMATE = "approximate: the method reaches the target up to its own order; see .error"
    LOCAL = "solved: a local minimum of the objective, the best of the starts tried; more starts may find a better one"
    EXTREMAL = (
        "solved: an extremal with a conjugate point inside, so no local minimum; more starts may find a better one"
    )
    NOT_FOUND = "not found: the nearest of the starts tried, see .violation; that none exists is not proved"
    NOT_CONVERGED = "not converged: the best found is returned, see .error; more starts may find more"

    ADMISSIBLE = "admissible: all conditions are met, the iteration limit was reached before the cost settled"
    NOT_ADMISSIBLE = "not admissible: a condition is violated; see .worst and .violation"
    DIVERGED = "diverged: the first trajectory is not finite; give another guess"

    def __str__(self) -> str:
        return self.value


class Law(Protocol):
    """u(t) as plain data: a frozen record that is called with (k,) times and gives (k, n)."""

    def __call__(self, t: Array) -> Array:
        """(k,) times -> (k, n)."""


def inside(times: Array, duration: float | None) -> Array:
    """The times at which the controls of a plan are known; what rounding put beyond the ends is at the ends. None is a duration without end.

    Raises:
        NotFiniteError, InputError: a time that is none, or outside [0, duration].
    """
    if not times.size:
        return times
    first, last = float(times.min()), float(times.max())  # NaN where one is
    if not (isfinite(first) and isfinite(last)):
        raise NotFiniteError("u(t): a time is NaN or infinite")
    if duration is None:
        return times
    slack = _ROUNDING * duration
    if first < -slack or last > duration + slack:
        outside = first if first < -slack else last
        raise InputError(f"u(t) is known on [0, {duration:g}]; t = {outside:g} is outside")
    return np.asarray(times.clip(0.0, duration))


@dataclass(frozen=True, eq=False, repr=False)
class Controls(Value):
    """u(t) on all n components (zeros where there is no control), for a float or an array of times.

    Attributes:
        law: what is evaluated, plain data.
        breakpoints: times at which u is not smooth.
        duration: u is known on [0, duration]; None where it is at all times.
    """

    law: Law
    breakpoints: Any = ()
    duration: float | None = None

    def __post_init__(self) -> None:
        settle(self, breakpoints=np.asarray(self.breakpoints, dtype=float))

    def __call__(self, t: ArrayLike) -> Array:
        """u at t: (n,) for a number, (k, n) for (k,) times.

        Raises:
            NotFiniteError: a time is NaN or infinite.
            InputError: a time is outside [0, duration].
        """
        times = np.asarray(t, dtype=float)
        values = self.law(inside(np.atleast_1d(times), self.duration))
        return values[0] if times.ndim == 0 else values

    def over(self, duration: float) -> Controls:
        """The same, known on [0, duration] alone."""
        return replace(self, duration=float(duration))

    def scaled(self, factor: Array) -> Controls:
        """factor * u(t), component by component."""
        return replace(self, law=Scaled(self.law, factor))

    def plus(self, drift: Array) -> Controls:
        """u(t) + drift."""
        return replace(self, law=Shifted(self.law, drift))


@dataclass(frozen=True, eq=False, repr=False)
class Scaled(Value):
    """factor * law(t)."""

    law: Law
    factor: Any

    def __call__(self, t: Array) -> Array:
        """(k,) times -> (k, n)."""
        return np.asarray(self.law(t) * self.factor)


@dataclass(frozen=True, eq=False, repr=False)
class Shifted(Value):
    """law(t) + drift."""

    law: Law
    drift: Any

    def __call__(self, t: Array) -> Array:
        """(k,) times -> (k, n)."""
        return np.asarray(self.law(t) + self.drift)


class UnitLaw(Protocol):
    """Controls over unit time as plain data: (k,) numbers in [0, 1] -> (k, m)."""

    def __call__(self, s: Array) -> Array:
        """(k,) -> (k, m)."""


@dataclass(frozen=True, eq=False, repr=False)
class Stretched(Value):
    """m controls over unit time, slowed down to a duration and set among n components: u(t) = unit(t/T)/T."""

    n: int
    controls: tuple[int, ...]
    unit: UnitLaw
    duration: float

    def __call__(self, t: Array) -> Array:
        """(k,) times -> (k, n)."""
        u = np.zeros((len(t), self.n))
        u[:, list(self.controls)] = self.unit(t / self.duration) / self.duration
        return u


@dataclass(frozen=True, eq=False, repr=False)
class Facts(Value):
    """What is known of a plan once its end was simulated and its extremal examined.

    Attributes:
        X_final: where the true system ends.
        error: |log(target^-1 X_final)|.
        status: see `Status`.
        details: what the method adds.
        seconds: wall time spent, by stage; of no account in comparisons.
    """

    X_final: Array
    error: float
    status: Status
    details: Mapping[str, Any]
    seconds: Mapping[str, float] = field(default_factory=dict, compare=False)

    def of(self, plan: Plan) -> Facts:
        """Itself."""
        return self


class Outcome(Protocol):
    """The facts of a plan, or what they follow from: plain data."""

    def of(self, plan: Plan) -> Facts:
        """The facts of the plan."""


@dataclass(frozen=True, eq=False, repr=False)
class Plan(Saved):
    """A manoeuvre: plain data. Facts that take longer to find than the plan itself (the end of the true system, conjugate
    points) are found when first read.

    Attributes:
        group, target, controls, duration: the task; controls are the labels of the actuated basis elements.
        method: the method that made it.
        u: u(t) -> (n,), vectorised, on [0, duration].
        cost: int_0^duration |u|^2 dt; of objective="fuel" int sum_i w_i |u_i| dt.
        outcome: status, seconds and details, or what they follow from when they are first read.
        projected: Frobenius distance from the target that was given to `target`, its projection onto the group; 0.0 where
            it was on the group.
        X_final: where the true system ends.
        error: |log(target^-1 X_final)|, on SO(3) the attitude error in rad.
        status: see `Status`.
        seconds: wall time spent, by stage.
        details: what the method adds (its parameters, starts tried, discretisation).
    """

    group: MatrixGroup
    target: Array
    controls: tuple[str, ...]
    duration: float
    method: str
    u: Controls
    cost: float
    outcome: Outcome = field(repr=False)
    projected: float = 0.0

    def __post_init__(self) -> None:
        if self.u.duration != self.duration:
            settle(self, u=self.u.over(self.duration))

    @cached_property
    def facts(self) -> Facts:
        """All that is not known at once."""
        return self.outcome.of(self)

    @property
    def X_final(self) -> Array:
        """(d, d) where the true system ends."""
        return self.facts.X_final

    @property
    def error(self) -> float:
        """|log(target^-1 X_final)|, Euclidean in the basis."""
        return self.facts.error

    @property
    def status(self) -> Status:
        """How the plan ended."""
        return self.facts.status

    @property
    def seconds(self) -> Mapping[str, float]:
        """Wall time spent, by stage."""
        return self.facts.seconds

    @property
    def details(self) -> Mapping[str, Any]:
        """What the method adds."""
        return self.facts.details

    @property
    def violation(self) -> Mapping[str, float]:
        """{condition: by how much it is missed}: the end, and bounds or clearances where there are any."""
        known: Mapping[str, float] = self.details.get("violation", {"end": self.error})
        return known

    def X(self, t: ArrayLike) -> Array:
        """The true system under u, from where the plan starts.

        Args:
            t: a time or (k,) times in [0, duration].

        Returns:
            (d, d) at a time, (k, d, d) at (k,) times.

        Raises:
            InputError: a time is outside [0, duration].
        """
        times = np.asarray(t, dtype=float)
        self.u(times.ravel())  # refuses times outside
        knots, place = np.unique(np.append(times.ravel(), [0.0, self.duration]), return_inverse=True)
        path = import_module(PATH).states(self, knots)
        found: Array = path[place[: times.size]].reshape(*times.shape, *path.shape[1:])
        return found

    def xi(self, t: ArrayLike) -> Array:
        """(n,) at a time, (k, n) at (k,) times: the body velocity of X(t), X' = X hat(xi), whatever the controls are.

        It is u + drift where the controls are velocities, Ad(X^-1) of that for a right-invariant system, and integrated under torques.

        Raises:
            InputError: a time is outside [0, duration].
        """
        times = np.asarray(t, dtype=float)
        self.u(times.ravel())  # refuses times outside
        found: Array = import_module(PATH).body_velocities(self, times.ravel()).reshape(*times.shape, self.group.dim)
        return found

    def __simulate__(self, group: MatrixGroup | None, **options: Any) -> Any:
        """`lc.simulate` of this plan."""
        return import_module(PATH).simulated(self, group, **options)

    def to_csv(self, path: str | Path | None = None, *, t: ArrayLike | None = None) -> str:
        """The controls as a table: t and one column a component.

        Args:
            path: written there, if given.
            t: (k,) times; 101 equal ones if not given.

        Returns:
            The text.

        Raises:
            InputError: a time is outside [0, duration].
            OutputFolderError, SystemRefusalError: the file cannot be written.
        """
        times = np.linspace(0.0, self.duration, 101) if t is None else np.atleast_1d(np.asarray(t, dtype=float))
        values = self.u(times)
        text = table_text({"t": times, **{f"u_{label}": values[:, i] for i, label in enumerate(self.group.labels)}})
        if path is not None:
            write_whole(path, text)
        return text

    def to_json(self, path: str | Path | None = None) -> str:
        """All facts of the plan and its controls at 101 times as JSON, for other programs (`save` and `lc.load` keep the plan).

        Args:
            path: written there, if given.

        Returns:
            The text.

        Raises:
            OutputFolderError, SystemRefusalError: the file cannot be written.
        """
        times = np.linspace(0.0, self.duration, 101)
        record = {
            "group": self.group.name,
            "labels": self.group.labels,
            "target": self.target,
            "controls": self.controls,
            "duration": self.duration,
            "method": self.method,
            "cost": self.cost,
            "error": self.error,
            "status": self.status,
            "projected": self.projected,
            "X_final": self.X_final,
            "details": self.details,
            "t": times,
            "u": self.u(times),
        }
        text = json.dumps(json_value(record), indent=1)
        if path is not None:
            write_whole(path, text)
        return text

    def package_parts(self, name: str | None = None, real: str = "double", form: str | None = None) -> PackageParts:
        """The controls as C with a program that runs them, as `lc.generate(plan, folder)` writes them.

        Args:
            name: of the package, by the group and the method if None.
            real: "double" or "float".
            form: "auto", "table" or "fourier"; None is "auto".

        Raises:
            InputError: no such form, or "fourier" of controls that are no Fourier series over the duration.
            ComputationError: the controls are not smooth between their breakpoints.
        """
        parts: PackageParts = import_module(PACKAGE).plan_parts(self, name, real, form or "auto")
        return parts

    def _repr_html_(self) -> str:
        """In a notebook: the few lines of its repr, and a small picture of what its controls do."""
        from html import escape

        from lie_codegen.steering.plan_sketch import moments, sketch

        t = moments(self.duration)
        curves = self.inputs(t).reshape(t.size, -1)
        columns = curves.shape[1]
        names = self.controls if len(self.controls) == columns else [f"u{i + 1}" for i in range(columns)]
        return f"<pre>{escape(repr(self))}</pre>{sketch(t, curves, names)}"

    def inputs(self, t: ArrayLike) -> Array:
        """What each control does: u(t) = sum_i inputs_i b_i(t), without the drift.

        Args:
            t: a time or (k,) times in [0, duration].

        Returns:
            (m,) at a time, (k, m) at (k,) times.

        Raises:
            InputError: a time is outside [0, duration].
        """
        made = self.details.get("inputs")
        if made is not None:
            return np.asarray(made(t))
        return np.asarray(self.u(t)[..., [self.group.labels.index(label) for label in self.controls]])
