"""Where a plan leads: the states of the true system under its controls, whatever kind of system it is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.flow.attitude_metrics import second_kind_along
from lie_codegen.flow.simulate import Simulated, simulate
from lie_codegen.flow.simulate_arguments import check_times, check_tolerance, initial_elements
from lie_codegen.flow.trajectory import Trajectory
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.mechanics.driven import Driven, simulate_driven
from lie_codegen.steering.direct.inputs import Drive
from lie_codegen.steering.direct.system import System
from lie_codegen.steering.plan import Controls, Plan, inside

#: Times between the ends at which coordinates are followed, whatever times were asked for.
_BETWEEN = 201


@dataclass(frozen=True, eq=False, repr=False)
class Replay(Trajectory):
    """A plan whose controls are no body velocities, flown: those of torques, and of right-invariant systems.

    Attributes:
        plan: what was flown.
        xi: (k, n) body velocities under torques; None of a right-invariant system, and of velocities that a user wrote.
    """

    plan: Simulated = field(kw_only=True, repr=False)
    xi: Array | None = field(kw_only=True, repr=False)

    def _flow(self, times: Array, start: Array) -> Array:
        return self.plan.__simulate__(None, t=times, X0=start, rtol=self.rtol).X[1:]

    @property
    def g(self) -> Array:
        """(k, n) Wei-Norman coordinates of X(t[0])^-1 X, from g = 0.

        Raises:
            ChartError: the chart ends on the way.
        """
        if self.X.ndim != 3:
            raise InputError(f"{self.group.name}: coordinates are of one trajectory; simulate it alone")
        # the coordinates are followed by Newton's method from sample to sample, which therefore lie close
        knots, place = np.unique(np.append(self.t, np.linspace(self.t[0], self.t[-1], _BETWEEN)), return_inverse=True)
        along = second_kind_along(self.group, np.linalg.solve(self.X[0], self.at(knots)))
        return np.asarray(along[place[: len(self.t)]])

    @property
    def charts(self) -> Any:
        """Not of these runs."""
        raise InputError(f"{self.group.name}: charts with restarts are of runs whose input is a body velocity")


def states(plan: Plan, t: Array) -> Array:
    """X (k, d, d) at increasing times (k,)."""
    return simulated(plan, t=t).X


def body_velocities(plan: Plan, t: Array) -> Array:
    """xi (k, n) with X' = X hat(xi) along the path of `states`, at times (k,) in any order.

    Of a right-invariant system X' = hat(a) X it is Ad(X^-1) a; under torques it is integrated with X.
    """
    details, system = plan.details, plan.details.get("system")
    if details.get("inertia") is not None or (system is not None and system.right):
        knots, place = np.unique(np.append(0.0, t), return_inverse=True)
        flown = simulated(plan, t=knots)
        if isinstance(flown, Replay) and flown.xi is not None:
            return np.asarray(flown.xi[place[1:]])
        X, a = flown.X[place[1:]], np.asarray(velocity_of(plan)(t))
        return plan.group.project(np.linalg.solve(X, np.tensordot(a, plan.group.basis, 1)) @ X)
    return np.asarray(velocity_of(plan)(t))


def velocity_of(plan: Plan) -> Controls:
    """The velocity that the controls and the drift make, on the side that the plan's system says."""
    system, drift = plan.details.get("system"), plan.details.get("drift")
    if system is not None:
        return Controls(Drive(system, plan.details["inputs"], True), plan.u.breakpoints)
    return plan.u if drift is None else plan.u.plus(np.asarray(drift, dtype=float))


def simulated(
    plan: Plan,
    group: MatrixGroup | None = None,
    *,
    t: ArrayLike | None = None,
    eps: ArrayLike = 1.0,
    X0: ArrayLike | None = None,
    **options: Any,
) -> Trajectory:
    """`lc.simulate` of a plan: its own system, from where the plan is at t[0] or from X0.

    The controls are torques where the plan names an inertia; else velocities, to which the drift is added, that act from the right
    of X, or from the left where the plan's system says so.

    Raises:
        InputError: another group than the plan's, a time outside [0, duration], eps, or an option that its system does not know.
    """
    times = replay_times(plan, plan.group, group, t, eps)
    details = plan.details
    system = details.get("system")
    if details.get("inertia") is None and (system is None or not system.right):
        return along(
            plan.group, velocity_of(plan), _start(plan) if system is None else system.start, times, X0, options
        )
    kind = "a right-invariant system" if details.get("inertia") is None else "torques"
    rtol = replay_tolerance(f"simulate({plan.group.name})", options, kind)
    return _replayed(plan, times, None if X0 is None else initial_elements(plan.group, X0), rtol)


def replay_times(plan: Any, own: MatrixGroup, group: MatrixGroup | None, t: ArrayLike | None, eps: ArrayLike) -> Array:
    """The times of a run of a plan, 101 from 0 to its duration if none are given.

    Raises:
        InputError: another group than the plan's own, a time outside [0, duration], eps.
    """
    if group is not None and group != own:
        raise InputError(f"simulate: the plan is one of {own.name}, not of {group.name}")
    if np.ndim(eps) or eps != 1.0:
        raise InputError(
            f"simulate({own.name}): a plan is simulated as it is; scaled, it is the input plan.u.scaled(eps)"
        )
    times = check_times(own, np.linspace(0.0, plan.duration, 101) if t is None else t)
    return inside(times, plan.duration)


def replay_tolerance(where: str, options: Mapping[str, Any], kind: str) -> float:
    """rtol of a run that knows no other option.

    Raises:
        InputError: another option of `simulate` than a tolerance.
    """
    given = dict(options)
    tolerances = {
        name: given.pop(name, default) for name, default in (("rtol", None), ("atol", 0.0), ("tolerance", None))
    }
    rtol = check_tolerance(where, **tolerances)
    stray = [name for name, value in given.items() if value not in (None, (), [], 1, "auto")]
    if stray or tolerances["atol"]:
        raise InputError(
            f"{where}: {', '.join(stray or ['atol'])} goes with body velocities; the plan is one of {kind}"
        )
    return rtol


def starts_of(group: MatrixGroup, X0: ArrayLike | None) -> tuple[list[Array | None], Callable[[list[Array]], Array]]:
    """The elements of N runs, None for where a plan is by itself, and what joins their results: (k, ...) each, (k, N, ...) of (N, d, d)."""
    elements = None if X0 is None else initial_elements(group, X0)
    if elements is None or elements.ndim == 2:
        return [elements], lambda results: results[0]
    return list(elements), lambda results: np.stack(results, axis=1)


def along(
    group: MatrixGroup,
    velocity: Any,
    start: Array | None,
    times: Array,
    X0: ArrayLike | None,
    options: Mapping[str, Any],
) -> Trajectory:
    """The run of a body velocity that is known from t = 0, where X is `start`: from where it is at times[0], or from X0 there."""
    if X0 is None and times[0] > 0:
        X0 = simulate(group, velocity, t=[0.0, times[0]], X0=start).X[-1]
    return simulate(group, velocity, t=times, X0=start if X0 is None else X0, **options)


def _start(plan: Plan) -> Array | None:
    start: Array | None = plan.details.get("start")
    return start


def _replayed(plan: Plan, times: Array, X0: Array | None, rtol: float) -> Replay:
    """From t = 0, where the plan's own velocity is known; X0 then moves the whole path, by the invariance of the system."""
    details = plan.details
    knots = times if times[0] == 0 else np.append(0.0, times)
    run: Driven | Trajectory
    if details.get("inertia") is not None:
        xi0, damping = details.get("start_velocity"), details.get("damping")
        run = simulate_driven(plan.group, plan.u, details["inertia"], t=knots, xi0=xi0, tolerance=rtol, damping=damping)
        path, xi, start = run.X, run.xi[len(knots) - len(times) :], _start(plan)
        error, method, evaluations, resolution = (
            run.error_estimate,
            "rkmk4" if damping is None else "DOP853",
            3 * run.steps,
            0.0,
        )
    else:
        system: System = details["system"]
        # the inverse of X' = hat(a) X is left-invariant: Y' = -Y hat(a)
        velocity = velocity_of(plan).scaled(-np.ones(plan.group.dim))
        run = simulate(plan.group, velocity, t=knots, rtol=rtol)
        path, xi, start = np.linalg.inv(run.X), None, system.start
        # the error of an inverse: |dX| = |X dY X|
        error = run.error_estimate * max(1.0, float(np.max(np.linalg.norm(path, 2, axis=(1, 2))))) ** 2
        method, evaluations, resolution = run.method, run.evaluations, run.resolution
    path = path[len(knots) - len(times) :]
    if X0 is not None:
        path = _from(X0, path, xi is None)
    elif start is not None:
        path = start @ path if xi is not None else path @ start
    return Replay(
        plan.group, times, path, run.steps, error, method, evaluations, resolution, (), None, rtol, 0,  # type: ignore[arg-type]
        plan=plan, xi=xi,
    )  # fmt: skip


def _from(X0: Array, path: Array, right: bool) -> Array:
    """The path that begins at X0, or the N paths that do: (k, d, d) or (k, N, d, d)."""
    since = path @ np.linalg.inv(path[0]) if right else np.linalg.solve(path[0], path)
    if X0.ndim == 3:
        since = since[:, None]
    return np.asarray(since @ X0 if right else X0 @ since)
