"""Attitude manoeuvres in wheel speeds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.codegen.parts import PackageParts
from lie_codegen.errors import InputError, SteeringInputError
from lie_codegen.groups.build import build
from lie_codegen.groups.change_of_basis import change_of_basis
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.body_frame import body_frame
from lie_codegen.on_demand import sympy as sp
from lie_codegen.steering.front import steer
from lie_codegen.steering.ocp.front import ocp
from lie_codegen.steering.plan import Plan, Status
from lie_codegen.steering.plan_table import PlanTable, plan_table
from lie_codegen.steering.wheels.body import WheeledBody
from lie_codegen.steering.wheels.motion import WheelRun, axial_momenta, element_of, under_torques
from lie_codegen.steering.wheels.package import system_parts
from lie_codegen.steering.wheels.torque_problem import torque_problem
from lie_codegen.values import Value

_INTERVALS, _STARTS = 40, 8
_POINTS = 401


@dataclass(frozen=True, eq=False, repr=False)
class WheelPlan(Saved):
    """A manoeuvre in wheel speeds.

    Attributes:
        system: body and wheels.
        target: element of the group.
        duration: [s].
        method: of `lc.steer`, or "torques" for the problem with speeds as states.
        start: attitude at t = 0.
        plan: what `lc.steer` returned, or the knots (t, speeds) of the problem with torques.
        status: see `Status`.
    """

    system: WheeledBody
    target: Array
    duration: float
    method: str
    start: Array
    plan: Plan | _Knots
    status: Status
    scale: Array = field(repr=False)

    def speeds(self, t: ArrayLike) -> Array:
        """(p,) at a time, (k, p) at (k,) times. [rad/s]"""
        if isinstance(self.plan, Plan):
            return np.asarray(self.plan.inputs(t) / self.scale)
        return self._flown(t).speeds if np.ndim(t) else self._flown(np.reshape(t, 1)).speeds[0]

    def torques(self, t: ArrayLike) -> Array:
        """(p,) at a time, (k, p) at (k,) times: j_i (O_i' + b_i . w'). Where speeds jump, motors would need an impulse, which is not in here. [N m]"""
        times = np.atleast_1d(np.asarray(t, dtype=float))
        if isinstance(self.plan, Plan):
            rates = self._rates(times)
            axial = np.array([float(j) for j in self.system.wheels.axial])
            found = axial * (rates + rates @ self.system.C.T @ self.system.axes.T)
        else:
            found = self.plan.torque_at(times)
        return np.asarray(found[0] if np.ndim(t) == 0 else found)

    def X(self, t: ArrayLike) -> Array:
        """(d, d) at a time, (k, d, d) at (k,) times: where the true body is."""
        if isinstance(self.plan, Plan):
            return self.plan.X(t)
        return self._flown(t).X if np.ndim(t) else self._flown(np.reshape(t, 1)).X[0]

    @cached_property
    def X_final(self) -> Array:
        """(d, d) where the true body ends."""
        return self.plan.X_final if isinstance(self.plan, Plan) else self.X(self.duration)

    @property
    def error(self) -> float:
        """The angle between the attitude reached and the target, in rad, whatever the basis."""
        return float(self.system.attitude_error(self.X_final, self.target))

    @cached_property
    def cost(self) -> float:
        """int |O|^2 dt. [rad^2/s]"""
        edges = self._table.edges if isinstance(self.plan, Plan) else self.plan.t
        nodes, weights = np.polynomial.legendre.leggauss(16)
        middle, half = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / 2
        t = middle[:, None] + half[:, None] * nodes
        squares = np.sum(self.speeds(t.ravel()) ** 2, axis=1).reshape(t.shape)
        return float(np.sum(half[:, None] * weights * squares))

    @cached_property
    def violation(self) -> Mapping[str, float]:
        """{"end": rad, "speeds": rad/s, "torques": N m}: what is missed, and by how much limits are exceeded at 401 times."""
        t = np.linspace(0, self.duration, _POINTS)
        found = {"end": self.error}
        limits = self.system.speed_limits, self.system.torque_limits
        for name, limit, values in zip(("speeds", "torques"), limits, (self.speeds, self.torques), strict=True):
            if limit is not None:
                found[name] = float(max(0.0, np.max(np.abs(values(t)) - limit)))
        return found

    def package_parts(self, name: str | None = None, real: str = "double", form: str | None = None) -> PackageParts:
        """The wheels as C; a plan of `lc.steer` also as speeds of time, in the units of its `scale`.

        Raises:
            InputError: form for a plan with torques, whose speeds are linear between knots.
        """
        own = system_parts(self.system, name)
        if not isinstance(self.plan, Plan):
            raise InputError("generate: a wheel plan with torques is kept as knots: plan.plan.t and plan.plan.torques")
        inner = self.plan.package_parts(own.namespace, real, form)
        return PackageParts(own.namespace, (*own.kernels, *inner.kernels), inner.files, has_forms=True)

    @cached_property
    def _table(self) -> PlanTable:
        if not isinstance(self.plan, Plan):
            raise InputError("a wheel plan with torques is kept as knots: plan.plan.t and plan.plan.torques")
        return plan_table(self.plan, "table")

    def _rates(self, times: Array) -> Array:
        """(k, p) O', at a jump that of the later piece."""
        table = self._table
        edges = table.edges
        piece = np.clip(np.searchsorted(edges, times, side="right") - 1, 0, len(edges) - 2)
        length = np.diff(edges)[piece]
        s = (2 * times - edges[piece] - edges[piece + 1]) / length
        slopes = np.empty((len(times), len(table.places)))
        for number in np.unique(piece):
            here = piece == number
            derivative = chebyshev.chebder(table.coefficients[number].T)
            slopes[here] = chebyshev.chebval(s[here], derivative).T * (2 / length[here])[:, None]
        full = np.zeros((len(times), len(self.system.group.labels)))
        full[:, list(table.places)] = slopes
        return self._speeds_of(full)

    def _speeds_of(self, u: Array) -> Array:
        """(k, p) wheel speeds (or their rates) of velocities (or theirs)."""
        p = self.system.count
        if p == self.system.rank and p <= 3:
            return np.asarray(u[:, :p] / self.scale)
        rate = u @ self.system.frame.T
        return np.asarray(-(rate @ self.system.inertia.T) @ np.linalg.pinv(self.system.momenta).T)

    def _flown(self, t: ArrayLike) -> WheelRun:
        """The true body under the torques of the knots, at the times."""
        knots = self.plan
        if isinstance(knots, Plan):
            raise InputError("a plan of lc.steer has speeds, no knots")
        times = np.asarray(t, dtype=float)
        if np.any(times < 0) or np.any(times > self.duration * (1 + 1e-9)):
            raise InputError(f"the plan is known on [0, {self.duration:g}]")
        every, place = np.unique(np.append(np.minimum(times, knots.t[-1]), knots.t), return_inverse=True)
        run = under_torques(self.system, knots.torque_at, every, self.start, knots.first, held=True)
        asked = place[: times.size]
        return replace(
            run,
            t=times,
            X=run.X[asked],
            omega=run.omega[asked],
            speeds=run.speeds[asked],
            momentum=run.momentum[asked],
            torques=None,
        )


@dataclass(frozen=True, eq=False, repr=False)
class _Knots(Value):
    """Motor torques that are held between knots.

    Attributes:
        t: (N + 1,) times. torques: (N, p). [N m]
        first: (p,) speeds at t = 0. [rad/s]
    """

    t: Array
    torques: Array
    first: Array

    def torque_at(self, times: Array) -> Array:
        """(k, p), at a knot that of the later interval."""
        place = np.clip(np.searchsorted(self.t, times, side="right") - 1, 0, len(self.torques) - 1)
        return np.asarray(self.torques[place])


def planned(
    system: WheeledBody,
    target: Any,
    duration: float,
    method: str,
    start: ArrayLike | None,
    rest: bool | None,
    options: dict[str, Any],
) -> WheelPlan:
    """`WheelSystem.steer`."""
    if system.rank < 2:
        raise InputError("momentum_wheels: one direction turns the body about one axis; steering takes two at least")
    if not (np.isfinite(duration) and duration > 0):
        raise SteeringInputError(f"momentum_wheels: duration must be positive, got {duration!r}")
    goal = _target(system, target)
    first = element_of(system, start)
    if rest or system.torque_limits is not None or np.any(system.stored):
        if method not in ("auto", "torques"):
            raise SteeringInputError(
                f"momentum_wheels: method {method!r} knows no torques, stored momentum or rest; take method='auto'"
            )
        return _with_torques(system, goal, duration, first, rest is not False, options)
    return _by_steer(system, goal, duration, method, first, options)


def _target(system: WheeledBody, target: Any) -> Array:
    value = np.asarray(target)
    if value.ndim == 1:
        return np.asarray(build(system.group).product_exp(value.astype(float)))
    return element_of(system, value)


def _by_steer(
    system: WheeledBody, goal: Array, duration: float, method: str, start: Array, options: dict[str, Any]
) -> WheelPlan:
    given = dict(options)
    if system.speed_limits is not None:
        given.setdefault("bounds", [float(limit) for limit in system.speed_limits])
    if not np.array_equal(start, np.eye(len(start))):
        given["start"] = start
    p = system.count
    if p != system.rank or p > 3:
        # more wheels than directions: each is a control vector of its own
        columns = list(np.linalg.solve(system.frame, system.C).T)
        if isinstance(given.get("bounds"), list):
            given["bounds"] = {f"u{i + 1}": limit for i, limit in enumerate(given["bounds"])}
        plan = steer(system.group, goal, columns, duration, method if method != "auto" else "direct", **given)
        return WheelPlan(system, goal, duration, plan.method, start, plan, plan.status, np.ones(p))
    group, scale = wheel_basis(system)
    if "bounds" in given:
        low_high = [_pair(each) for each in np.broadcast_to(np.asarray(given["bounds"], dtype=object), (p,))]
        given["bounds"] = {
            label: (low * s, high * s) for label, (low, high), s in zip(group.labels, low_high, scale, strict=False)
        }
    if np.any(scale != 1.0) and method in ("auto", "optimal", "direct", "transcription"):
        # irrational axes are kept rational in the basis; the weights make the cost that of the speeds again
        given["weights"] = list(np.asarray(given.get("weights", np.ones(p))) / scale**2)
    plan = steer(group, goal, group.labels[:p], duration, method, **given)
    return WheelPlan(system, goal, duration, plan.method, start, plan, plan.status, scale)


def _pair(bound: Any) -> tuple[float, float]:
    values = np.ravel(np.asarray(bound, dtype=float))
    return (-float(values[0]), float(values[0])) if values.size == 1 else (float(values[0]), float(values[1]))


def wheel_basis(system: WheeledBody) -> tuple[MatrixGroup, Array]:
    """The group in a basis whose first elements are the body rates of the wheels, and what its coordinates are of the speeds.

    Exact, and rational where inertias and directions are: a length sqrt(2) of an axis stands in the scale, not in the basis.
    """
    J_inverse = sp.Matrix(system.wheels.locked_inertia).inv()
    columns, scale = [], []
    for i, j in enumerate(system.wheels.axial):
        direction = sp.Matrix(system.directions.row(i)).T
        length = sp.sqrt(sp.expand(direction.dot(direction)))
        factor = j / length
        rational = factor if factor.is_rational else sp.Rational(float(factor)).limit_denominator(1000)
        if rational == 0:
            rational = sp.Integer(1)
        columns.append(-J_inverse * direction * rational)
        scale.append(float(factor / rational))
    if len(columns) == 2:
        columns.append(columns[0].cross(columns[1]))
    frame_inverse = sp.Matrix(body_frame(system.group, "momentum_wheels")).inv()
    names = [f"wheel{i + 1}" for i in range(system.count)] + ["free"] * (3 - system.count)
    labels = system.group.labels
    combinations = {
        name: dict(zip(labels, (frame_inverse * column).applyfunc(sp.expand), strict=True))
        for name, column in zip(names, columns, strict=True)
    }
    group = change_of_basis(system.group, combinations, name=f"{system.group.name}_wheels")
    return group, np.array(scale)


def _with_torques(
    system: WheeledBody, goal: Array, duration: float, start: Array, rest: bool, options: dict[str, Any]
) -> WheelPlan:
    known = {"intervals", "starts", "seed", "guess"}
    if set(options) - known:
        raise SteeringInputError(
            f"momentum_wheels: with torques, stored momentum or rest the options are {', '.join(sorted(known))}, "
            f"not {', '.join(sorted(set(options) - known))}"
        )
    first = system.rest_speeds(start)
    if rest:
        system.rest_speeds(goal)  # the wheels must hold the stored momentum there too
    intervals = int(options.get("intervals", _INTERVALS))
    problem = ocp("so3", **torque_problem(system, duration, intervals, rest))
    search: dict[str, Any] = {
        "starts": options.get("starts", _STARTS),
        **{k: options[k] for k in ("seed", "guess") if k in options},
    }
    momenta = axial_momenta(system, start, first)
    found = problem.solve(system.rotation(start), h=momenta, Rd=system.rotation(goal), **search)
    knots = _Knots(np.asarray(found.t), np.asarray(found.u), first)
    return WheelPlan(system, goal, duration, "torques", start, knots, found.status, np.ones(system.count))
