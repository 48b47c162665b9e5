"""method="optimal": minimum energy for any controllable left-invariant system, by the best means that works.

    minimise int_0^T sum_i w_i u_i^2 dt   subject to   X' = X sum_i u_i A_i,  X(0) = I,  X(T) = target

To a set of goals besides <mu(T), F> = 0 along the directions F that it leaves free (transversality). First shooting on the
Lie-Poisson equations from the area rule; where that fails, or hardly any starts agree on the cheapest, with ten times the starts; then, unless the residual is well below the tolerance, the direct transcription. What won, and what was
tried, is in the plan's details.
"""

from __future__ import annotations

import operator
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, SteeringError
from lie_codegen.steering.optimal import ELSEWHERE, Shot, extremal_controls
from lie_codegen.steering.plan import Plan
from lie_codegen.steering.shooting.extremals import SOLVED, Extremals
from lie_codegen.steering.shooting.from_guess import nearest_costate
from lie_codegen.steering.shooting.shooter import Shooter, shooter
from lie_codegen.steering.shooting.transversal import Met, met
from lie_codegen.steering.simulated_plan import energy
from lie_codegen.steering.task import Task

_MORE = 10
#: A cheapest extremal that no more starts than these found is searched for again (SL(2): 4 of 60 were not the cheapest, then none).
_LONELY = 2
_CLOSE = 0.01
#: Intervals at which a guess is looked at.
_GUESSED = 96


def optimal(
    task: Task,
    *,
    weights: ArrayLike | None = None,
    starts: int | None = None,
    threads: int = 1,
    guess: Any = None,
    progress: Callable[[str], None] | None = None,
) -> Plan:
    """The minimum-energy manoeuvre, the best of several starts.

    Args:
        task: the task.
        weights: (m,) positive w_i, ones if not given.
        starts: first guesses; None for the number the solver was tuned with.
        threads: not used for one target; see `Shooter.solve` for batches.
        guess: controls whose nearest extremal is one start more: a Plan, (k, m) samples, a function of t, a path.
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
    mu0 = None
    if guess is not None:
        from lie_codegen.steering.transcription.guess import given_guess

        velocities = given_guess(task, _GUESSED, np.zeros(task.group.dim), guess)
        mu0 = nearest_costate(task.group, task.controls, velocities, w)
    if task.free is not None:
        return _to_a_set(task, solver, w, starts, mu0, built - started, say)
    tried: list[str] = []
    first = solver.starts if starts is None else starts
    best: Extremals | None = None
    # Ten times the starts only where nothing was found, or so few agree on the cheapest that a cheaper one may have been missed.
    for count in (first, first * _MORE):
        found = solver.solve(task.target, weights=w, starts=count, threads=threads)
        tried.append(f"shooting, {count} starts, {found.converged[0]} converged")
        say(tried[-1])
        if found.status[0] == SOLVED:
            best = found if best is None or found.cost[0] < best.cost[0] else best
            if starts is not None or found.agreeing[0] > _LONELY:
                break
    own = (
        None
        if mu0 is None
        else met(lambda mu: solver.extremal(mu, weights=w), mu0, task.target, np.zeros((0, len(mu0))))
    )
    if own is not None:
        cost = _cost(task, own, w)
        tried.append(f"the guess given: an extremal of cost {cost / task.duration:.6g}, miss {own.miss:.1e}")
        say(tried[-1])
        if own.converged and (best is None or cost < float(best.cost[0])):
            best = _of_met(found if best is None else best, own, cost)
    if best is not None:
        seconds = {"build": built - started, "solve": time.perf_counter() - built}
        return _plan(task, solver, best, w, tuple(tried), seconds)
    # Not converged by its own strict rule, yet a hundred times closer than was asked: transcription would not come nearer.
    if found.residual[0] <= _CLOSE * task.tolerance:
        seconds = {"build": built - started, "solve": time.perf_counter() - built}
        return _plan(task, solver, found, w, tuple(tried), seconds)
    from lie_codegen.steering.transcription.transcribe import least_energy

    say("shooting failed: transcription")
    return least_energy(task, weights=w, guess=guess, tried=tuple(tried), progress=progress)


def _to_a_set(
    task: Task,
    solver: Shooter,
    weights: Array,
    starts: int | None,
    guess: Array | None,
    build: float,
    say: Callable[[str], None],
) -> Plan:
    """The cheapest extremal that meets the set transversally, from the extremals to its element given and to others of it."""
    if task.free is None:
        raise ValueError("a set of goals leaves directions free")
    began = time.perf_counter()
    tried: list[str] = []
    best: tuple[float, Met, Extremals] | None = None
    for number, element in enumerate(task.elements(ELSEWHERE), start=1):
        shot = solver.solve(element, weights=weights, starts=starts)
        begun = [(f"shooting to element {number} of the set, {shot.converged[0]} starts converged", shot.mu0[0])]
        if guess is not None and number == 1:
            begun.append(("the guess given", guess))
        for name, mu0 in begun:
            ends = met(lambda mu: solver.extremal(mu, weights=weights), mu0, element, task.free)
            cost = _cost(task, ends, weights)
            tried.append(
                f"{name}; along the set to cost {cost / task.duration:.6g}, miss {ends.miss:.1e}, transversality "
                f"{ends.transversality:.1e}"
            )
            say(tried[-1])
            if ends.converged and (best is None or cost < best[0]):
                best = cost, ends, shot
    if best is None:
        raise SteeringError(
            f"steer({task.group.name}): no extremal found that meets the set of goals transversally, which proves nothing: "
            f'{"; ".join(tried)}; more starts, or method="direct"'
        )
    cost, ends, shot = best
    found = _of_met(shot, ends, cost)
    seconds = {"build": build, "solve": time.perf_counter() - began}
    return _plan(replace(task, target=ends.target), solver, found, weights, tuple(tried), seconds)


def _cost(task: Task, ends: Met, weights: Array) -> float:
    """Of an extremal, in unit time: its energy is constant."""
    return float(np.sum(ends.extremal.mu0[list(task.controls)] ** 2 / weights))


def _of_met(shot: Extremals, ends: Met, cost: float) -> Extremals:
    """The record of a shot, with another extremal in it."""
    return replace(shot, mu0=ends.extremal.mu0[None], cost=np.array([cost]), residual=np.array([ends.miss]))


def _plan(
    task: Task, solver: Shooter, found: Extremals, weights: Array, tried: tuple[str, ...], seconds: dict[str, float]
) -> Plan:
    """The plan; the energy of an extremal is constant in time, so that with equal weights its cost is known."""
    u = extremal_controls(task, found.mu0[0], weights)
    outcome = Shot(
        controls=task.controls,
        tolerance=task.tolerance,
        weights=weights,
        mu0=found.mu0[0],
        weighted_cost=float(found.cost[0]) / task.duration,
        residual=float(found.residual[0]),
        counts=tuple(int(each[0]) for each in (found.starts, found.converged, found.agreeing, found.linearisations)),
        tried=tried,
        seconds=seconds,
        free=task.free,
    )
    return Plan(
        group=task.group,
        target=task.target,
        controls=tuple(task.group.labels[i] for i in task.controls),
        duration=task.duration,
        method="optimal",
        u=u,
        cost=outcome.weighted_cost if np.all(weights == 1) else energy(u, task.duration),
        outcome=outcome,
    )
