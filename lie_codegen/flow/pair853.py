"""X' = X hat(xi), y' = F(t, X, y) by the explicit pair 8(5,3) in compiled loops, one member or many, to a tolerance.

F and the product X exp(Theta) are compiled kernels; see templates/pair853.c. Local errors are held below the tolerance of a run;
what they add up to is judged by a second run at another tolerance, so that the tolerance asked for holds for the states themselves.
"""

from __future__ import annotations

from math import inf, nan, sqrt

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError
from lie_codegen.flow.pair_errors import RATIO, SHORTER, SMALLEST, estimate_of, local_errors
from lie_codegen.flow.pair_lanes import run_lanes
from lie_codegen.flow.pair_run import PairRun
from lie_codegen.flow.pair_single import MOST_STEPS, single_run
from lie_codegen.flow.pair_system import System
from lie_codegen.flow.pair_twice import two_runs
from lie_codegen.runtime.outputs import empty
from lie_codegen.runtime.threads import share_out

#: Members below which a thread costs more than it does.
_BLOCK = 64
#: Members of the pilot, at least and at most, of how many it is one, and how many times more than the worst of them others may err: of 10,000 with
#: steps of their own some err up to ten times as much as the worst of 128, whose steps happened to look better than they were.
_PILOT, _LARGEST_PILOT, _PART, _MARGIN = 16, 128, 32, 16.0
#: Where steps go as they like the first run of a member has local errors of this part of the tolerance, by Theta and by elements: of hundred
#: loops on SO(3) and SE(3) at 1e-5 to 1e-12 nine needed a third run with 1, none with 1/4, for a tenth more steps; by elements of
#: three hundred on SO(3) four with 1/4, none with 1/8, for a fifteenth more.
_FREE_SHARE, _FREE_SHARE_SHORT = 0.25, 0.125
_MOST_RUNS = 6


def integrate(
    system: System, X0: Array, y0: Array, times: Array, *, rtol: float, atol: float, where: str, threads: int = 1
) -> PairRun:
    """States of N members at the times, the first of which is that of (X0, y0): errors below rtol max(1, |state|) or atol.

    One member is run at two tolerances, and again at smaller ones until they agree; of many the tolerance is found by
    a pilot of 16 to 128, then each holds its own local errors below it.

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
    some = min(max(_PILOT, len(X0) // _PART), _LARGEST_PILOT, len(X0))
    chosen = np.linspace(0, len(X0) - 1, some).astype(int)
    pilot, share = _to_tolerance(system.of_members(chosen), X0[chosen], y0[chosen], times, rtol, atol, where)
    whole = _many(system, X0, y0, times, *local_errors(rtol, atol, share), where, threads)
    return whole.estimated(pilot.error_estimate)


def _to_tolerance(
    system: System, X0: Array, y0: Array, times: Array, rtol: float, atol: float, where: str
) -> tuple[PairRun, float]:
    """A run whose difference to one with larger local errors says that it is good enough, and what part of the tolerance its local errors are.

    Of several members, which are a pilot, that with which others like them are good enough, with the error that is then allowed for.
    """
    one = len(X0) == 1
    free = one and system.is_interpolated and len(times) > 2  # steps go as they like, and all times cost little
    share = (_FREE_SHARE if system.lift is None else _FREE_SHARE_SHORT) if free else 1.0
    found = None
    if one:
        found = two_runs(system, X0, y0, times, rtol, atol, share, free)
    coarse = _once(system, X0, y0, times, *local_errors(rtol, atol, share), where) if found is None else None
    shorter = 1.0
    for _ in range(_MOST_RUNS):
        share /= RATIO
        if free:  # where the reach limits steps two runs would be the same
            shorter *= SHORTER
        if found is not None:
            fine, size, estimate = found
            found = None
        elif coarse is not None:
            fine = _once(system.within(shorter), X0, y0, times, *local_errors(rtol, atol, share), where)
            size = max(_size(fine.X), _size(fine.y))
            estimate = estimate_of(
                _difference(system, fine, coarse, times, free), fine.left, fine.steps, coarse.steps, free
            )
        scale = size if size > 1 else 1.0
        # Rounding: no run of so many steps knows its states better.
        floor = 1e-15 * scale * sqrt(fine.steps / len(X0))
        goal = max(rtol * scale, atol, floor)
        if estimate <= goal:
            if one:
                return fine.estimated(estimate if estimate > floor else floor), share
            slack = min(max(goal / (_MARGIN * max(estimate, floor)), 1 / _MARGIN), RATIO)
            return fine.estimated(max(_MARGIN * slack * estimate, floor)), slack * share
        local = local_errors(rtol, atol, share)
        if local[1] <= SMALLEST:
            break
        needed = estimate / max(rtol * scale, atol)
        if needed > RATIO**2:  # far off: the next pair starts there
            share /= min(needed / RATIO, 1e4)
            fine = _once(system.within(shorter), X0, y0, times, *local_errors(rtol, atol, share), where)
        coarse = fine
        if one and system.reach == inf:  # over lanes the first of two runs costs nothing, though it was there already
            found = two_runs(system, X0, y0, times, rtol, atol, share, free)
    raise ComputationError(
        f"{where}: local errors of {local[1]:.2g} leave an error of {estimate:.2g} at the times that were asked for; the motion is too "
        "sensitive for the tolerance: loosen rtol or shorten the time"
    )


def _difference(system: System, fine: PairRun, coarse: PairRun, times: Array, free: bool) -> float:
    """How far two runs are apart: at the times that are wanted; or, where states between steps are known and these are fewer, where the
    steps of the first end, at which it is as good as it gets."""
    X, y, X_other, y_other = fine.X[1:], fine.y[1:], coarse.X[1:], coarse.y[1:]
    if free and coarse.steps < len(times) - 1:
        X, y = fine.at(system, np.append(coarse.knot_t[1:], times[-1]))
        X_other, y_other = coarse.within(system, np.arange(coarse.steps), np.ones(coarse.steps))
    with np.errstate(invalid="ignore"):
        return max(_size(X - X_other), _size(y - y_other))


def _size(of: Array) -> float:
    """The largest entry; NaN where one is."""
    return float(np.abs(of).max())


def _once(system: System, X0: Array, y0: Array, times: Array, rtol: float, atol: float, where: str) -> PairRun:
    """One run of some members at local tolerances."""
    run = single_run if len(X0) == 1 else _many
    return run(system, X0, y0, times, rtol, atol, where)


def _many(
    system: System, X0: Array, y0: Array, times: Array, rtol: float, atol: float, where: str, threads: int = 1
) -> PairRun:
    """One run of members that are shared out over threads; one after another where lanes cannot be had."""
    X_out, y_out = (empty((len(times), *each.shape), each.dtype) for each in (X0, y0))
    X_out[0], y_out[0] = X0, y0
    behind = X_out[1:], y_out[1:]

    def part(first: int, last: int) -> tuple[int, int, int]:
        some = slice(first, last)
        if all(system.blocks):
            return run_lanes(
                system.of_members(some), (X0[some], y0[some]), times, behind, first, rtol, atol, MOST_STEPS, where
            )
        runs = []
        for m in range(first, last):
            runs.append(
                single_run(system.of_members(slice(m, m + 1)), X0[m : m + 1], y0[m : m + 1], times, rtol, atol, where)
            )
            X_out[:, m], y_out[:, m] = runs[-1].X[:, 0], runs[-1].y[:, 0]
        return sum(run.steps for run in runs), sum(run.rejected for run in runs), sum(run.evaluations for run in runs)

    steps, rejected, evaluations = np.sum(share_out(part, len(X0), threads, _BLOCK), axis=0).tolist()
    return PairRun(X_out, y_out, steps, rejected, evaluations, nan, 0.0, np.empty((0, 2 + system.kept + system.size)))
