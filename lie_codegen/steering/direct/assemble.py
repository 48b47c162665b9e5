"""From a system and its goal to the chain of exponentials that the search works on: constant pieces, or controls linear between nodes.

Where nothing depends on time a constant piece is one exponential, exactly. Otherwise, and for linear controls, each step of a piece is
two exponentials with weighted Gauss points (commutator-free, order four: Celledoni, Marthinsen and Owren, Future Gener. Comput.
Syst. 19 (2003) 341): a in [1/4 +- sqrt 3 / 6]. What this leaves over is taken away by the caller, who flies the plan.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.direct.programme import Goal, Programme
from lie_codegen.steering.direct.system import System
from lie_codegen.steering.end import End

#: Weights of the earlier and the later Gauss point in the first of two exponentials, the other way round in the second.
EARLY, LATE = 0.25 + math.sqrt(3) / 6, 0.25 - math.sqrt(3) / 6
_GAUSS = 0.5 + np.array([-1, 1]) * math.sqrt(3) / 6
#: Length |h a| of a step of two exponentials, and the most steps a piece is cut into.
_STEP, _MOST_STEPS = 0.5, 8


@dataclass(frozen=True, eq=False)
class Manoeuvre:
    """A system, where it must end, in which time and within which limits.

    Attributes:
        system, end, duration: the problem; duration in seconds.
        low, high, weights: (m,) limits of the controls and weights of the objective.
    """

    system: System
    end: End
    duration: float
    low: Array = field(repr=False)
    high: Array = field(repr=False)
    weights: Array = field(repr=False)

    @property
    def controls(self) -> int:
        """m."""
        return len(self.low)

    @property
    def free_slots(self) -> tuple[int, int]:
        """Slots before and after the controls' own for motions that the goal leaves free."""
        m = self.controls
        return -(-len(self.end.before) // m), -(-len(self.end.after) // m)

    def goal(self, variant: Array) -> Goal:
        """The goal of lanes, each with one of the variants."""
        right = self.end.right
        if self.system.right:
            right = self.system.start @ right
        return Goal(self.end.left, right, self.end.values[variant])

    def own(self, u: Array) -> Array:
        """The controls' own slots of (..., S, m)."""
        before, after = self.free_slots
        return u[..., before : u.shape[-2] - after, :]

    def free_motions(self, u: Array) -> tuple[Array, Array]:
        """exp of the free motions before and after, of controls (S, m), acting on X from the left and from the right."""
        from lie_codegen.flow.batched_exponential import expm

        group, m = self.system.group, self.controls
        sides = []
        for directions, slots in zip(
            (self.end.before, self.end.after), (u[: self.free_slots[0]], u[len(u) - self.free_slots[1] :]), strict=True
        ):
            motion = np.eye(group.degree, dtype=group.basis.dtype)
            for number, slot in enumerate(slots):
                some = directions[number * m : (number + 1) * m]
                motion = motion @ expm(group.hat(slot[: len(some)] @ some))
            sides.append(motion)
        return sides[0], sides[1]


def constant_pieces(task: Manoeuvre, pieces: int, steps: int = 1) -> Programme:
    """Controls constant on equal pieces; where nothing depends on time each is as many exponentials as there are steps."""
    h = task.duration / pieces
    if task.system.steady:
        drifts, directions = _sampled(task, np.zeros(1))
        table = (h / steps * drifts, h * directions, np.zeros(pieces * steps, int))
        slot, share = np.repeat(np.arange(pieces), steps), np.tile([1.0 / steps, 0.0], (pieces * steps, 1))
    else:
        rows, slot, share = [], np.repeat(np.arange(pieces), 2), np.tile([0.5, 0.0], (2 * pieces, 1))
        for k in range(pieces):
            rows += _pair(task, k * h, h)
        table = _stacked(rows)
    return programme_of(task, table, slot, share, np.ones(pieces))


def linear_pieces(task: Manoeuvre, pieces: int, speed: float, steps: int = 1) -> Programme:
    """Controls linear between equidistant nodes; `speed`: norm of the velocity, for the length of steps, of which there are `steps` at
    least."""
    h = task.duration / pieces
    steps = max(steps, int(np.clip(math.ceil(h * speed / _STEP), 1, _MOST_STEPS)))
    slot = np.repeat(np.arange(pieces), 2 * steps)
    shares = []
    for step in range(steps):
        early, late = (step + _GAUSS) / steps
        for a, b in ((EARLY, LATE), (LATE, EARLY)):
            shares.append(((a * (1 - early) + b * (1 - late)) / steps, (a * early + b * late) / steps))
    share = np.tile(shares, (pieces, 1))
    if task.system.steady:
        drifts, directions = _sampled(task, np.zeros(1))
        table = (h / (2 * steps) * drifts, h * directions, np.zeros(len(slot), int))
    else:
        rows = []
        for step in range(pieces * steps):
            rows += _pair(task, step * h / steps, h / steps, per_step=1 / steps)
        table = _stacked(rows)
    mass = np.ones(pieces + 1)
    mass[[0, -1]] = 0.5
    return programme_of(task, table, slot, share, mass)


def _sampled(task: Manoeuvre, t: Array) -> tuple[Array, Array]:
    """hat of drift (k, d, d) and directions (k, m, d, d); of the left-invariant system in reversed time where it is right-invariant."""
    system = task.system
    times = task.duration - t if system.right else t
    return system.group.hat(system.drift.at(times)), system.group.hat(system.directions_at(times))


def _pair(task: Manoeuvre, start: float, h: float, per_step: float = 1.0) -> list[tuple[Array, Array]]:
    """Two rows of the table for one step: drift times its length, directions so that shares that add up to 1/2 are left over."""
    drifts, directions = _sampled(task, start + h * _GAUSS)
    return [
        (h * (a * drifts[0] + b * drifts[1]), h / per_step * 2 * (a * directions[0] + b * directions[1]))
        for a, b in ((EARLY, LATE), (LATE, EARLY))
    ]


def _stacked(rows: list[tuple[Array, Array]]) -> tuple[Array, Array, Array]:
    return np.array([row[0] for row in rows]), np.array([row[1] for row in rows]), np.arange(len(rows))


def programme_of(
    task: Manoeuvre, table: tuple[Array, Array, Array], slot: Array, share: Array, mass: Array
) -> Programme:
    """The programme, with the free motions of the goal as exponentials of their own, without bounds or cost."""
    system, m = task.system, task.controls
    group, n = system.group, len(mass)
    drifts, directions, entry = table
    start = np.eye(group.degree, dtype=group.basis.dtype) if system.right else system.start
    low, high, weight = (np.tile(each, (n, 1)) for each in (task.low, task.high, task.weights))
    if not len(task.end.before) and not len(task.end.after):
        return Programme(group.basis, start, drifts, directions, entry[None], slot, share, low, high, weight, mass)
    # a left-invariant system reads L X0 E_1 ...: a motion before X0 is one after it, turned by X0; and so on the other side
    before = _turned(task.end.before, group, np.linalg.inv(system.start), not system.right)
    after = _turned(task.end.after, group, system.start, system.right)
    first, last = (_free_rows(group, rows, m) for rows in (before, after))
    extra = [*first, *last]
    zero = np.zeros((len(extra), group.degree, group.degree), group.basis.dtype)
    rows = len(drifts)
    drifts = np.concatenate([drifts, zero])
    directions = np.concatenate([directions, np.array(extra)])
    entry = np.concatenate([rows + np.arange(len(first)), entry, rows + len(first) + np.arange(len(last))])
    whole = np.tile([1.0, 0.0], (1, 1))
    slot = np.concatenate([np.arange(len(first)), len(first) + slot, len(first) + n + np.arange(len(last))])
    share = np.concatenate([np.repeat(whole, len(first), 0), share, np.repeat(whole, len(last), 0)])
    open_ends = [np.full((len(side), m), np.inf) for side in (first, last)]
    return Programme(
        basis=group.basis,
        start=start,
        drifts=drifts,
        directions=directions,
        entry=entry[None],
        slot=slot,
        share=share,
        low=np.concatenate([-open_ends[0], low, -open_ends[1]]),
        high=np.concatenate([open_ends[0], high, open_ends[1]]),
        weight=np.concatenate(
            [0 * np.nan_to_num(open_ends[0], posinf=0), weight, 0 * np.nan_to_num(open_ends[1], posinf=0)]
        ),
        mass=np.concatenate([np.ones(len(first)), mass, np.ones(len(last))]),
    )


def _turned(rows: Array, group: Any, by: Array, turn: bool) -> Array:
    """hat of the rows, as Y hat Y^-1 with Y = by where `turn`."""
    matrices = group.hat(rows) if len(rows) else np.zeros((0, group.degree, group.degree), group.basis.dtype)
    return np.asarray(by @ matrices @ np.linalg.inv(by)) if turn else matrices


def _free_rows(group: Any, matrices: Array, m: int) -> list[Array]:
    """The matrices, m an exponential, filled up with zeros."""
    rows = []
    for k in range(0, len(matrices), m):
        row = np.zeros((m, group.degree, group.degree), group.basis.dtype)
        row[: len(matrices[k : k + m])] = matrices[k : k + m]
        rows.append(row)
    return rows
