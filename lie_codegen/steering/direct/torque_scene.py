"""A scene in which a body is moved by torques: its lanes, the true flights that confirm them, and the plan."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.mechanics.driven import Driven, simulate_driven
from lie_codegen.steering.direct.assemble import Manoeuvre
from lie_codegen.steering.direct.clear_search import Clear, arrive
from lie_codegen.steering.direct.inputs import Drive, Inputs
from lie_codegen.steering.direct.polish import Flown
from lie_codegen.steering.direct.scene import Result, Scene, stretched
from lie_codegen.steering.direct.starts import starts as first_controls
from lie_codegen.steering.direct.torque_arcs import euler_constants
from lie_codegen.steering.direct.torque_course import TorqueCourse, torque_course
from lie_codegen.steering.direct.torque_flow import TorqueFlow
from lie_codegen.steering.plan import Controls, Plan, Status

#: Times that the ends are moved by what the true motion misses.
_ROUNDS = 6
_ROUNDING = 1e-11
#: First torques, in units of what turns the body through a radian and stops it.
_SIZE = 4.0


@dataclass(frozen=True, eq=False)
class TorqueScene(Scene):
    """A task among obstacles whose controls are torques.

    Attributes:
        motion: the task of the velocities, all n of them controls.
        inertia: (n, n) J.
        ends: (2, n) xi at the start and at the end.
    """

    motion: Manoeuvre = field(kw_only=True)
    inertia: Array = field(kw_only=True)
    ends: Array = field(kw_only=True)

    def begin(self, pieces: int, count: int, seed: int, number: int) -> Array:
        """First lanes (count, C), the very first of each seed without torques."""
        task = self.task
        size = _SIZE * float(np.linalg.norm(self.inertia, 2)) / task.duration**2
        small = replace(task, low=np.maximum(task.low, -size), high=np.minimum(task.high, size))
        u = first_controls(small, pieces + self.linear, count, seed, number).reshape(count, -1)
        before, after = self.motion.free_slots
        rng = np.random.default_rng([seed, before, after])
        free = rng.uniform(-np.pi, np.pi, (count, (before + after) * self.motion.controls))
        free[0] = 0
        return np.concatenate([u, free, *([np.ones((count, 1))] if self.longest else [])], axis=1)

    def given(self, guesses: Array, pieces: int, seed: int) -> Array:
        """Lanes of torques (k, S, m) that were given."""
        first = self.begin(pieces, len(guesses), seed, 0)
        nodes = pieces + self.linear
        first[:, : nodes * self.task.controls] = [stretched(each, nodes).ravel() for each in guesses]
        return first

    def course(self, pieces: int, variant: int, margins: Array | None = None) -> TorqueCourse:
        """The torques of that many pieces among the obstacles."""
        task, steps = self.task, self.steps(pieces)
        directions = np.array([each.constant for each in task.system.directions])
        flow = TorqueFlow(
            euler_constants(task.system.group, self.inertia),
            np.linalg.solve(self.inertia, directions.T),
            self.ends[0],
            task.duration,
            pieces,
            steps,
            self.linear,
        )
        given = self.kept(pieces * steps, margins)
        course = torque_course(self.motion, flow, self.ends[1], self.keep_out, given, variant, self.longest)
        return replace(course, low=task.low, high=task.high, weights=task.weights)

    def finer(self, u: Array, pieces: int, fine: int) -> Array:
        """A lane (C,) of `pieces` pieces on `fine` ones."""
        m = self.task.controls
        own = (pieces + self.linear) * m
        torques = u[:own].reshape(-1, m)
        torques = stretched(torques, fine + 1) if self.linear else torques[np.arange(fine) * len(torques) // fine]
        return np.concatenate([torques.ravel(), u[own:]])

    def confirmed(self, course: Clear, v: Array, variant: int) -> tuple[Array, Manoeuvre, Flown]:
        """The lane (C,) so that the true motion ends as asked, the task with its duration, and how it was flown."""
        if not isinstance(course, TorqueCourse):
            raise TypeError("a course of torques is needed")
        end = self.motion.end
        goal_right, asked = course.goal.right, course
        best: tuple[Array, Manoeuvre, Flown] | None = None
        for _ in range(_ROUNDS):
            task, inputs, free = self._read(asked, v)
            run = self._run(inputs)
            X = np.real(task.system.start) @ run.X[-1]
            slip = run.xi[-1] - self.ends[1]
            miss = end.left @ free[0] @ X @ free[1] @ end.right - end.values[variant]
            off = float(np.hypot(np.linalg.norm(miss), task.duration * np.linalg.norm(slip)))
            if best is not None and not off < best[2].miss:
                break
            best = v, task, Flown(inputs, X, off, free)
            if off <= _ROUNDING * max(1.0, float(np.max(np.abs(end.values)))):
                break
            # the search ends at X D with xi + e where the true motion ends at X with xi: it is asked for the goal with D^-1 R, and xi + e
            said, said_xi = asked.ends(v)
            moved = [np.linalg.inv(free[1]) @ np.linalg.solve(said, X) @ free[1] @ goal_right, said_xi - slip]
            asked = course.asked(*moved)
            v = arrive(asked, v[None], replace(self.settings, damping=1e-9))[0][0]
        if best is None:
            raise ValueError("no round was made")
        return best

    def _read(self, course: TorqueCourse, v: Array) -> tuple[Manoeuvre, Inputs, tuple[Array, Array]]:
        """Of a lane (C,): the task with its duration, the torques as inputs, the free motions of the goal."""
        torques, free, lasting = course.split(v[None])
        task = replace(self.task, duration=float(lasting[0]) * self.task.duration)
        pieces = course.flow.pieces
        knots = np.linspace(0.0, task.duration, pieces + 1)
        made = Inputs.linear if self.linear else Inputs.constant
        n, before = self.motion.controls, course.free[0]
        slots = [free[0, :before].reshape(-1, n), np.zeros((1, n)), free[0, before:].reshape(-1, n)]
        return task, made(knots, torques[0]), self.motion.free_motions(np.concatenate(slots))

    def _run(self, inputs: Inputs, parts: int = 1) -> Driven:
        """The true motion from the identity, at that many times a piece."""
        knots = inputs.knots
        inner = knots[:-1, None] + np.diff(knots)[:, None] * np.arange(parts) / parts
        u = Controls(Drive(self.task.system, inputs), knots[1:-1])
        times = np.append(inner.ravel(), knots[-1])
        return simulate_driven(self.task.system.group, u, self.inertia, t=times, xi0=self.ends[0])

    def flight(self, flown: Flown, parts: int) -> Array:
        """States of the true motion, that many a piece."""
        return np.real(self.task.system.start) @ self._run(flown.inputs, parts).X

    def options(self) -> dict[str, Any] | None:
        """As of velocities, with the body."""
        known = super().options()
        if known is None:
            return None
        ends = {"start_velocity": self.ends[0], "end_velocity": self.ends[1]}
        return {**known, "dynamics": "second_order", "inertia": self.inertia, **ends}

    def plan(
        self, target: Any, best: Result, tolerance: float, details: dict[str, Any], took: dict[str, float], status: Status | None
    ) -> Plan:  # fmt: skip
        """The plan of a result; its facts are those of a motion under torques."""
        plan = super().plan(target, best, tolerance, details, took, status)
        run = self._run(best.flown.inputs, 4)
        slip = float(np.linalg.norm(run.xi[-1] - self.ends[1]))
        told = {name: value for name, value in plan.details.items() if name != "system"}
        told |= {
            "dynamics": "second order: u is torque",
            "inertia": self.inertia,
            "start_velocity": self.ends[0],
            "fine_times": run.t,
            "fine_velocities": run.xi,
            "velocity_miss": slip,
            "velocity_peaks": tuple(float(x) for x in np.max(np.abs(run.xi), axis=0)),
            "violation": {**plan.violation, "velocity": slip},
        }
        solved = max(plan.error, slip * plan.duration) <= tolerance
        ended = plan.status if solved or status is not None else Status.NOT_CONVERGED
        return replace(plan, outcome=replace(plan.facts, details=told, status=ended))
