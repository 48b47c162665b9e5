"""lc.simulate: X' = X hat(eps u(t)) on the group, by Magnus steps in compiled loops."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, TypeGuard, cast

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.door import warn_caller
from lie_codegen.errors import InputError, ShapeError, SlowWarning
from lie_codegen.flow.events import Event, EventHits
from lie_codegen.flow.feedback_law import Feedback, as_feedback
from lie_codegen.flow.inputs import Signal, as_drive, as_signal, drive_signal
from lie_codegen.flow.magnus.drive import Drive
from lie_codegen.flow.magnus.run import SINGLE_GOAL, MagnusRun, fixed_run, magnus_run, order_for
from lie_codegen.flow.simulate_arguments import (
    FOURTH_ORDER,
    check_precision,
    check_single,
    check_times,
    check_tolerance,
    check_trajectories,
    event_functions,
    factors_of,
    initial_elements,
    input_of,
    step_count,
    written,
)
from lie_codegen.flow.trajectory import Trajectory
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.runtime.patience import shows_progress
from lie_codegen.values import made_of

METHODS = ("auto", "magnus8", "magnus6", "magnus4", *FOURTH_ORDER)


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
    precision: str = "double",
) -> Trajectory:
    """The flow X' = X hat(eps u(t)) from X(t[0]) = X0, at the times t; one, or N trajectories at once.

    X(t + h) = X(t) exp(Omega), Omega the Magnus series to order 8 or 6: Blanes, Casas and Ros, BIT 40 (2000) 434, in the
    left-invariant form (every bracket with the other sign). One trajectory is cut into runs of steps that go
    side by side, as many as a vector of the processor has doubles; many trajectories go so too.

    Args:
        group: the group; or a plan alone, as in `lc.simulate(plan)`.
        u: a plan of `lc.steer`, `lc.ocp` or momentum wheels, which runs on its own system: with its drift, equation and start, torques
            with their inertia (`run.xi`), the problem's states and parameters; else a PeriodicInput or a SampledInput (evaluated in the compiled loop where it is a Fourier series or straight
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
        precision: "single" for screening N trajectories, twice as many at a time and twice as fast, to 1e-6 at best: u and t are doubles, steps
            are floats, X comes in doubles. Rounding costs 6e-8 for each unit of the integral of |u|; `run.error_estimate` says it.

    Raises:
        ShapeError, NotFiniteError, InputError: naming the argument.
        NotOnGroupError: X0 is off the group by more than 1e-5; nearer ones are projected.
        ComputationError: the tolerance is not reached with the steps that can be taken: 67 million; or u(t) is not resolved.
    """
    single = check_precision("simulate", precision)
    if _is_simulated(group) or _is_simulated(u):
        if single:
            raise InputError('simulate: precision="single" is for inputs, not for a plan')
        options = {
            "t": t, "eps": eps, "X0": X0, "rtol": rtol, "atol": atol, "tolerance": tolerance, "resolution": resolution,
            "method": method, "steps": steps, "events": events, "threads": threads,
        }  # fmt: skip
        if not _is_simulated(group):
            own = as_group(cast("GroupLike", group), "simulate")
            return cast("Simulated", u).__simulate__(own, **options)
        if u is not None:
            raise InputError("simulate: a plan comes alone, or after its group")
        return group.__simulate__(None, **options)
    group = as_group(cast("GroupLike", group), "simulate")
    if u is None or t is None:
        raise InputError(f"simulate({group.name}): give {'an input u' if u is None else 'the times t'}")
    times = check_times(group, t)
    factors = factors_of(group, eps)
    goal = check_tolerance(f"simulate({group.name})", rtol, atol, tolerance)
    if method not in METHODS:
        raise InputError(f"simulate({group.name}): method is one of {', '.join(METHODS)}; given {method!r}")
    if steps is not None and atol:
        raise InputError(
            f"simulate({group.name}): atol goes with steps that are chosen by it; give steps or atol, not both"
        )
    start = initial_elements(group, X0)
    u = written(u)
    law = as_feedback(group, u)
    if law is not None:
        if single:
            raise InputError(
                f'simulate({group.name}): precision="single" goes with inputs of time, not with a feedback u(t, {law.reads})'
            )
        return _feedback_run(group, law, times, factors, start, goal, atol, method, steps, events, resolution, threads)
    signal = as_signal(group, input_of(group, u), times)
    check_trajectories(group, start, factors, signal)
    if single:
        check_single(group, method, tolerance if rtol is None else rtol, signal, factors, start)
        goal = max(goal, SINGLE_GOAL)
    if resolution is not None and not (np.isfinite(resolution) and resolution > 0):
        raise InputError(f"simulate({group.name}): resolution is {resolution!r}; give a positive length of time")
    asked = event_functions(group, events, signal, factors, start)
    drive = as_drive(group, signal, factors, times, rtol=goal, resolution=resolution)
    # Where every step is rounded to 1e-7, the fewest are the best.
    order = 8 if single and method == "auto" else order_for(method, goal)
    if method in FOURTH_ORDER:
        if steps is not None:
            raise InputError(f"simulate({group.name}): steps go with the Magnus methods; give {method} a tolerance")
        run = _fourth_order(group, method, signal, drive, times, factors, start, goal, atol, threads)
        X = run.X
    else:
        run = _magnus(group, drive, times, start, order, goal, atol, steps, threads, single)
        X = _with_start(start, run.X)
    hits: tuple[EventHits, ...] = ()
    if asked:
        from lie_codegen.flow.magnus.events import run_events

        hits = run_events(group, drive, times, start, tuple(events), asked, order, run.longest)
    return made_of(
        Trajectory,
        {
            "group": group, "t": times, "X": X, "steps": run.steps, "error_estimate": run.error_estimate,
            "method": method if method in FOURTH_ORDER else f"magnus{order}", "evaluations": drive.evaluations,
            "resolution": drive.resolution, "events": hits, "drive": drive, "rtol": goal, "multiple": run.multiple,
        },
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


def _fourth_order(
    group: MatrixGroup, method: str, signal: Signal, drive: Drive, times: Array, eps: Array, start: Array, rtol: float, atol: float,
    threads: int,
) -> MagnusRun:  # fmt: skip
    """A run by steps of the fourth order, halved until two runs agree."""
    from lie_codegen.flow.libraries import step_of
    from lie_codegen.flow.refined import refined

    # A function is read from its pieces here too, so that no method meets an alias of it; they hold eps already.
    read = signal if signal.formula is not None else drive_signal(drive, times)
    scale = eps if signal.formula is not None else np.ones_like(eps)
    step = step_of(group, method)
    X, grid, error = refined(step, read, scale, start, times, rtol=rtol, atol=atol, name=group.name, threads=threads)
    return MagnusRun(X, 4, 0, grid.steps, grid.largest_step, 0.0, error + drive.error)


def _magnus(
    group: MatrixGroup, drive: Drive, times: Array, start: Array, order: int, rtol: float, atol: float, steps: int | None,
    threads: int, single: bool,
) -> MagnusRun:  # fmt: skip
    """The states after the start by Magnus steps, as many as the tolerance asks for or as were given."""
    if steps is None:
        return magnus_run(group, drive, times, start, order=order, rtol=rtol, atol=atol, threads=threads, single=single)
    count = step_count(group, steps)
    return fixed_run(group, drive, times, start, order=order, steps=count, threads=threads, single=single)


def _with_start(start: Array, later: Array) -> Array:
    """(k, ...) with the initial element in front."""
    X = np.empty((len(later) + 1, *later.shape[1:]), later.dtype)
    X[0], X[1:] = start, later
    return X


def _is_simulated(what: Any) -> TypeGuard[Simulated]:
    """By its class: to ask a protocol takes ten microseconds of a call of a hundred."""
    return hasattr(type(what), "__simulate__")
