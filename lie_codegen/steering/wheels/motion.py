"""The motion of a body under wheel speeds or motor torques given in time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError, InputError, ShapeError
from lie_codegen.flow.formulas import formula_input
from lie_codegen.groups.build import build
from lie_codegen.groups.catalogue_load import as_group
from lie_codegen.groups.maps.admission import admitted
from lie_codegen.groups.maps.element_pattern import packed_size
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.states import initial_states, split_states
from lie_codegen.signals.periodic_input import PeriodicInput
from lie_codegen.steering.wheels.body import WheeledBody
from lie_codegen.steering.wheels.kernels import arguments_of, wheel_speed_step, wheel_torque_step

#: Steps at most, and |h w| at most: there the exponential of a step is exact to rounding.
_MOST_STEPS, _LARGEST_MOVE = 2**20, 0.25


@dataclass(frozen=True, eq=False, repr=False)
class WheelRun(Saved):
    """A motion with wheels; of N runs with an axis of runs behind that of the times.

    Attributes:
        t: (k,) times.
        X: (k, d, d) attitudes; (k, N, d, d) of N runs, and so on below.
        omega: (k, 3) body rates in body axes. [rad/s]
        speeds: (k, p) wheel speeds. [rad/s]
        torques: (k, p) motor torques at the times, or None where speeds were given and have no rate. [N m]
        momentum: (k, 3) total angular momentum in space. [N m s]
        error: (k,) angle from the attitude asked for, in rad, or None.
        violation: {"speeds": .., "torques": ..} by how much limits are exceeded at the times; 0.0 where they are kept.
        steps: integration steps; error_estimate: on the entries of X, NaN for a loop.
    """

    t: Array
    X: Array
    omega: Array
    speeds: Array
    torques: Array | None
    momentum: Array
    error: Array | None = None
    violation: dict[str, float] = field(default_factory=dict)
    steps: int = 0
    error_estimate: float = float("nan")


def simulated(
    system: WheeledBody,
    speeds: Any,
    torques: Any,
    t: ArrayLike,
    X0: ArrayLike | None,
    speeds0: ArrayLike | None,
    tolerance: float,
) -> WheelRun:
    """`WheelSystem.simulate`."""
    if (speeds is None) == (torques is None):
        raise InputError("momentum_wheels: simulate takes wheel speeds, or torques of the motors: one of the two")
    times = np.asarray(t, dtype=float)
    if times.ndim != 1 or len(times) < 2 or not np.all(np.isfinite(times)) or not np.all(np.diff(times) > 0):
        raise InputError("momentum_wheels: t holds at least two finite, increasing times")
    start = element_of(system, X0)
    given = wheel_signal(system, speeds if torques is None else torques, times)
    if torques is None:
        return _under_speeds(system, given, times, start, tolerance)
    first = system.rest_speeds(start) if speeds0 is None else np.asarray(speeds0, dtype=float)
    if first.shape != (system.count,):
        raise ShapeError(f"momentum_wheels: speeds0 has shape {first.shape} for {system.count} wheels")
    return under_torques(system, given, times, start, first, tolerance)


def element_of(system: WheeledBody, X: ArrayLike | None) -> Array:
    """An element of the group: the identity, one given, or on SU(2) one of the two of a rotation.

    Raises:
        NotOnGroupError, ShapeError: it is none.
    """
    group = system.group
    if X is None:
        return np.eye(group.degree, dtype=complex if group.is_complex else float)
    value = np.asarray(X)
    if group.degree == 2 and value.shape == (3, 3):
        lib = build("so3")
        return np.asarray(
            build(group).exp(np.linalg.solve(system.frame, lib.log(lib.renormalise(value.astype(float)))))
        )
    return np.asarray(admitted(group, value, "X0").X)


def wheel_signal(system: WheeledBody, given: Any, times: Array) -> Callable[[Array], Array]:
    """(k,) times -> (k, p).

    Raises:
        ShapeError: not p components.
    """
    p = system.count
    if isinstance(given, PeriodicInput):
        if given.dim != p:
            raise ShapeError(f"momentum_wheels: {given.dim} components for {p} wheels")
        return lambda s: np.asarray(given(s), dtype=float).reshape(len(s), p)
    if isinstance(given, list | tuple) and given and all(isinstance(each, str) for each in given):
        if len(given) != p:
            raise ShapeError(f"momentum_wheels: {len(given)} formulas for {p} wheels")
        return formula_input(as_group(f"r{p}"), given)
    if callable(given):

        def called(s: Array) -> Array:
            values = np.array([np.asarray(given(float(x)), dtype=float) for x in s])
            if values.shape != (len(s), p):
                raise ShapeError(f"momentum_wheels: the function of t gives shape {values.shape[1:]} for {p} wheels")
            return values

        return called
    array = np.asarray(given, dtype=float)
    if array.shape == (p,):
        return lambda s: np.broadcast_to(array, (len(s), p))
    if array.shape != (len(times), p):
        raise ShapeError(
            f"momentum_wheels: shape {array.shape} for {p} wheels at {len(times)} times; give ({p},) or one row a time"
        )
    return lambda s: np.stack([np.interp(s, times, array[:, i]) for i in range(p)], axis=1)


def _stages(given: Callable[[Array], Array], times: Array, every: int, held: bool = False) -> tuple[Array, list[Array]]:
    """Lengths of the steps, and the input at their beginnings, middles and ends; at the middle alone where it is held."""
    knots = np.concatenate(
        [[times[0]], (times[:-1, None] + np.diff(times)[:, None] * np.arange(1, every + 1) / every).ravel()]
    )
    h = np.diff(knots)
    if held:
        return h, [np.ascontiguousarray(given(knots[:-1] + h / 2))] * 3
    values = given(np.concatenate([knots[:-1], knots[:-1] + h / 2, knots[1:]]))
    return h, [np.ascontiguousarray(part) for part in np.split(values, 3)]


def _refined(
    run: Callable[[int], Array], times: Array, speed: Callable[[Array], float], tolerance: float
) -> tuple[Array, int, float]:
    """Steps halved until two runs agree; each halving divides the error by 16."""
    every, before = 1, None
    while every * (len(times) - 1) <= _MOST_STEPS:
        found = run(every)
        if before is not None and speed(found) * float(np.max(np.diff(times))) / every <= _LARGEST_MOVE:
            error = float(np.max(np.abs(found - before))) / 15
            if error <= tolerance:
                return found, every, error
        before, every = found, 2 * every
    raise ComputationError(f"momentum_wheels: {_MOST_STEPS} steps do not bring the error below {tolerance:g}")


def _under_speeds(
    system: WheeledBody, given: Callable[[Array], Array], times: Array, start: Array, tolerance: float
) -> WheelRun:
    step = build(wheel_speed_step(**arguments_of(system))).wheel_speed_step
    speeds = given(times)

    def run(every: int) -> Array:
        h, (a, b, c) = _stages(given, times, every)
        return np.asarray(step.scan(start, system.stored, a, b, c, h, n=len(h), every=every))

    X, every, error = _refined(run, times, lambda X: _largest(system.body_rate(speeds, X)), tolerance)
    omega = system.body_rate(speeds, X)
    return WheelRun(
        t=times,
        X=X,
        omega=omega,
        speeds=np.array(speeds),
        torques=None,
        momentum=system.momentum(X, omega, speeds),
        violation=violation(system, speeds, None),
        steps=every * (len(times) - 1),
        error_estimate=error,
    )


def under_torques(
    system: WheeledBody,
    given: Callable[[Array], Array],
    times: Array,
    start: Array,
    first: Array,
    tolerance: float = 1e-9,
    held: bool = False,
) -> WheelRun:
    """The motion from an attitude and wheel speeds under torques of time; `held` where they are constant between the times."""
    step = build(wheel_torque_step(**arguments_of(system))).wheel_torque_step
    size = packed_size(system.group)
    momenta = axial_momenta(system, start, first)
    packed = np.concatenate([initial_states(system.group, start, None)[0][0][:size], momenta])

    def run(every: int) -> Array:
        h, (a, b, c) = _stages(given, times, every, held)
        return np.asarray(step.scan(packed, system.stored, a, b, c, h, n=len(h), every=every))

    def speed(states: Array) -> float:
        return _largest(unpacked_states(system, states)[1])

    states, every, error = _refined(run, times, speed, tolerance)
    X, omega, speeds = unpacked_states(system, states)
    torques = np.array(given(times))
    return WheelRun(
        t=times,
        X=X,
        omega=omega,
        speeds=speeds,
        torques=torques,
        momentum=system.momentum(X, omega, speeds),
        violation=violation(system, speeds, torques),
        steps=every * (len(times) - 1),
        error_estimate=error,
    )


def _largest(omega: Array) -> float:
    return float(np.max(np.linalg.norm(omega, axis=-1)))


def axial_momenta(system: WheeledBody, X: Array, speeds: Array) -> Array:
    """h_i = j_i (b_i . w + O_i)."""
    axial = np.array([float(j) for j in system.wheels.axial])
    return np.asarray(axial * (system.body_rate(speeds, X) @ system.axes.T + speeds))


def unpacked_states(system: WheeledBody, states: Array) -> tuple[Array, Array, Array]:
    """X, body rates and wheel speeds of packed states (X, axial momenta)."""
    size = packed_size(system.group)
    padded = np.concatenate([states[..., :size], np.zeros((*states.shape[:-1], system.group.dim))], axis=-1)
    X, _ = split_states(system.group, padded)
    momenta = states[..., size:]
    axial = np.array([float(j) for j in system.wheels.axial])
    floating = system.inertia - (system.axes.T * axial) @ system.axes
    carried = np.swapaxes(system.rotation(X), -1, -2) @ system.stored
    omega = (carried - momenta @ system.axes) @ np.linalg.inv(floating).T
    return X, omega, momenta / axial - omega @ system.axes.T


def violation(system: WheeledBody, speeds: Array, torques: Array | None) -> dict[str, float]:
    """By how much the limits are exceeded."""
    found = {}
    for name, values, limits in (
        ("speeds", speeds, system.speed_limits),
        ("torques", torques, system.torque_limits),
    ):
        if limits is not None and values is not None:
            found[name] = float(max(0.0, np.max(np.abs(values) - limits)))
    return found
