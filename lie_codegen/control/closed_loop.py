"""lc.closed_loop: a mechanical system on a group under a law, by a fourth-order Lie-group method in compiled loops."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Never, overload

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.control.loop_library import loop_library, loop_numbers, several
from lie_codegen.control.reference_check import check_reference
from lie_codegen.control.reference_motion import Reference
from lie_codegen.control.second_order_step import ForceBody, check_loop, law_parameters, law_states
from lie_codegen.errors import ComputationError, InputError, ShapeError
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.maps.element_pattern import packed_size
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.identifiers import unknown_keywords
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.states import initial_states, split_states
from lie_codegen.runtime.library import Library
from lie_codegen.runtime.patience import shows_progress

_MOST_STEPS = 2**21
_LARGEST_MOVE = 0.25
#: Steps for which the reference is held in memory at once.
_BLOCK = 20_000


@dataclass(frozen=True, eq=False, repr=False)
class ClosedLoop(Saved):
    """A solution of X' = X hat(xi), I xi' = ad*_xi I xi + f.

    Attributes:
        t: (k,) times.
        X: (k, d, d) configurations, on the group to rounding; (k, N, d, d) for N initial states.
        xi: (k, n) body velocities; (k, N, n).
        outputs: what the law gives along the way, by the names of its outputs (force or torque, phi, W, W_dot, V ...),
            and its own states (integral).
        X_d, xi_d: the reference, (k, d, d) and (k, n), or None.
        steps: number of integration steps.
        error_estimate: difference to the run with twice the step, over 15 (Richardson); NaN for a fixed step.
    """

    t: Array
    X: Array
    xi: Array
    outputs: dict[str, Array]
    X_d: Array | None
    xi_d: Array | None
    steps: int
    error_estimate: float


@overload
def closed_loop(
    group: GroupLike,
    *,
    inertia: Any,
    law: Kernel | None = None,
    reference: Reference | None = None,
    external: ForceBody | None = None,
    X0: ArrayLike | None = None,
    xi0: ArrayLike | None = None,
    t: ArrayLike,
    step: float | None = None,
    tolerance: float = 1e-10,
    gains: Mapping[str, ArrayLike] | None = None,
    threads: int = 1,
) -> ClosedLoop: ...


@overload
def closed_loop(
    *,
    mpc: Any,
    X0: ArrayLike | None = None,
    t: ArrayLike,
    values: Mapping[str, Any] | None = None,
    plant: Any = None,
    plant_values: Mapping[str, Any] | None = None,
    noise: Any = None,
    delay: int | None = None,
    compensate: bool | None = None,
    substeps: int | None = None,
    seed: int | None = None,
    runs: int | None = None,
) -> Any: ...


@shows_progress
def closed_loop(
    group: GroupLike | None = None,
    *,
    inertia: Any = None,
    law: Kernel | None = None,
    reference: Reference | None = None,
    external: ForceBody | None = None,
    X0: ArrayLike | None = None,
    xi0: ArrayLike | None = None,
    t: ArrayLike,
    step: float | None = None,
    tolerance: float = 1e-10,
    gains: Mapping[str, ArrayLike] | None = None,
    threads: int = 1,
    mpc: Any = None,
    values: Mapping[str, Any] | None = None,
    plant: Any = None,
    plant_values: Mapping[str, Any] | None = None,
    noise: Any = None,
    delay: int | None = None,
    compensate: bool | None = None,
    substeps: int | None = None,
    seed: int | None = None,
    runs: int | None = None,
    **unknown: Never,
) -> Any:
    """Simulates the second-order system, compiled; the law itself is the one that `generate` writes for flight.

    Args:
        group: any matrix group, its name or its file.
        inertia: symmetric positive definite: a number, a diagonal or a matrix, which is compiled in; or (N, n, n), one a loop:
            then it is an input of one compiled step.
        law: an attitude or tracking law, perhaps with states of its own, zero at the start: inputs behind the usual ones
            (integral) beside outputs that are their rates (integral_dot). None for an uncontrolled body.
        reference: for a tracking law.
        external: further body forces (ops, t, X, xi) -> (n,), as those of `underwater_forces`.
        X0: (d, d) or (N, d, d) initial configurations, the identity if not given.
        xi0: (n,) or (N, n) initial body velocities, zero if not given.
        t: (k,) equally spaced times.
        step: integration step [s]; None halves it until two runs agree to the tolerance.
        tolerance: on the entries of X and xi at the times t, for step None.
        gains: values of the law's numbers that are inputs (`k_p="input"`): name -> a number, or one a loop, (N, *shape). A
            law's `inertia` is that of the body unless it is given here.
        threads: over which many loops are shared out.
        mpc: a controller of `lc.mpc`, instead of group, inertia and law: its loop from t[0] to t[-1], a sample an interval;
            returns its LoopRun, or a tuple of them.
        values: with `mpc` alone, as what follows: states and parameters of the problem, by name.
        plant, plant_values: another problem (or Plant) that is really there, and its parameters; the controller's own if not given.
        noise: standard deviation of what is measured, 0 if not given.
        delay: samples between measurement and control, 0 if not given.
        compensate: whether the controller looks ahead over the delay, True if not given.
        substeps: integration steps of the plant a sample, 4 if not given.
        seed: of the noise, 0 if not given.
        runs: so many runs, of seeds in turn.

    Raises:
        InputError: an inertia that is not positive definite, a reference that jumps, a law without its reference or without a
            number that is an input of it.
        ShapeError: arrays of different numbers of loops.
        NotOnGroupError: X0 is off the group.
        ComputationError: the tolerance is not met with two million steps, or the state is no longer finite.
    """
    if unknown:
        known = set(inspect.signature(closed_loop).parameters) - {"unknown"}
        raise InputError(unknown_keywords("closed_loop", unknown, known))
    loop = {
        "values": values, "plant": plant, "plant_values": plant_values, "noise": noise, "delay": delay,
        "compensate": compensate, "substeps": substeps, "seed": seed, "runs": runs,
    }  # fmt: skip
    loop = {name: value for name, value in loop.items() if value is not None}
    times = _times(t)
    if mpc is not None:
        # the controller brings its own loop: it lives on a floor above this one
        return mpc.simulate(X0, duration=float(times[-1] - times[0]), **loop)
    if loop or group is None:
        said = f"{', '.join(loop)} without mpc=" if loop else "no group"
        raise InputError(
            f"closed_loop: {said}; without mpc= it takes a group, inertia, law, reference, external, X0, xi0, t"
        )
    group = as_group(group, "closed_loop")
    if not (law is None or isinstance(law, Kernel)):
        raise InputError(
            f"closed_loop: law is a Kernel, as lc.tracking_law or lc.attitude_law makes it, got {law!r:.60}"
        )
    if reference is not None and reference.group != group:
        raise InputError(f"the reference is one of {reference.group.name}, not of {group.name}")
    check_loop(law, reference)
    numbers, each, loops = loop_numbers(group, inertia, law, gains or {})
    lib = loop_library(group, "input" if "inertia_inverse" in numbers else inertia, law, reference, external)
    if reference is not None:
        check_reference(reference, float(times[0]), float(times[-1]), lib.reference)
    start, many = initial_states(group, X0, xi0)
    if loops is not None:
        start, many = several(start, loops), True
    if law is not None:
        own = sum(port.size for port in law_states(law))
        start = np.ascontiguousarray(np.concatenate([start, np.zeros((len(start), own))], axis=1))
    if step is not None:
        count = max(1, int(np.ceil((times[1] - times[0]) / step - 1e-9)))
        states, error = _run(lib, start, times, count, many, numbers, threads), float("nan")
    else:
        states, count, error = _refined(lib, start, times, many, tolerance, group, numbers, threads)
    X, xi = split_states(group, states)
    own_states = states[..., packed_size(group) + group.dim :]
    outputs, X_d, xi_d = _outputs(lib, law, reference, times, X, xi, own_states, many, each)
    return ClosedLoop(times, X, xi, outputs, X_d, xi_d, count * (len(times) - 1), error)


def _times(t: ArrayLike) -> Array:
    times = np.asarray(t, dtype=float)
    if times.ndim != 1 or len(times) < 2 or not np.all(np.isfinite(times)):
        raise ShapeError(f"closed_loop: t has shape {times.shape}; give at least two finite times")
    gaps = np.diff(times)
    if gaps[0] <= 0 or np.max(np.abs(gaps - gaps[0])) > 1e-9 * abs(gaps[0]) * len(times):
        raise InputError("closed_loop: t must increase in equal steps, as numpy.linspace gives them")
    return times


def _run(
    lib: Library, start: Array, times: Array, every: int, many: bool, numbers: Mapping[str, Array], threads: int
) -> Array:
    """(k, N, m) or (k, m) states at the times, `every` steps from one to the next."""
    total = every * (len(times) - 1)
    h = (times[-1] - times[0]) / total
    block = every * max(1, _BLOCK // every)
    states = [start[None] if many else start[0][None]]
    for first in range(0, total, block):
        count = min(block, total - first)
        stages = _stages(lib, times[0] + h * first, h, count)
        clock = times[0] + h * (first + np.arange(count))
        if many:
            states.append(
                _advance_all(lib, np.ascontiguousarray(states[-1][-1]), clock, h, stages, every, numbers, threads)
            )
        else:
            run = lib.second_order_step.scan(states[-1][-1], n=count, every=every, t=clock, h=h, **stages, **numbers)
            states.append(np.asarray(run)[1:])
    return np.concatenate(states)


def _stages(lib: Library, start: float, h: float, count: int) -> dict[str, Array]:
    """The reference at the ends and the middle of each step, as the step takes it; nothing for other laws."""
    names = [port.name for port in lib.second_order_step.inputs[3:6] if port.name in ("X_d", "xi_d", "xi_d_dot")]
    if not names:
        return {}
    X, xi, rate = lib.reference.batch(start + h / 2 * np.arange(2 * count + 1))
    flat = (X.reshape(len(X), -1), xi, rate)
    return {
        name: np.ascontiguousarray(np.stack([values[:-1:2], values[1::2], values[2::2]], axis=1))
        for name, values in zip(names, flat, strict=True)
    }


def _advance_all(
    lib: Library,
    current: Array,
    clock: Array,
    h: float,
    stages: dict[str, Array],
    every: int,
    numbers: Mapping[str, Array],
    threads: int,
) -> Array:
    """(count / every, N, m) states of many runs."""
    shared: dict[str, Any] = {name: values[None] for name, values in stages.items()}
    step = lib.second_order_step
    runs = step.scan_batch(current, n=len(clock), every=every, threads=threads, t=clock[None], h=h, **shared, **numbers)
    return np.ascontiguousarray(np.moveaxis(runs[:, 1:], 0, 1))


def _refined(
    lib: Library,
    start: Array,
    times: Array,
    many: bool,
    tolerance: float,
    group: MatrixGroup,
    numbers: Mapping[str, Array],
    threads: int,
) -> tuple[Array, int, float]:
    every, previous = 1, None
    gap = times[1] - times[0]
    while every * (len(times) - 1) <= _MOST_STEPS:
        states = _run(lib, start, times, every, many, numbers, threads)
        speed = np.max(np.abs(states[..., packed_size(group) :])) if np.all(np.isfinite(states)) else np.inf
        if previous is not None and np.isfinite(speed):
            error = float(np.max(np.abs(states - previous))) / 15
            if error <= tolerance and speed * gap / every <= _LARGEST_MOVE:
                return states, every, error
        previous = states if np.isfinite(speed) else None
        every *= 2
    raise ComputationError(
        f"closed_loop({group.name}): {_MOST_STEPS} steps do not bring the error below {tolerance:g}, or the state grows "
        "without bound; shorten the time, loosen the tolerance, or check the gains"
    )


def _outputs(
    lib: Library,
    law: Kernel | None,
    reference: Reference | None,
    times: Array,
    X: Array,
    xi: Array,
    own_states: Array,
    many: bool,
    numbers: Mapping[str, Array],
) -> tuple[dict[str, Array], Array | None, Array | None]:
    X_d = xi_d = None
    arguments: list[Array] = []
    shape = X.shape[:-2]
    if reference is not None:
        X_d, xi_d, rate = lib.reference.batch(times)
        arguments = [np.repeat(x, shape[1], axis=0) if many else x for x in (X_d, xi_d, rate)]
    if law is None:
        return {}, X_d, xi_d
    flat = [np.ascontiguousarray(x.reshape(-1, *x.shape[len(shape) :])) for x in (X, xi)]
    ports = law_states(law)
    ends = np.cumsum([port.size for port in ports], dtype=int)
    own = (
        dict(zip((port.name for port in ports), np.split(own_states, ends[:-1], axis=-1), strict=True)) if ports else {}
    )
    parts: dict[str, Any] = {name: np.ascontiguousarray(z.reshape(-1, z.shape[-1])) for name, z in own.items()}
    tuned: dict[str, Any] = {p.name: _repeated(p, numbers[p.name], len(times)) for p in law_parameters(law)}
    values = lib[law.name].batch(*flat, *arguments, **parts, **tuned)
    names = [port.name for port in law.outputs]
    given = {key: v.reshape(*shape, *v.shape[1:]) for key, v in zip(names, values, strict=True)}
    return {**given, **own}, X_d, xi_d


def _repeated(port: Port, values: Array, times: int) -> Array:
    """One a sample of all loops at all times, where there is one a loop."""
    return values if values.ndim == len(port.shape) else np.tile(values, (times, *[1] * len(port.shape)))
