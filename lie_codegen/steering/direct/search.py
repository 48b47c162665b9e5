"""Stages 1 and 2: rounds of many starts that only try to arrive, then a descent from each that did."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.direct.assemble import Manoeuvre
from lie_codegen.steering.direct.programme import Goal, Machine, Programme, Reached, Settings
from lie_codegen.steering.direct.starts import kicked, starts, still, with_free_slots

#: Starts of a round that must arrive before another round is not tried.
_PLENTY = 4
#: Least starts for each of a goal's variants (the phases of a gate).
_EACH = 4
_AGREEING = 0.01
#: Lanes that are kept where none arrived.
_NEAR = 8
#: Dimension above which a few starts alone descend, and how many.
LARGE, _SIDE_BY_SIDE = 20, 8


@dataclass(frozen=True)
class Budget:
    """How hard to search; iterations and starts, never seconds.

    Attributes:
        starts: first guesses a round.
        rounds: most rounds.
        pieces: of the controls.
        seed: of the guesses.
        settings: of the machine.
    """

    starts: int
    rounds: int
    pieces: int
    seed: int
    settings: Settings


@dataclass(frozen=True, eq=False)
class Found:
    """What the search found.

    Attributes:
        u: (S, m) of the cheapest lane that arrived, or of the nearest where none did.
        variant: of the goal, for that lane.
        residual: at its goal.
        arrived: whether it is there.
        cost: its objective.
        starts, reached, agree: starts tried, starts that arrived, starts that descended to within 1 % of the cheapest.
        tried: one line a round.
        near: controls (S, m) and variants of the lanes that came nearest where none arrived.
    """

    u: Array = field(repr=False)
    variant: int
    residual: float
    arrived: bool
    cost: float
    starts: int
    reached: int
    agree: int
    tried: tuple[str, ...]
    near: tuple[tuple[Array, int], ...] = field(default=(), repr=False)


def search(
    task: Manoeuvre,
    programme: Programme,
    machine: Machine,
    budget: Budget,
    guesses: Array | None,
    say: Callable[[str], None],
) -> Found:
    """The cheapest controls found on the programme's slots; guesses (k, S - free, m) are starts beside the others."""
    settings = budget.settings
    enough = threshold(task, settings)
    tried: list[str] = []
    kept: list[tuple[Array, Array, Array]] = []
    total = 0
    variants = len(task.end.values)
    for round_ in range(budget.rounds):
        lanes = max(budget.starts, variants * (_EACH if settings.descend_iterations else 1))
        u = starts(task, budget.pieces, lanes, budget.seed, round_)
        # in blocks: kinds of starts alternate, and every variant should have all of them
        variant = np.arange(lanes) * variants // lanes
        if guesses is not None and round_ == 0:
            u = np.concatenate([*[guesses] * variants, u])
            variant = np.concatenate([np.repeat(np.arange(variants), len(guesses)), variant])
        u = with_free_slots(task, u, budget.seed + round_)
        # where a round failed the next one is more patient: of the starts for a gate at a quarter of its free phase's bounds 13 of 96
        # arrive within 150 steps, 36 within 400
        patient = replace(settings, reach_iterations=(1 + round_) * settings.reach_iterations)
        goal = task.goal(variant)
        # with any phase nearly every start for a gate arrives, but seldom at the cheapest phase: first each phase has its starts, and
        # where arriving is all, or the phases refuse, the starts choose for themselves
        free = len(task.end.phases) > 1 and (settings.descend_iterations == 0 or round_ % 2 == 1)
        goal = replace(goal, free_phase=free)
        found = machine.reach(programme, goal, u, patient)
        if round_ == 0:
            # no controls, and those that were given: neither is random
            given = np.arange((0 if guesses is None else variants * len(guesses)) + 1)
            found = _roused(task, programme, machine, goal, found, given, budget.seed, patient)
        if free:
            variant = _nearest_variant(task, variant, found.phase)
        total += len(u)
        there = found.size <= enough
        tried.append(f"round {round_ + 1}, seed {budget.seed}: {int(np.sum(there))} of {len(u)} starts reach the goal")
        say(tried[-1])
        kept.append((found.u, found.size, variant))
        if sum(int(np.sum(size <= enough)) for _, size, _ in kept) >= min(_PLENTY, budget.starts, settings.wanted):
            break
    u, size, variant = (np.concatenate(each) for each in zip(*kept, strict=True))
    arrived = np.flatnonzero(size <= enough)
    reached = len(arrived)
    if not reached:
        order = np.argsort(size, kind="stable")[:_NEAR]
        near = tuple((u[lane], int(variant[lane])) for lane in order)
        return Found(*near[0], float(size[order[0]]), False, np.inf, total, 0, 0, tuple(tried), near)
    # the cheapest first: those that are side by side later give up as soon as they cannot catch up
    effort = np.sum(programme.weight * u[arrived] ** 2, axis=(1, 2)) / 2
    order = np.argsort(effort, kind="stable")
    arrived, effort = arrived[order], effort[order]
    if task.system.group.dim > LARGE:
        # a descent takes seconds there: as many as run side by side
        arrived, effort = arrived[:_SIDE_BY_SIDE], effort[:_SIDE_BY_SIDE]
    if settings.descend_iterations == 0:
        # lanes that were left where they are when others had arrived would have to be restored first
        whole = size[arrived] <= settings.enough
        best = int(np.argmax(whole))
        lane = arrived[best]
        return Found(
            u[lane], int(variant[lane]), float(size[lane]), True, float(effort[best]), total, reached, 1, tuple(tried)
        )
    lower = machine.descend(programme, task.goal(variant[arrived]), u[arrived], settings)
    say(f"descent from {len(arrived)} starts: {int(np.max(lower.used))} steps at most")
    return _best(lower, variant[arrived], total, reached, tuple(tried))


def _roused(
    task: Manoeuvre,
    programme: Programme,
    machine: Machine,
    goal: Goal,
    found: Reached,
    lanes: Array,
    seed: int,
    settings: Settings,
) -> Reached:
    """The same, but for those of the lanes that stand still short of the goal: these go on from a little aside.

    A target that a symmetry maps to itself is never left by steps that keep the symmetry (no controls, a quarter turn about the third
    axis of SO(3) by the other two; every gate whose matrix is real).
    """
    enough = threshold(task, settings)
    if int(np.sum(found.size <= enough)) >= settings.wanted:
        return found
    lanes = lanes[found.size[lanes] > enough]
    if not len(lanes):
        return found
    _, r, J = machine.linearise(programme, replace(goal, value=goal.value[lanes]), found.u[lanes])
    lanes = lanes[still(programme, found.u[lanes], r, J)]
    if not len(lanes):
        return found
    again = machine.reach(
        programme, replace(goal, value=goal.value[lanes]), kicked(task, found.u[lanes], seed), settings
    )
    parts = {each.name: np.array(getattr(found, each.name)) for each in fields(Reached)}
    for name, values in parts.items():
        values[lanes] = getattr(again, name) + (found.used[lanes] if name == "used" else 0)
    return Reached(**parts)


def _nearest_variant(task: Manoeuvre, variant: Array, ahead: Array) -> Array:
    """(lanes,) the variant of the goal that each lane ends nearest to, `ahead` of its own by a phase: on SU(d) a gate that is met up to a
    phase is met at one of them, and of all multiples of a gate the nearest in phase is the nearest."""
    phases = np.array(task.end.phases)
    away = np.cos((phases[variant] + ahead)[:, None] - phases)
    return np.asarray(np.argmax(away, axis=1))


def threshold(task: Manoeuvre, settings: Settings) -> float:
    """Residual at which a lane is there: rounding grows with the size of the goal."""
    return 1e3 * settings.enough * max(1.0, float(np.max(np.abs(task.end.values))))


def _best(lower: Reached, variant: Array, total: int, reached: int, tried: tuple[str, ...]) -> Found:
    best = int(np.argmin(lower.cost))
    cost = float(lower.cost[best])
    agree = int(np.sum(lower.cost <= cost * (1 + _AGREEING) + 1e-12))
    return Found(lower.u[best], int(variant[best]), float(lower.size[best]), True, cost, total, reached, agree, tried)


def once_more(machine: Machine, programme: Programme, goal: Goal, u: Array, settings: Settings) -> tuple[Array, float]:
    """Controls (S, m) near u that reach the goal, cheaper if that is possible; the residual."""
    reached = machine.reach(programme, goal, u[None], replace(settings, damping=1e-9))
    lower = machine.descend(programme, goal, reached.u, settings)
    return lower.u[0], float(lower.size[0])


def restored(machine: Machine, programme: Programme, goal: Goal, u: Array, settings: Settings) -> tuple[Array, float]:
    """Controls (S, m) near u that reach the goal, and the residual."""
    reached = machine.reach(programme, goal, u[None], replace(settings, damping=1e-9))
    return reached.u[0], float(reached.size[0])
