"""lc.simulate: X' = X hat(eps u(t)) on the group, by Magnus steps in compiled loops."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, TypeGuard, cast

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.door import warn_caller
from lie_codegen.errors import InputError, NotFiniteError, ShapeError, SlowWarning
from lie_codegen.flow.events import Event, EventHits, event_function
from lie_codegen.flow.events import Function as EventFunction
from lie_codegen.flow.feedback_law import Feedback, as_feedback
from lie_codegen.flow.inputs import Signal, as_drive, as_signal, drive_signal
from lie_codegen.flow.libraries import step_of
from lie_codegen.flow.magnus.run import MOST_STEPS, MagnusRun, fixed_run, magnus_run, order_for
from lie_codegen.flow.refined import refined
from lie_codegen.flow.trajectory import Trajectory
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.maps.admission import admitted, admitted_all
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.runtime.patience import shows_progress

_FOURTH_ORDER = ("rkmk4", "commutator_free")
METHODS = ("auto", "magnus8", "magnus6", "magnus4", *_FOURTH_ORDER)
_DEFAULT, _SMALLEST = 1e-11, 1e-14


class Simulated(Protocol):
    """What knows its own system, as a plan does."""

    def __simulate__(self, group: MatrixGroup | None, **options: Any) -> Trajectory:
        """The run of it; `group` and the options are those given to `simulate`."""


@shows_progress
def simulate(
    group: GroupLike | Simulated,
    u: Any = None,
    *,
    t: ArrayLike | None = None,
    eps: ArrayLike = 1.0,
    X0: ArrayLike | None = None,
    rtol: float | None = None,
    atol: float = 0.0,
    tolerance: float | None = None,
    resolution: float | None = None,
    method: str = "auto",
    steps: int | None = None,
    events: Sequence[Event] = (),
    threads: int = 1,
) -> Trajectory:
    """The flow X' = X hat(eps u(t)) from X(t[0]) = X0, at the times t; one, or N trajectories at once.

    X(t + h) = X(t) exp(Omega), Omega the Magnus series to order 8 or 6: Blanes, Casas and Ros, BIT 40 (2000) 434, in the
    left-invariant form (every bracket with the other sign). One trajectory is cut into eight runs of steps that go
    side by side; many go eight at a time.

    Args:
        group: the group; or a plan alone, as in `lc.simulate(plan)`.
        u: a plan of `lc.steer`, which runs on its own system: with its drift, equation and start, torques with their inertia
            (`run.xi`); else a PeriodicInput or a SampledInput (evaluated in the compiled loop where it is a Fourier series or straight
            pieces, however long the run); a constant (n,); samples (len(t), n), joined by straight lines; a text for each
            component, a formula of t; or any u(t) -> (n,) (vectorised or not; an attribute `breakpoints` names the times at
            which it is not smooth), which is read once, finely enough to be known between the values (see `resolution`).
        t: (k,) increasing times; the first is the initial one. A plan has 101 equal ones from 0 to its duration if not given.
        eps: scales u; (N,) for N trajectories.
        X0: (d, d) initial element, the identity if not given (of a plan where it is at t[0]); (N, d, d) for N trajectories.
        rtol: the steps are made shorter until the estimated error of the entries of X is below rtol max(1, |X|); 1e-11 if
            nothing is given, at least 1e-14.
        atol: the error may also be that large, whatever X is.
        tolerance: the old name of rtol.
        resolution: of a function u: the longest gap between two values of it that are read, (t[-1] - t[0])/2000 if not
            given. No reading sees a pulse between its values: give the width of the shortest.
        method: "auto" (Magnus of order 8, 6 above rtol = 1e-7), "magnus8", "magnus6", "magnus4", "rkmk4" (Munthe-Kaas) or
            "commutator_free" (two exponentials, no brackets).
        steps: so many equal steps, more where they have to end at a time of t or a jump of u; no tolerance then: rtol says
            which order "auto" takes and how finely a function u is read, atol is refused. For the Magnus methods.
        events: `lc.Event`s to be found along one trajectory.
        threads: over which N trajectories, or the steps of one, are shared out.

    Raises:
        ShapeError, NotFiniteError, InputError: naming the argument.
        NotOnGroupError: X0 is off the group by more than 1e-5; nearer ones are projected.
        ComputationError: the tolerance is not reached with the steps that can be taken: 67 million; or u(t) is not resolved.
    """
    options = {
        "t": t, "eps": eps, "X0": X0, "rtol": rtol, "atol": atol, "tolerance": tolerance, "resolution": resolution,
        "method": method, "steps": steps, "events": events, "threads": threads,
    }  # fmt: skip
    if _is_simulated(group):
        if u is not None:
            raise InputError("simulate: a plan comes alone, or after its group")
        return group.__simulate__(None, **options)
    group = as_group(cast("GroupLike", group), "simulate")
    if _is_simulated(u):
        return u.__simulate__(group, **options)
    if u is None or t is None:
        raise InputError(f"simulate({group.name}): give {'an input u' if u is None else 'the times t'}")
    times = check_times(group, t)
    factors = _factors(group, eps)
    goal = check_tolerance(f"simulate({group.name})", rtol, atol, tolerance)
    if method not in METHODS:
        raise InputError(f"simulate({group.name}): method is one of {', '.join(METHODS)}; given {method!r}")
    if steps is not None and atol:
        raise InputError(
            f"simulate({group.name}): atol goes with steps that are chosen by it; give steps or atol, not both"
        )
    start = initial_elements(group, X0)
    law = as_feedback(group, u)
    if law is not None:
        return _feedback_run(group, law, times, factors, start, goal, atol, method, steps, events, resolution, threads)
    signal = as_signal(group, _input(group, u), times)
    _check_trajectories(group, start, factors, signal)
    if resolution is not None and not (np.isfinite(resolution) and resolution > 0):
        raise InputError(f"simulate({group.name}): resolution is {resolution!r}; give a positive length of time")
    asked = _functions(group, events, signal, factors, start)
    drive = as_drive(group, signal, factors, times, rtol=goal, resolution=resolution)
    order = order_for(method, goal)
    if method in _FOURTH_ORDER:
        if steps is not None:
            raise InputError(f"simulate({group.name}): steps go with the Magnus methods; give {method} a tolerance")
        # A function is read from its pieces here too, so that no method meets an alias of it.
        read = signal if signal.formula is not None else drive_signal(drive, times)
        scale = factors if signal.formula is not None else np.ones_like(factors)
        step = step_of(group, method)
        X, grid, error = refined(
            step, read, scale, start, times, rtol=goal, atol=atol, name=group.name, threads=threads
        )
        run = MagnusRun(X, 4, 0, grid.steps, grid.largest_step, 0.0, error + drive.error)
    elif steps is None:
        run = magnus_run(group, drive, times, start, order=order, rtol=goal, atol=atol, threads=threads)
    else:
        run = fixed_run(group, drive, times, start, order=order, steps=_count(group, steps), threads=threads)
    X = run.X if method in _FOURTH_ORDER else _with_start(start, run.X)
    hits: tuple[EventHits, ...] = ()
    if asked:
        from lie_codegen.flow.magnus.events import run_events

        hits = run_events(group, drive, times, start, tuple(events), asked, order, run.longest)
    return Trajectory(
        group, times, X, run.steps, run.error_estimate, method if method in _FOURTH_ORDER else f"magnus{order}",
        drive.evaluations, drive.resolution, hits, drive, goal, run.multiple,
    )  # fmt: skip


def _feedback_run(
    group: MatrixGroup, law: Feedback, times: Array, eps: Array, start: Array, rtol: float, atol: float,
    method: str, steps: int | None, events: Sequence[Event], resolution: float | None, threads: int,
) -> Trajectory:  # fmt: skip
    """A feedback, by the pair 8(5,3): it has no Magnus series, and no time at which it could be read beforehand."""
    given = {
        "method": method != "auto",
        "steps": steps is not None,
        "events": events,
        "resolution": resolution is not None,
    }
    stray = [name for name, value in given.items() if value]
    if stray:
        raise InputError(
            f"simulate({group.name}): {', '.join(stray)} goes with inputs of time, not with a feedback u(t, {law.reads})"
        )
    if start.ndim == 3 and eps.ndim and len(start) != len(eps):
        raise ShapeError(
            f"simulate({group.name}): give one number of trajectories; X0 has {len(start)}, eps has {len(eps)}"
        )
    if law.slow:
        warn_caller(
            f"simulate({group.name}): u(t, {law.reads}) is a Python function, which is called at every stage of every step: slow, a "
            "thousand times slower than texts or a Kernel, which run in compiled loops",
            SlowWarning,
        )
    from lie_codegen.flow.feedback_flow import feedback_flow

    return feedback_flow(group, law, times, eps, start, rtol=rtol, atol=atol, threads=threads)


def _input(group: MatrixGroup, u: Any) -> Any:
    """Formulas as texts become a function of time, everything else stays."""
    if not (isinstance(u, list | tuple) and len(u) > 0 and all(isinstance(each, str) for each in u)):
        return u
    from lie_codegen.flow.formulas import formula_input

    return formula_input(group, u)


def _functions(
    group: MatrixGroup, events: Sequence[Event], signal: Signal, eps: Array, start: Array
) -> tuple[EventFunction, ...]:
    """The events as functions, before anything is integrated."""
    if not isinstance(events, list | tuple) or not all(isinstance(each, Event) for each in events):
        raise InputError(f"simulate({group.name}): events is a list of lc.Event, given {events!r:.80}")
    many = start.ndim == 3 or eps.ndim or (signal.formula is not None and signal.formula.trajectories is not None)
    if events and many:
        raise InputError(f"simulate({group.name}): events are of one trajectory; simulate it alone")
    return tuple(event_function(event, group.degree, group.is_complex) for event in events)


def _with_start(start: Array, later: Array) -> Array:
    """(k, ...) with the initial element in front."""
    return np.concatenate([np.broadcast_to(start, (1, *later.shape[1:])), later])


def check_tolerance(where: str, rtol: float | None, atol: float, tolerance: float | None) -> float:
    """The one tolerance that was given.

    Raises:
        InputError: rtol and tolerance together, one below 1e-14 or not finite, a negative atol.
    """
    if rtol is not None and tolerance is not None:
        raise InputError(f"{where}: give rtol, or its old name tolerance, not both")
    name, value = ("tolerance", tolerance) if tolerance is not None else ("rtol", rtol)
    goal = _DEFAULT if value is None else value
    if not (isinstance(goal, int | float | np.floating) and np.isfinite(goal) and goal > 0):
        raise InputError(f"{where}: {name} must be positive, got {value!r}")
    if goal < _SMALLEST:
        raise InputError(f"{where}: {name} = {goal:g} is below {_SMALLEST:g}, which double precision does not reach")
    if not (np.isfinite(atol) and atol >= 0):
        raise InputError(f"{where}: atol must not be negative, got {atol!r}")
    return float(goal)


def _count(group: MatrixGroup, steps: Any) -> int:
    if isinstance(steps, bool) or not isinstance(steps, int | np.integer) or not 1 <= steps <= MOST_STEPS:
        raise InputError(f"simulate({group.name}): steps is an integer from 1 to {MOST_STEPS}, given {steps!r}")
    return int(steps)


def _factors(group: MatrixGroup, eps: ArrayLike) -> Array:
    try:
        factors = np.asarray(eps, dtype=float)
    except (TypeError, ValueError):
        raise NotFiniteError(f"simulate({group.name}): eps is {eps!r}; give a finite number") from None
    if not np.all(np.isfinite(factors)):
        raise NotFiniteError(f"simulate({group.name}): eps is {eps!r}; give a finite number")
    if factors.ndim > 1 or not factors.size:
        raise ShapeError(f"simulate({group.name}): eps has shape {factors.shape}; give a number, or (N,) of them")
    return factors


def _check_trajectories(group: MatrixGroup, start: Array, eps: Array, u: Signal) -> None:
    given = {
        "X0": len(start) if start.ndim == 3 else None,
        "eps": len(eps) if eps.ndim else None,
        "u": u.formula.trajectories if u.formula is not None else None,
    }
    counts = {name: count for name, count in given.items() if count is not None}
    if len(set(counts.values())) > 1:
        text = ", ".join(f"{name} has {count}" for name, count in counts.items())
        raise ShapeError(f"simulate({group.name}): give one number of trajectories; {text}")


def _is_simulated(what: Any) -> TypeGuard[Simulated]:
    """By its class: to ask a protocol takes ten microseconds of a call of a hundred."""
    return hasattr(type(what), "__simulate__")


def check_times(group: MatrixGroup, t: ArrayLike) -> Array:
    """(k,) increasing times.

    Raises:
        InputError, ShapeError, NotFiniteError: they are none.
    """
    try:
        times = np.asarray(t, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"simulate({group.name}): t must be an array of numbers, got {t!r}") from None
    if times.ndim != 1 or len(times) < 2:
        raise ShapeError(f"simulate({group.name}): t has shape {times.shape}; give two or more times")
    if not np.all(np.isfinite(times)):
        raise NotFiniteError(f"simulate({group.name}): t holds NaN or infinity")
    if np.any(np.diff(times) <= 0):
        raise InputError(f"simulate({group.name}): t must increase strictly")
    return times


def initial_elements(group: MatrixGroup, X0: ArrayLike | None) -> Array:
    """X0, the identity if not given, as an element of the group, or (N, d, d) of them.

    Raises:
        ShapeError, NotFiniteError, NotOnGroupError: it is none.
    """
    kind = complex if group.is_complex else float
    d = group.degree
    if X0 is None:
        return np.eye(d, dtype=kind)
    given = np.asarray(X0)
    if given.dtype.kind not in "biufc":
        raise ShapeError(f"simulate({group.name}): X0 must be a ({d}, {d}) array of numbers, got {X0!r}")
    if not group.is_complex and np.iscomplexobj(given):
        raise ShapeError(f"simulate({group.name}): X0 is complex, the group is real")
    start = np.ascontiguousarray(given, dtype=kind)
    if start.ndim not in (2, 3) or start.shape[-2:] != (d, d) or not start.size:
        raise ShapeError(
            f"simulate({group.name}): X0 has shape {start.shape}; it must be ({d}, {d}), or (N, {d}, {d}) of N trajectories"
        )
    if not np.all(np.isfinite(start)):
        raise NotFiniteError(f"simulate({group.name}): X0 holds NaN or infinity")
    where = f"simulate({group.name}): X0"
    return admitted(group, start, where).X if start.ndim == 2 else admitted_all(group, start, where)[0]
