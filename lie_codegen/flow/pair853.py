"""X' = X hat(xi), y' = F(t, X, y) by the explicit pair 8(5,3) in compiled loops, one member or many, to a tolerance.

F and the product X exp(Theta) are compiled kernels; see templates/pair853.c. Local errors are held below the tolerance of a run;
what they add up to is judged by a second run at another tolerance, so that the tolerance asked for holds for the states themselves.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError
from lie_codegen.flow.pair_library import FULL, LOST, STUCK, compiled_pair
from lie_codegen.flow.pair_system import System
from lie_codegen.runtime.threads import share_out

#: Steps in one call of compiled code, after which Python looks whether somebody pressed Ctrl-C; room for as many knots.
_STEPS = 4096
#: Members that go with one step size: enough for lanes, few enough for the cache; and of the pilot.
_BLOCK, _PILOT = 64, 16
#: The run that is given has local errors so much smaller than the one it is compared with.
_RATIO = 8.0
_SMALLEST, _MOST_RUNS = 1e-15, 6
#: Steps that are tried at most: some seconds.
_MOST_STEPS = 2**21


@dataclass(frozen=True, eq=False)
class PairRun:
    """States at times, of N members, and the steps of one.

    Attributes:
        X, y: (k, N, packed) and (k, N, size) at the times, Theta = 0.
        steps, rejected: of all blocks of members together, or of one.
        evaluations: of the rate, for a block at once.
        error_estimate: of the entries of X and y: the difference to a run with longer steps, over what the tolerances of the two
            promise; of many members that of the pilot.
        knot_t, knot_h, knot_X, knot_y: the start, the length and the state of every step of a single member; else empty.
    """

    X: Array
    y: Array
    steps: int
    rejected: int
    evaluations: int
    error_estimate: float
    knot_t: Array
    knot_h: Array
    knot_X: Array
    knot_y: Array

    def within(self, system: System, knots: NDArray[np.intp], parts: Array) -> tuple[Array, Array]:
        """X and y the fractions `parts` of the way through the steps `knots`, by fresh steps of a single member."""
        at = np.ascontiguousarray(knots, dtype=np.intp)
        part = np.ascontiguousarray(parts, dtype=float)
        X, y = np.empty((len(at), system.packed)), np.empty((len(at), system.size))
        work = system.work(1)
        given, _kept = system.record(1)
        given.knot_t, given.knot_h = self.knot_t.ctypes.data, self.knot_h.ctypes.data
        given.knot_X, given.knot_y, given.work = self.knot_X.ctypes.data, self.knot_y.ctypes.data, work.ctypes.data
        library = compiled_pair()
        library.pair_within(
            ctypes.addressof(given), len(at), at.ctypes.data, part.ctypes.data, X.ctypes.data, y.ctypes.data
        )
        return X, y


def integrate(
    system: System, X0: Array, y0: Array, times: Array, *, rtol: float, atol: float, where: str, threads: int = 1
) -> PairRun:
    """States of N members at the times, the first of which is that of (X0, y0): errors below rtol max(1, |state|) or atol.

    One member is run at two tolerances, and again at smaller ones until they agree; of many the tolerance is found by
    a pilot of sixteen, then each block of 64 holds its own local errors below it.

    Args:
        system: what is integrated.
        X0, y0: (N, packed) and (N, size), Theta = 0.
        times: (k,) increasing.
        rtol, atol: on the states at the times.
        where: for messages.
        threads: over which blocks are shared out.

    Raises:
        ComputationError: the tolerance is not reached, or a state leaves the range of doubles.
    """
    if len(X0) == 1:
        return _to_tolerance(system, X0, y0, times, rtol, atol, where)[0]
    chosen = np.unique(np.linspace(0, len(X0) - 1, min(_PILOT, len(X0))).astype(int))
    pilot, local = _to_tolerance(system.of_members(chosen), X0[chosen], y0[chosen], times, rtol, atol, where)

    def part(first: int, last: int) -> list[PairRun]:
        runs = []
        for begin in range(first, last, _BLOCK):
            some = slice(begin, min(begin + _BLOCK, last))
            runs.append(_once(system.of_members(some), X0[some], y0[some], times, *local, where))
        return runs

    runs = [run for share in share_out(part, len(X0), threads, _BLOCK) for run in share]
    return PairRun(
        np.concatenate([run.X for run in runs], axis=1), np.concatenate([run.y for run in runs], axis=1),
        sum(run.steps for run in runs), sum(run.rejected for run in runs), sum(run.evaluations for run in runs),
        pilot.error_estimate, *_no_knots(system),
    )  # fmt: skip


def _to_tolerance(
    system: System, X0: Array, y0: Array, times: Array, rtol: float, atol: float, where: str
) -> tuple[PairRun, tuple[float, float]]:
    """A run whose difference to one with larger local errors says that it is good enough, and its local tolerances."""
    # The error of a run is in proportion to its local tolerance: of two whose tolerances differ by a factor r the
    # better errs by about their difference over r - 1. Twice that is reported, for proportion is not exact.
    share = 1.0
    coarse = _once(system, X0, y0, times, rtol, atol + rtol, where)
    for _ in range(_MOST_RUNS):
        share /= _RATIO
        local = max(rtol * share, _SMALLEST), max((atol + rtol) * share, _SMALLEST)
        fine = _once(system, X0, y0, times, *local, where)
        with np.errstate(invalid="ignore"):
            difference = max(float(np.max(np.abs(a - b))) for a, b in ((fine.X, coarse.X), (fine.y, coarse.y)))
        scale = max(1.0, float(np.max(np.abs(fine.X))), float(np.max(np.abs(fine.y))))
        estimate = 2 * difference / (_RATIO - 1)
        # Rounding: no run of so many steps knows its states better.
        floor = 1e-15 * scale * np.sqrt(fine.steps)
        if estimate <= max(rtol * scale, atol, floor):
            return replace(fine, error_estimate=max(estimate, floor)), local
        if local[1] <= _SMALLEST:
            break
        needed = estimate / max(rtol * scale, atol)
        if needed > _RATIO**2:  # far off: the next pair starts there
            share /= min(needed / _RATIO, 1e4)
            fine = _once(
                system, X0, y0, times, max(rtol * share, _SMALLEST), max((atol + rtol) * share, _SMALLEST), where
            )
        coarse = fine
    raise ComputationError(
        f"{where}: local errors of {local[1]:.2g} leave an error of {estimate:.2g} at the times that were asked for; the motion is too "
        "sensitive for the tolerance: loosen rtol or shorten the time"
    )


def _once(system: System, X0: Array, y0: Array, times: Array, rtol: float, atol: float, where: str) -> PairRun:
    """One run of some members with one step size."""
    N, k, one = len(X0), len(times), len(X0) == 1
    given, _kept = system.record(N)
    X, y = np.array(X0, dtype=float), np.array(y0, dtype=float)
    X_out, y_out = np.empty((k, N, system.packed)), np.empty((k, N, system.size))
    X_out[0], y_out[0] = X, y
    later = np.ascontiguousarray(times[1:], dtype=float)
    work = system.work(N)
    given.t, given.h, given.rtol, given.atol = float(times[0]), 0.0, rtol, atol
    given.reach, given.longest = system.reach, float(times[-1] - times[0])
    given.X, given.y, given.times, given.count, given.row = X.ctypes.data, y.ctypes.data, later.ctypes.data, k - 1, N
    given.X_out, given.y_out, given.work = X_out[1:].ctypes.data, y_out[1:].ctypes.data, work.ctypes.data
    knots: list[tuple[Array, ...]] = []
    library = compiled_pair()
    status = FULL
    while status == FULL:
        room = (np.empty(_STEPS), np.empty(_STEPS), np.empty((_STEPS, system.packed)), np.empty((_STEPS, system.size)))
        if one:
            given.knot_t, given.knot_h, given.knot_X, given.knot_y = (each.ctypes.data for each in room)
            given.room = _STEPS
        status = library.pair_run(ctypes.addressof(given), _STEPS)
        knots.append(tuple(each[: given.knots].copy() for each in room))
        if given.steps + given.rejected > _MOST_STEPS:
            raise ComputationError(
                f"{where}: {_MOST_STEPS} steps do not bring the error below {atol:g} beyond t = {given.t:.9g}, or the state grows "
                "without bound; shorten the time, loosen the tolerance, or check the gains"
            )
    if status == LOST:
        raise ComputationError(
            f"{where}: the state is no longer finite behind t = {given.t:.9g}; check the gains, or shorten the time"
        )
    if status == STUCK:
        raise ComputationError(f"{where}: no step is short enough at t = {given.t:.9g}; is the force smooth there?")
    kept = tuple(np.concatenate([each[j] for each in knots]) for j in range(4)) if one else _no_knots(system)
    return PairRun(X_out, y_out, given.steps, given.rejected, given.evaluations, float("nan"), *kept)


def _no_knots(system: System) -> tuple[Array, Array, Array, Array]:
    return np.empty(0), np.empty(0), np.empty((0, system.packed)), np.empty((0, system.size))
