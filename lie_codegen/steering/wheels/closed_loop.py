"""Loops through wheels: starts, noise, what is desired, and the runs of the compiled step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.control.attitude_law import attitude_law
from lie_codegen.control.reference_kernels import reference_kernel
from lie_codegen.control.reference_motion import Reference
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.groups.build import build
from lie_codegen.groups.maps.element_pattern import packed_size
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.mechanics.states import initial_states
from lie_codegen.runtime.rows import row_by_row
from lie_codegen.steering.wheels.body import WheeledBody
from lie_codegen.steering.wheels.kernels import arguments_of
from lie_codegen.steering.wheels.loop import TRACKING, wheel_loop_step
from lie_codegen.steering.wheels.motion import (
    WheelRun,
    axial_momenta,
    element_of,
    unpacked_states,
    violation,
)

_ATTITUDE = ("X", "omega")


def closed_loop_of(
    system: WheeledBody,
    law: Kernel | None,
    t: ArrayLike,
    X0: ArrayLike | None,
    speeds0: ArrayLike | None,
    target: Any,
    reference: Reference | None,
    bandwidth: float,
    sample: float | None,
    substeps: int,
    noise: Any,
    seed: int,
    runs: int | None,
    threads: int,
) -> WheelRun:
    """`WheelSystem.closed_loop`."""
    if system.rank < 3:
        raise InputError(
            f"momentum_wheels: {system.count} wheels that span {system.rank} directions give no torque about every axis, and no "
            "continuous law holds an attitude with them; steer in steps, as lc.steer(method='feedback') does"
        )
    times, h, every = _samples(t, sample)
    made = _law(system, law, bandwidth)
    tracks = tuple(port.name for port in made.inputs) == TRACKING
    if tracks != (reference is not None):
        raise InputError(
            f"momentum_wheels: the law {made.name} {'needs a reference' if tracks else 'takes none, but a target'}"
        )
    kernel = wheel_loop_step(**arguments_of(system), law=made, substeps=int(substeps))
    step = build(kernel).wheel_loop_step
    starts, many = _starts(system, X0, speeds0, runs)
    count = every * (len(times) - 1)
    noises: dict[str, Any] = _noise(noise, seed, len(starts), count)
    desired = _desired(system, target, reference, times[0] + h * np.arange(count + 1))
    big = 1e300
    fixed: dict[str, Any] = {
        "stored": system.stored,
        "torque_limits": np.full(system.count, big) if system.torque_limits is None else system.torque_limits,
        "speed_limits": np.full(system.count, big) if system.speed_limits is None else system.speed_limits,
    }
    along: dict[str, Any] = {name: values[:-1][None] if tracks else values for name, values in desired.items()}
    states = step.scan_batch(starts, n=count, every=every, threads=threads, h=h, **fixed, **along, **noises)
    X, omega, speeds = unpacked_states(system, states)
    torques = _torques(step, states, {**fixed, **desired}, noises, every, h, tracks)
    goal = desired["target"][::every] if tracks else desired["target"]
    run = WheelRun(
        t=times,
        X=X,
        omega=omega,
        speeds=speeds,
        torques=torques,
        momentum=system.momentum(X, omega, speeds),
        error=system.attitude_error(X, goal),
        violation=violation(system, speeds, torques),
        steps=count * int(substeps),
    )
    return _by_times(run) if many else _only(run)


def _samples(t: ArrayLike, sample: float | None) -> tuple[Array, float, int]:
    times = np.asarray(t, dtype=float)
    gaps = np.diff(times) if times.ndim == 1 else np.empty(0)
    if not gaps.size or gaps[0] <= 0 or np.max(np.abs(gaps - gaps[0])) > 1e-9 * gaps[0] * len(times):
        raise InputError("momentum_wheels: t must increase in equal steps, as numpy.linspace gives them")
    gap = float(gaps.mean())
    every = 1 if sample is None else max(1, round(gap / float(sample)))
    if sample is not None and not abs(gap / every - float(sample)) <= 1e-6 * float(sample):
        raise InputError(f"momentum_wheels: the step of t, {gap:g} s, is no multiple of the sample, {sample:g} s")
    return times, gap / every, every


def _law(system: WheeledBody, law: Kernel | None, bandwidth: float) -> Kernel:
    if law is None:
        if system.group.degree != 3 or not np.array_equal(system.frame, np.eye(3)):
            raise InputError(
                f"momentum_wheels: attitude laws are laws on so3; give a tracking law on {system.group.name}"
            )
        if not bandwidth > 0:
            raise InputError(f"momentum_wheels: bandwidth must be positive, got {bandwidth!r}")
        moment = float(np.max(np.linalg.eigvalsh(system.inertia)))
        return attitude_law(
            "pd", inertia=system.inertia, k_p=moment * bandwidth**2, k_d=2 * moment * bandwidth, gyroscopic="none"
        )
    names = tuple(port.name for port in law.inputs) if isinstance(law, Kernel) else ()
    if names not in (_ATTITUDE, TRACKING):
        raise InputError(
            "momentum_wheels: law is a Kernel of (X, omega), as lc.attitude_law('pd', ...) makes it, or of (X, xi, X_d, xi_d, xi_d_dot), "
            f"as lc.tracking_law does; got {law!r:.60}"
        )
    return law


def _starts(
    system: WheeledBody, X0: ArrayLike | None, speeds0: ArrayLike | None, runs: int | None
) -> tuple[Array, bool]:
    group = system.group
    X = element_of(system, X0) if X0 is None or np.ndim(X0) < 3 else np.asarray(X0)
    elements = X if X.ndim == 3 else X[None]
    speeds = None if speeds0 is None else np.asarray(speeds0, dtype=float)
    if speeds is not None and (speeds.ndim not in (1, 2) or speeds.shape[-1] != system.count):
        raise ShapeError(f"momentum_wheels: speeds0 has shape {speeds.shape} for {system.count} wheels")
    count = max(len(elements), 1 if speeds is None or speeds.ndim == 1 else len(speeds), runs or 1)
    if any(n not in (1, count) for n in (len(elements), 1 if speeds is None or speeds.ndim == 1 else len(speeds))):
        raise ShapeError(f"momentum_wheels: {len(elements)} attitudes, {count} runs; give one each, or one for all")
    size = packed_size(group)
    packed = np.broadcast_to(initial_states(group, elements, None)[0][:, :size], (count, size))
    first = np.array([system.rest_speeds(each) for each in elements]) if speeds is None else np.atleast_2d(speeds)
    each = np.broadcast_to(elements, (count, *elements.shape[1:]))
    momenta = axial_momenta(system, each, np.broadcast_to(first, (count, system.count)))
    many = X.ndim == 3 or runs is not None or (speeds is not None and speeds.ndim == 2)
    return np.ascontiguousarray(np.concatenate([packed, momenta], axis=1)), many


def _noise(noise: Any, seed: int, runs: int, count: int) -> dict[str, Array]:
    given = dict(noise) if isinstance(noise, Mapping) else {} if noise is None else {"X": noise, "xi": noise}
    unknown = set(given) - {"X", "xi"}
    if unknown:
        raise InputError(
            f"momentum_wheels: noise of {', '.join(sorted(unknown))} is not known; give X [rad] and xi [rad/s]"
        )
    if not any(given.values()):
        return {"noise_X": np.zeros(3), "noise_xi": np.zeros(3)}
    drawn = np.empty((runs, count, 6))
    for k in range(runs):
        drawn[k] = np.random.default_rng((int(seed), k)).normal(size=(count, 6))
    return {
        "noise_X": np.ascontiguousarray(float(given.get("X", 0)) * drawn[..., :3]),
        "noise_xi": np.ascontiguousarray(float(given.get("xi", 0)) * drawn[..., 3:]),
    }


def _desired(system: WheeledBody, target: Any, reference: Reference | None, t: Array) -> dict[str, Array]:
    if reference is None:
        return {"target": element_of(system, target)}
    if reference.group != system.group:
        raise InputError(f"the reference is one of {reference.group.name}, not of {system.group.name}")
    X, xi, rate = row_by_row(build([reference_kernel(reference)]).reference, t)
    return {"target": X, "xi_d": xi, "xi_d_dot": rate}


def _torques(
    step: Any, states: Array, given: dict[str, Array], noises: dict[str, Array], every: int, h: float, tracks: bool
) -> Array:
    """What the motors give from each of the times on; at the last one what they would give."""
    runs, count = states.shape[:2]
    flat = np.ascontiguousarray(states.reshape(runs * count, -1))
    moving = {"target", "xi_d", "xi_d_dot"} if tracks else set()
    arguments = {
        name: np.tile(values[::every], (runs, *[1] * (values.ndim - 1))) if name in moving else values
        for name, values in given.items()
    }
    for name, values in noises.items():
        if values.ndim == 3:
            last = np.zeros((runs, 1, 3))  # nothing is measured after the end
            arguments[name] = np.concatenate([values[:, ::every], last], axis=1).reshape(runs * count, 3)
        else:
            arguments[name] = values
    found = step.batch(flat, h=h, **{name: np.ascontiguousarray(value) for name, value in arguments.items()})
    return np.asarray(found.torques).reshape(runs, count, -1)


def _by_times(run: WheelRun) -> WheelRun:
    """Times first, then runs, as `lc.closed_loop` has them."""
    names = ("X", "omega", "speeds", "torques", "momentum", "error")
    parts: dict[str, Any] = {name: np.ascontiguousarray(np.swapaxes(getattr(run, name), 0, 1)) for name in names}
    return replace(run, **parts)


def _only(run: WheelRun) -> WheelRun:
    parts = {name: getattr(run, name)[0] for name in ("X", "omega", "speeds", "torques", "momentum", "error")}
    return replace(run, **parts)
