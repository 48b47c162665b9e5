"""A Magnus flow to a tolerance: its order, its steps, and what is known of its error."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError
from lie_codegen.flow.magnus.drive import Drive
from lie_codegen.flow.magnus.library import MagnusLibrary, magnus_library
from lie_codegen.flow.magnus.norms import norms_of
from lie_codegen.flow.magnus.solver import LONG, REACHED, TOO_MANY, TOO_MANY_AT_FIRST, Solved, Solver
from lie_codegen.flow.magnus.steps import Steps, plan_steps
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.runtime.threads import share_out

#: method -> order.
ORDERS = {"magnus4": 4, "magnus6": 6, "magnus8": 8}
MOST_STEPS = 2**26
#: Steps in one call of the compiled loop, about a tenth of a second.
BLOCK = 2_000_000
#: Steps of one trajectory, and trajectories, below which another thread costs more than it brings.
_LEAST_STEPS, _LEAST_TRAJECTORIES = 4096, 32
#: Of so many trajectories a few, as many as lanes go together at most, say how many steps are needed.
_MANY, _FEW = 256, 16
#: What single precision is asked for at best, and what one rounding costs there.
SINGLE_GOAL, _SINGLE_ROUNDING = 1e-6, 2.0**-24
#: The steps are never made more than so many times shorter at once: far from convergence the estimate says little.
_LARGEST_LEAP = 8
_TOO_FAST = (
    "{where}: |h u| and the fastest sine ask for more than the {most} steps that are taken; shorten t, or scale u"
)
_NOT_REACHED = (
    "{where}: {done} steps do not reach the tolerance, and those needed are more than the {most} that are taken; loosen rtol, "
    "shorten t, or name the times at which u is not smooth in an attribute `breakpoints` of u"
)
_OUT_OF_RANGE = "{where}: the solution left the range of double precision"


class MagnusRun(NamedTuple):
    """X at the times after the first; (k, d, d) or (k, N, d, d).

    Attributes:
        order: 4, 6 or 8.
        multiple: how many times the coarsest steps were divided; 0 for a number of steps that was given.
        steps: the number of steps.
        longest, shortest: of them.
        error_estimate: of the entries of X: from the runs with longer steps, and what reading u left out.
    """

    X: Array
    order: int
    multiple: int
    steps: int
    longest: float
    shortest: float
    error_estimate: float


def order_for(method: str, rtol: float) -> int:
    """The order: of three further brackets a hundredth of the error is left, so order 6 pays at loose tolerances only."""
    return ORDERS.get(method, 8 if rtol < 1e-7 else 6)


def magnus_run(
    group: MatrixGroup,
    drive: Drive,
    times: Array,
    X0: Array,
    *,
    order: int,
    rtol: float,
    atol: float = 0.0,
    most: int = MOST_STEPS,
    threads: int = 1,
    single: bool = False,
) -> MagnusRun:
    """Steps are made shorter until two runs agree: the error of the finer is their difference over (ratio^order - 1).

    Of the first pair the order is trusted less, 63 is taken for 255: far from convergence the error falls more slowly.
    `single`: many trajectories in single precision.

    Raises:
        ComputationError: the tolerance is not met with `most` steps, or the solution is not finite.
    """
    where = f"simulate({group.name})"
    solver = solver_of(group) if threads == 1 and X0.ndim == 2 and drive.many is None else None
    if solver is None:
        return _led_by_python(group, drive, times, X0, order, rtol, atol, most, threads, where, single)
    found = solver(drive, times, X0, order=order, rtol=rtol, atol=atol, most=most, block=BLOCK)
    if found.status == LONG:
        return _led_by_python(group, drive, times, X0, order, rtol, atol, most, threads, where)
    return as_run(found, order, drive.error, where, most)


def as_run(found: Solved, order: int, left_out: float, where: str, most: int) -> MagnusRun:
    """What compiled code found, or the reason why it found nothing.

    Raises:
        ComputationError: see `magnus_run`.
    """
    if found.status == TOO_MANY_AT_FIRST:
        raise ComputationError(_TOO_FAST.format(where=where, most=most))
    if found.status == TOO_MANY:
        raise ComputationError(_NOT_REACHED.format(where=where, most=most, done=found.steps))
    if found.status != REACHED:
        raise ComputationError(_OUT_OF_RANGE.format(where=where))
    scale = max(1.0, float(np.max(np.abs(found.X)))) if left_out else 1.0
    estimate = found.estimate + left_out * scale
    return MagnusRun(found.X, order, found.multiple, found.steps, found.longest, found.shortest, estimate)


def _led_by_python(
    group: MatrixGroup,
    drive: Drive,
    times: Array,
    X0: Array,
    order: int,
    rtol: float,
    atol: float,
    most: int,
    threads: int,
    where: str,
    single: bool = False,
) -> MagnusRun:
    """The same loop as magnus_solve.h: for many trajectories, several threads, runs of millions of steps, and without a compiler."""
    base = plan_steps(drive, norms_of(group), times, most)
    if base is None:
        raise ComputationError(_TOO_FAST.format(where=where, most=most))

    def run(steps: Steps, members: range | None = None) -> Array:
        return _finite(flow(group, drive, steps, order, X0, threads, single, members), where)

    def floor(steps: Steps) -> float:
        return _single_floor(group, drive, steps) if single else float(4e-16 * np.sqrt(steps.count))

    def agree(run: Callable[[Steps], Array], before: int = 1, multiple: int = 2) -> MagnusRun:
        """From runs with `before` and `multiple` times the steps on, until two agree."""
        coarse, trust = run(base.times(before)), order if before > 1 else order - 2
        while True:
            if base.count * multiple > most:
                raise ComputationError(_NOT_REACHED.format(where=where, most=most, done=base.count * before))
            steps = base.times(multiple)
            fine = run(steps)
            scale = max(1.0, float(np.max(np.abs(fine))))
            difference = float(np.max(np.abs(fine - coarse), initial=0.0))
            ratio = multiple / before
            estimate = difference / (ratio**trust - 1)
            goal, lowest = max(rtol * scale, atol), scale * floor(steps)
            if estimate <= max(goal, lowest):
                known = (max(estimate, lowest) if single else estimate) + drive.error * scale
                return MagnusRun(fine, order, multiple, steps.count, steps.longest, steps.shortest, known)
            # The next run should reach half the goal, by the order as it is; it is at least half as fine again, so that the two can be compared.
            needed = (difference / (ratio**order - 1) / max(goal / 2, lowest)) ** (1 / order)
            before, coarse, trust = multiple, fine, order
            multiple = int(np.ceil(multiple * min(max(needed, 1.5), _LARGEST_LEAP)))

    many = len(X0) if X0.ndim == 3 else drive.many or 1
    if many < _MANY or magnus_library(group) is None:
        return agree(run)
    # A few of many, the busiest among them, find out how many steps are needed; all are held to the same rule, but spared the first run.
    first = min(max(drive.busiest - _FEW // 2, 0), many - _FEW)
    found = agree(partial(run, members=range(first, first + _FEW))).multiple
    return agree(run) if found == 2 else agree(run, max(2, -(-found // _LARGEST_LEAP)), found)


def _single_floor(group: MatrixGroup, drive: Drive, steps: Steps) -> float:
    """What single precision rounds: u, in proportion to its integral, and every step, one way or the other."""
    integral = float(np.sum(np.diff(steps.knots) * drive.density(norms_of(group), steps.piece)))
    return float(_SINGLE_ROUNDING * (integral + 4 * np.sqrt(steps.count)))


def fixed_run(
    group: MatrixGroup,
    drive: Drive,
    times: Array,
    X0: Array,
    *,
    order: int,
    steps: int,
    threads: int = 1,
    single: bool = False,
) -> MagnusRun:
    """So many equal steps between the first and the last time, or the next more that end at every time and jump of u."""
    wanted = steps / (times[-1] - times[0]) * (1 - 1e-12)
    if drive.terms:
        # The pieces of a function were cut for its reading, not for the steps: each step has one of its own instead.
        knots = np.union1d(times, drive.corners[(drive.corners > times[0]) & (drive.corners < times[-1])])
        counts = np.maximum(np.ceil(np.diff(knots) * wanted), 1).astype(int)
        drive = drive.on_pieces(
            np.append(
                np.concatenate(
                    [np.linspace(a, b, c + 1)[:-1] for a, b, c in zip(knots, knots[1:], counts, strict=False)]
                ),
                times[-1],
            )
        )
    planned = plan_steps(drive, np.zeros((group.dim + 1, group.dim)), times, MOST_STEPS)
    if planned is None:
        raise ComputationError(f"simulate({group.name}): u is not finite")
    parts = np.ones_like(planned.parts) if drive.terms else np.maximum(np.ceil(np.diff(planned.knots) * wanted), 1)
    chosen = Steps(planned.knots, parts.astype(np.intp), planned.piece, planned.slot, planned.slots)
    X = _finite(flow(group, drive, chosen, order, X0, threads, single), f"simulate({group.name})")
    return MagnusRun(X, order, 0, chosen.count, chosen.longest, chosen.shortest, float("nan"))


@lru_cache(maxsize=32)
def solver_of(group: MatrixGroup) -> Solver | None:
    """Runs of the group by compiled code; None where there is no compiler."""
    library = magnus_library(group)
    return None if library is None else Solver(library, norms_of(group))


def flow(
    group: MatrixGroup,
    drive: Drive,
    steps: Steps,
    order: int,
    X0: Array,
    threads: int = 1,
    single: bool = False,
    members: range | None = None,
) -> Array:
    """X at the slots by one pass over the steps: (slots, d, d), or (slots, N, d, d) where u, its factor or X0 has N.

    `single`: N trajectories in single precision, where there is a compiler. `members`: of N only these, where there is a compiler.
    """
    library = magnus_library(group)
    many = len(X0) if X0.ndim == 3 else drive.many
    if library is None:
        from lie_codegen.flow.magnus import numpy_steps

        return numpy_steps.flow(group, drive, steps, order, X0)
    if many is not None:
        move = library.many_single if single else library.many
        start = X0.astype(np.complex64 if X0.dtype.kind == "c" else np.float32) if single else X0
        chosen = range(many) if members is None else members
        parts = share_out(
            lambda a, b: move(drive, steps, order, start, chosen.start + a, chosen.start + b),
            len(chosen), threads, _LEAST_TRAJECTORIES, steps.count,
        )  # fmt: skip
        return np.ascontiguousarray(np.moveaxis(np.concatenate(parts), 0, 1), dtype=X0.dtype)
    if threads == 1:
        return _in_blocks(library, drive, steps, order, X0)
    return _over_time(library, drive, steps, order, X0, threads)


def _in_blocks(library: MagnusLibrary, drive: Drive, steps: Steps, order: int, X0: Array) -> Array:
    """One thread, block after block of steps: in between Python looks whether somebody pressed Ctrl-C."""
    if steps.count <= BLOCK:
        return library.one(drive, steps, order, X0, 0, steps.count)[0]
    found, before = np.zeros((steps.slots, *X0.shape), X0.dtype), X0
    for first in range(0, steps.count, BLOCK):
        last = min(first + BLOCK, steps.count)
        X, before = library.one(drive, steps, order, before, first, last)
        ends_here = (steps.first[1:] > first) & (steps.first[1:] <= last) & (steps.slot >= 0)
        found[steps.slot[ends_here]] = X[steps.slot[ends_here]]
    return found


def _over_time(library: MagnusLibrary, drive: Drive, steps: Steps, order: int, X0: Array, threads: int) -> Array:
    """Threads as lanes: each takes a run of steps from the identity; X is multiplied by what came before."""
    one = np.eye(len(X0), dtype=X0.dtype)
    runs = share_out(
        lambda a, b: (library.one(drive, steps, order, one, a, b), a, b), steps.count, threads, _LEAST_STEPS, 1
    )
    found, before = np.zeros((steps.slots, *X0.shape), X0.dtype), X0
    for (X, end), first, last in runs:
        ends_here = (steps.first[1:] > first) & (steps.first[1:] <= last) & (steps.slot >= 0)
        mine = steps.slot[ends_here]
        found[mine] = before @ X[mine]
        before = before @ end
    return found


def _finite(X: Array, where: str) -> Array:
    if not np.all(np.isfinite(X)):
        raise ComputationError(_OUT_OF_RANGE.format(where=where))
    return X
