"""Stages 1 and 2 among obstacles under torques: a course of velocities, whose controls are what torques make of them.

X' = X hat(xi) is followed by two exponentials a step with xi at the Gauss points of the step, as `assemble` does for controls that
depend on time. What the course of velocities knows of a step, changes by velocities, is carried back to torques by the chain rule; the
velocity at the end is one more row of the goal.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.direct.assemble import EARLY, LATE, Manoeuvre, programme_of
from lie_codegen.steering.direct.clear_search import SHORTEST, Course, Known
from lie_codegen.steering.direct.numpy_search import Box, Lanes, Rows
from lie_codegen.steering.direct.programme import Goal
from lie_codegen.steering.direct.torque_flow import TorqueFlow
from lie_codegen.steering.obstacles.keep_out import KeepOut


@dataclass(frozen=True, eq=False)
class TorqueCourse:
    """A course whose controls are torques; lanes are (torques of all slots, free motions of the goal, the duration of least time).

    Attributes:
        inner: the course of velocities, two slots a step.
        flow: from torques to these velocities.
        low, high, weights: (m,) of the torques.
        end: (n,) xi at the end, as the flow must say it for the true system to have what is asked for.
    """

    inner: Course
    flow: TorqueFlow
    low: Array
    high: Array
    weights: Array
    end: Array

    @property
    def keep_out(self) -> KeepOut:
        """The obstacles."""
        return self.inner.keep_out

    @property
    def start(self) -> Array:
        """(d, d) X(0)."""
        return self.inner.start

    @property
    def nodes(self) -> Rows:
        """As of the course of velocities."""
        return self.inner.nodes

    @property
    def goal(self) -> Goal:
        """Of X."""
        return self.inner.goal

    @property
    def torques(self) -> int:
        """Numbers of a lane that are torques."""
        return self.flow.slots * len(self.low)

    @property
    def longest(self) -> float:
        """As of the course of velocities."""
        return self.inner.longest

    @property
    def free(self) -> tuple[int, int]:
        """Numbers of a lane that are free motions of the goal, before and after."""
        p, n = self.inner.programme, len(self.end)
        before = self.inner.first * n
        return before, p.low.size - before - 2 * len(self.inner.nodes) * n

    @cached_property
    def box(self) -> Box:
        """Limits and weights of a lane."""
        S, free = self.flow.slots, sum(self.free)
        mass = np.ones(S)
        if self.flow.linear:
            mass[[0, -1]] = 0.5
        parts = [
            (np.tile(self.low, S), -np.inf),
            (np.tile(self.high, S), np.inf),
            (np.tile(self.weights if not self.longest else 0 * self.weights, S), 0.0),
            (np.repeat(mass, len(self.low)), 1.0),
        ]
        rows = [np.concatenate([own, np.full(free, other)]) for own, other in parts]
        if self.longest:
            rows = [np.append(row, more) for row, more in zip(rows, (SHORTEST, self.longest, 1.0, 1.0), strict=True)]
        return Box(*rows)

    def split(self, u: Array) -> tuple[Array, Array, Array]:
        """Torques (L, S, m), free motions (L, f) and durations (L,) of lanes (L, C)."""
        own, last = self.torques, u.shape[1] - bool(self.longest)
        lasting = u[:, -1] if self.longest else np.ones(len(u))
        return u[:, :own].reshape(len(u), self.flow.slots, -1), u[:, own:last], lasting

    def _velocities(self, u: Array) -> tuple[Array, Array, Array, Array]:
        """Lanes of the course of velocities (L, V), their derivatives (L, V, C); xi at the end (L, n), its derivative (L, n, C)."""
        torques, free, lasting = self.split(u)
        at, moved, last, last_moved = self.flow.velocities(torques, lasting)
        lanes, C, own = len(u), u.shape[1], self.torques
        before, after = self.free
        velocities = at.reshape(lanes, -1)
        v = [free[:, :before], velocities, free[:, before:], *([u[:, -1:]] if self.longest else [])]
        S = np.zeros((lanes, sum(part.shape[1] for part in v), C))
        places = slice(before, before + velocities.shape[1])
        S[:, places, :own] = moved.reshape(lanes, velocities.shape[1], -1)[..., :-1]
        S[:, np.arange(before), own + np.arange(before)] = 1
        S[:, places.stop + np.arange(after), own + before + np.arange(after)] = 1
        D = np.zeros((lanes, last.shape[1], C))
        D[..., :own] = last_moved[..., :-1]
        if self.longest:
            S[:, places, -1] = moved.reshape(lanes, velocities.shape[1], -1)[..., -1]
            S[:, -1, -1] = 1
            D[..., -1] = last_moved[..., -1]
        return np.concatenate(v, axis=1), S, last, D

    def known(self, u: Array) -> Known:
        """What a step needs at lanes (L, C)."""
        v, S, last, D = self._velocities(u)
        return self._known(self.inner.known(v), S, last, D)

    def _known(self, at: Known, S: Array, last: Array, D: Array) -> Known:
        # a velocity counts by how far it leads in the duration
        T = self.flow.duration
        over = T * (last - self.end)
        size = np.sqrt(at.size**2 + np.sum(over**2, axis=1))
        rows = np.concatenate([at.J @ S, T * D], axis=1)
        found = (np.concatenate([at.r, over], axis=1), rows, at.gap, at.A @ S)
        return Known(np.where(np.isfinite(size), size, np.inf), *(np.nan_to_num(each) for each in found))

    def followed(self, u: Array, along: Array, axes: Array, weight: Array) -> tuple[Known, Array, Array]:
        """As of the course of velocities."""
        v, S, last, D = self._velocities(u)
        at, off, rows = self.inner.followed(v, along, axes, weight)
        return self._known(at, S, last, D), off, rows @ S

    def jumps(self, u: Array) -> Array:
        """(L,) whether a lane goes through an obstacle in one step."""
        return self.inner.jumps(self._velocities(u)[0])

    def look(self, _: Rows, u: Array) -> Lanes:
        """The goal's rows and those of the nodes that cut an obstacle."""
        return self.known(u).lanes(u)

    def ends(self, u: Array) -> tuple[Array, Array]:
        """(d, d) and (n,) where one lane (C,) ends by this flow's own account, without the free motions."""
        v, _, last, _ = self._velocities(u[None])
        return self.inner.states(v)[0][0, -1], last[0]

    def asked(self, right: Array, end: Array) -> TorqueCourse:
        """The course towards other ends."""
        return replace(self, inner=replace(self.inner, goal=replace(self.goal, right=right)), end=end)


def torque_course(
    task: Manoeuvre, flow: TorqueFlow, end: Array, keep_out: KeepOut, margins: Array, variant: int, longest: float
) -> TorqueCourse:
    """The course of a task in velocities (`task` has all n of them as controls), driven by torques of `flow`; limits of torques are set by
    the caller."""
    M = flow.pieces * flow.steps
    h = task.duration / M
    group = task.system.group
    n, d = group.dim, group.degree
    table = (np.zeros((1, d, d)), h * np.real(group.basis)[None], np.zeros(2 * M, int))
    # of a step's two exponentials the first has more of the earlier velocity
    programme = programme_of(
        task, table, np.repeat(2 * np.arange(M), 2), np.tile([(EARLY, LATE), (LATE, EARLY)], (M, 1)), np.ones(2 * M)
    )
    goal = task.goal(np.array([variant]))
    first = task.free_slots[0]
    inner = Course(programme, goal, keep_out, task.system.start, first, np.arange(1, 2 * M, 2), margins, longest)
    one = np.ones(flow.push.shape[1])
    return TorqueCourse(inner, flow, -np.inf * one, np.inf * one, np.ones(n)[: len(one)], end)
