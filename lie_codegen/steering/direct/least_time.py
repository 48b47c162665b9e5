"""objective="time": words of arcs with constant controls, X = X0 exp(s_1 V_1) ... exp(s_K V_K), least sum of the durations s_k >= 0.

With a drift, the durations that reach a goal may have gaps (a Dubins car returns to a pose beside it after a full turn, not a
little later): there is no bisection over the duration. The letters V are drift + sum u_i b_i with each control at a bound or zero
(the singular arcs of straight motion); words of as many arcs as the group has dimensions, all of them where they are few, and
longer words of which the descent drops arcs, as the limits at zero do with an objective that is a sum.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import SteeringError
from lie_codegen.steering.direct.arc_descent import Candidate, WordDescent
from lie_codegen.steering.direct.arc_words import (
    letters_of,
    long_words,
    longest_useful,
    short_words,
)
from lie_codegen.steering.direct.assemble import Manoeuvre
from lie_codegen.steering.direct.compiled import machine
from lie_codegen.steering.direct.inputs import Drive, Inputs
from lie_codegen.steering.direct.magnus_flow import end_reached
from lie_codegen.steering.direct.polish import Flown
from lie_codegen.steering.direct.programme import Settings, chosen
from lie_codegen.steering.direct.report import error_at, plan_of
from lie_codegen.steering.direct.search import threshold
from lie_codegen.steering.plan import Plan, Status

#: Arcs of a long word, in units of the group's dimension.
_LONG = 3
_KEPT = 64
#: The shortest words, which are descended again to the last digits.
_SHARPENED = 8
_AGREEING = 1e-3
#: Starts that must agree on the shortest before another round is not tried.
_ENOUGH = 3


def least_time(
    task: Manoeuvre,
    target: Any,
    tolerance: float,
    settings: Settings,
    starts: int,
    rounds: int,
    seed: int,
    longest: float,
    say: Callable[[str], None],
    vertices: ArrayLike | None = None,
) -> Plan:
    """The plan of least duration found; `task.duration` is the unit of the first guesses, and of `longest`.

    Raises:
        SteeringInputError: controls without bounds, or a system that depends on time.
        SteeringError: no word of arcs was found that reaches the goal.
    """
    began = time.perf_counter()
    letters, velocities = letters_of(task, vertices)
    solver = machine(task.system.group, 1)
    arcs = replace(task, low=np.zeros(1), high=np.ones(1), weights=np.ones(1))
    descent = WordDescent(arcs, solver, velocities, longest_useful(task, velocities, longest), settings, longest)
    tried: list[str] = []
    best: list[Candidate] = []
    nearest: Candidate | None = None
    total = reached = agree = 0
    n = task.system.group.dim
    for round_ in range(rounds):
        rng = np.random.default_rng([seed, round_, 11])
        long = _LONG * n * (1 + round_)
        # Where arcs are long most optima have no control at zero: such words are tried for themselves, among many with zeros they would be rare.
        bangs = np.flatnonzero(np.all(letters != 0, axis=1))
        bangs = bangs if len(bangs) > 1 else np.arange(len(letters))
        for name, words in (
            ("short words", short_words(len(letters), n, starts, rng)),
            ("long words", long_words(len(letters), long, 4 * starts, rng)),
            ("long words without zeros", bangs[long_words(len(bangs), long, 2 * starts, rng)]),
        ):
            found, near = _solve(descent, words, rng)
            nearest = near if nearest is None or near[0] < nearest[0] else nearest
            total += len(words)
            reached += len(found)
            tried.append(
                f"round {round_ + 1}: {len(found)} of {len(words)} starts of {name} ({words.shape[1]} arcs) arrive"
            )
            say(tried[-1])
            best += found
        best.sort(key=lambda each: each[0])
        agree = sum(each[0] <= best[0][0] * (1 + _AGREEING) for each in best)
        if agree >= _ENOUGH:
            break
    if not best:
        raise _not_found(task, target, tolerance, letters, nearest, tried, total, seed, longest, began)
    best = [
        *(descent.sharpened(each) for each in best[:_SHARPENED]),
        *best[_SHARPENED:],
    ]
    best.sort(key=lambda each: each[0])
    best[0] = descent.with_other_arcs(best[0])
    # The shortest word that the simulated system confirms.
    for _, word, durations, variant in best[:_KEPT]:
        flown, sequence = _flown(task, letters, word, durations, variant)
        if flown.miss <= max(1e-9, 1e-2 * tolerance):
            break
    details = {
        "winner": "direct, words of arcs",
        "objective": "time",
        "tried": tuple(tried),
        "starts": total,
        "reached": reached,
        "agree": agree,
        "seed": seed,
        "arcs": sequence,
        "discretisation": "none: arcs of constant controls",
        "compiled": solver.compiled,
        "optimality": f"a local minimum of the duration, the shortest of {reached} starts that arrived; {agree} ended within 0.1 % of it",
    }
    if task.end.phases:
        details["phase"] = task.end.phases[variant]
    return plan_of(task, target, flown, variant, tolerance, "time", details, {"solve": time.perf_counter() - began})


def _not_found(
    task: Manoeuvre,
    target: Any,
    tolerance: float,
    letters: Array,
    nearest: Candidate | None,
    tried: list[str],
    total: int,
    seed: int,
    longest: float,
    began: float,
) -> SteeringError:
    """The error, with the word that ends nearest to the goal."""
    said = (
        f"steer({task.system.group.name}): no word of arcs was found that reaches the goal within {longest:g} times the given duration, "
        f"from {total} starts (seed {seed}), which proves nothing; more starts, another seed, a larger `longest`"
    )
    if nearest is None:
        return SteeringError(said)
    _, word, durations, variant = nearest
    flown, sequence = _flown(task, letters, word, durations, variant)
    details: dict[str, Any] = {
        "tried": tuple(tried),
        "starts": total,
        "reached": 0,
        "agree": 0,
        "seed": seed,
        "arcs": sequence,
        "objective": "time",
    }
    over = float(flown.inputs.knots[-1]) - longest * task.duration
    details["violation"] = {"end": error_at(task, flown, variant), "duration": max(0.0, over)}
    took = {"solve": time.perf_counter() - began}
    plan = plan_of(task, target, flown, variant, tolerance, "time", details, took, Status.NOT_FOUND)
    return SteeringError(said, best=plan, violation=plan.violation)


def _solve(descent: WordDescent, words: Array, rng: np.random.Generator) -> tuple[list[Candidate], Candidate]:
    """(duration, word, durations, variant) of words that reach the goal, the shortest of them descended; and (residual, word,
    durations, variant) of the nearest."""
    arcs, solver, limits, settings = descent.arcs, descent.solver, descent.limits, descent.settings
    lanes, count = words.shape
    programme = descent.programme(words)
    variant = np.arange(lanes) % len(arcs.end.values)
    # durations that add up to between a third and three times the given one
    parts = rng.dirichlet(np.ones(count), lanes) * (3.0 ** rng.uniform(-1, 1, (lanes, 1)))
    parts = np.minimum(parts, limits[words])
    before, after = arcs.free_slots
    u = np.concatenate([np.zeros((lanes, before)), parts, np.zeros((lanes, after))], axis=1)[..., None]
    u[:, :before, 0] = rng.uniform(-np.pi, np.pi, (lanes, before))
    u[:, before + count :, 0] = rng.uniform(-np.pi, np.pi, (lanes, after))
    goal = arcs.goal(variant)
    found = solver.reach(programme, goal, u, replace(settings, reach_iterations=min(60, settings.reach_iterations)))
    there = np.flatnonzero(found.size <= threshold(arcs, settings))
    length = np.sum(np.minimum(arcs.own(found.u)[..., 0], limits[words]), axis=1)
    there = there[np.argsort(length[there], kind="stable")][:_KEPT]
    close = int(np.nanargmin(found.size))
    near = (float(found.size[close]), words[close], found.u[close], int(variant[close]))
    if not len(there):
        return [], near
    part, aim = chosen(programme, goal, there)
    lower = solver.descend(part, aim, found.u[there], settings)
    results = []
    for lane, number in enumerate(there):
        word, durations, size = descent.tidied(words[number], lower.u[lane], int(variant[number]))
        if size <= threshold(arcs, settings) and np.sum(arcs.own(durations)) <= descent.longest:
            results.append((float(np.sum(arcs.own(durations))), word, durations, int(variant[number])))
    return results, near


def _flown(
    task: Manoeuvre, letters: Array, word: Array, u: Array, variant: int
) -> tuple[Flown, tuple[tuple[float, ...], ...]]:
    """The arcs as inputs of the system's own time, flown; and (controls ..., duration) of each arc in that order."""
    one = replace(task, low=np.zeros(1), high=np.ones(1), weights=np.ones(1))
    durations = one.own(u)[:, 0] * task.duration
    values = letters[word]
    if task.system.right:
        durations, values = durations[::-1], values[::-1]
    knots = np.concatenate([[0.0], np.cumsum(durations)])
    inputs = Inputs.constant(knots, values)
    X = end_reached(Drive(task.system, inputs))
    left, right = one.free_motions(u)
    miss = task.end.left @ left @ X @ right @ task.end.right - task.end.values[variant]
    sequence = tuple((*map(float, controls), float(s)) for controls, s in zip(values, durations, strict=True))
    return Flown(inputs, X, float(np.linalg.norm(miss)), (left, right)), sequence
