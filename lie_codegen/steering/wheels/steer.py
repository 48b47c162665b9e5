"""Steering in wheel speeds: by the methods of lc.steer, or with torques as the controls."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, SteeringInputError
from lie_codegen.groups.build import build
from lie_codegen.groups.change_of_basis import change_of_basis
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.mechanics.body_frame import body_frame
from lie_codegen.on_demand import sympy as sp
from lie_codegen.steering.front import steer
from lie_codegen.steering.ocp.front import ocp
from lie_codegen.steering.wheels.body import WheeledBody
from lie_codegen.steering.wheels.motion import axial_momenta, element_of
from lie_codegen.steering.wheels.plan import WheelPlan
from lie_codegen.steering.wheels.torque_problem import torque_problem

_INTERVALS, _STARTS = 40, 8


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
    times, torques = np.asarray(found.t), np.asarray(found.u)
    return WheelPlan.of_torques(system, goal, duration, start, times, torques, first, found.status)
