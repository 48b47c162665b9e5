"""method="optimal": minimum energy for any controllable left-invariant system, by the best means that works.

    minimise int_0^T sum_i w_i u_i^2 dt   subject to   X' = X sum_i u_i A_i,  X(0) = I,  X(T) = target

First shooting on the Lie-Poisson equations from the area rule; where that fails, or hardly any starts agree on the cheapest, with
ten times the starts; then, unless the residual is well below the tolerance, the direct transcription. What won, and what was
tried, is in the plan's details.
"""

from __future__ import annotations

import operator
import time
from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.steering.finish import finish
from lie_codegen.steering.plan import Controls, Plan, PlanOnDemand, Status
from lie_codegen.steering.shooting.extremal import Extremal
from lie_codegen.steering.shooting.extremals import SOLVED, Extremals
from lie_codegen.steering.shooting.shooter import Shooter, shooter
from lie_codegen.steering.task import Task

_MORE = 10
#: A cheapest extremal that no more starts than these found is searched for again (SL(2): 4 of 60 were not the cheapest, then none).
_LONELY = 2
_CONJUGATE = 1e-6
_CLOSE = 0.01


def optimal(
    task: Task,
    *,
    weights: ArrayLike | None = None,
    starts: int | None = None,
    threads: int = 1,
    progress: Callable[[str], None] | None = None,
) -> Plan:
    """The minimum-energy manoeuvre, the best of several starts.

    Args:
        task: the task.
        weights: (m,) positive w_i, ones if not given.
        starts: first guesses; None for the number the solver was tuned with.
        threads: not used for one target; see `Shooter.solve` for batches.
        progress: called with one line a stage.

    Raises:
        InputError: starts below 1, weights that are not positive.
        SteeringError: if no method reaches the target; says what was tried.
    """
    if starts is not None and operator.index(starts) < 1:
        raise InputError(f"steer({task.group.name}): starts must be at least 1, got {starts}")
    say = progress or (lambda line: None)
    started = time.perf_counter()
    solver = shooter(task.group, task.controls)
    w = solver.check_weights(weights)
    built = time.perf_counter()
    tried: list[str] = []
    first = solver.starts if starts is None else starts
    best: Extremals | None = None
    for count in (first, first * _MORE):
        found = solver.solve(task.target, weights=w, starts=count, threads=threads)
        tried.append(f"shooting, {count} starts, {found.converged[0]} converged")
        say(tried[-1])
        if found.status[0] == SOLVED:
            best = found if best is None or found.cost[0] < best.cost[0] else best
            if starts is not None or found.agreeing[0] > _LONELY:
                break
    if best is not None:
        seconds = {"build": built - started, "solve": time.perf_counter() - built}
        return _plan(task, solver, best, w, tuple(tried), seconds)
    if found.residual[0] <= _CLOSE * task.tolerance:
        seconds = {"build": built - started, "solve": time.perf_counter() - built}
        return _plan(task, solver, found, w, tuple(tried), seconds)
    from lie_codegen.steering.transcription.transcribe import least_energy

    say("shooting failed: transcription")
    return least_energy(task, weights=w, tried=tuple(tried), progress=progress)


def _plan(
    task: Task, solver: Shooter, found: Extremals, weights: Array, tried: tuple[str, ...], seconds: dict[str, float]
) -> Plan:
    """The plan; the energy of an extremal is constant in time, so that with equal weights its cost is known."""
    extremal = cache(lambda: solver.extremal(found.mu0[0], weights=weights))
    u = extremal_controls(task, extremal)
    known = {"cost": float(found.cost[0]) / task.duration} if np.all(weights == 1) else {}

    def examine() -> Plan:
        return _examined(task, solver, found, weights, tried, seconds, extremal(), u)

    return PlanOnDemand(
        examine,
        group=task.group,
        target=task.target,
        controls=tuple(task.group.labels[i] for i in task.controls),
        duration=task.duration,
        method="optimal",
        u=u,
        **known,
    )


def _examined(
    task: Task,
    solver: Shooter,
    found: Extremals,
    weights: Array,
    tried: tuple[str, ...],
    seconds: dict[str, float],
    extremal: Extremal,
    u: Controls,
) -> Plan:
    started = time.perf_counter()
    singular = extremal.singular_values()
    conjugate = extremal.conjugate_times()
    ratio = extremal.conjugacy()
    taken = {**seconds, "examine": time.perf_counter() - started}
    details = {
        "winner": "shooting on the Lie-Poisson equations" + ("" if solver.compiled else ", in numpy (no C compiler)"),
        "tried": tried,
        "starts": int(found.starts[0]),
        "converged": int(found.converged[0]),
        "agreeing": int(found.agreeing[0]),
        "linearisations": int(found.linearisations[0]),
        "costate": found.mu0[0] / task.duration,
        "weights": weights,
        "weighted_cost": float(found.cost[0]) / task.duration,
        "residual": float(found.residual[0]),
        "singular_values": singular,
        "conjugate_target": ratio < _CONJUGATE,
        "conjugate_times": tuple(t * task.duration for t in conjugate),
        "optimality": _optimality(int(found.starts[0]), int(found.agreeing[0]), ratio, conjugate),
        "discretisation": "none: the extremal is exact to rounding",
        "extremal": extremal,
    }
    return finish(task, "optimal", u, details, taken, solved=Status.LOCAL, otherwise=Status.NOT_CONVERGED)


def _optimality(starts: int, agreeing: int, ratio: float, conjugate: tuple[float, ...]) -> str:
    """What is known, and what is not."""
    if conjugate:
        first = f"an extremal with a conjugate point at {conjugate[0]:.3f} of its duration: not a local minimum; try more starts"
    elif ratio < _CONJUGATE:
        first = (
            "an extremal whose target is a conjugate point: one of a family of equal cost (the phase of a loop is free), "
            "no conjugate point before it"
        )
    else:
        first = "a strict local minimum: no conjugate point up to the target"
    return (
        f"{first}; the cheapest extremal of {starts} starts, {agreeing} of which ended within 1 % of its cost; that nothing "
        "is cheaper is likely, not proved"
    )


def extremal_controls(task: Task, extremal: Callable[[], Extremal]) -> Controls:
    """The controls of an extremal, slowed down to the task's duration."""

    def evaluate(t: Array) -> Array:
        u = np.zeros((len(t), task.group.dim))
        u[:, list(task.controls)] = extremal().control(np.clip(t / task.duration, 0, 1)) / task.duration
        return u

    return Controls(evaluate, ())
