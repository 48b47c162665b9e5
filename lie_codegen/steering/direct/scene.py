"""A task among obstacles: first controls along the ways around them, results on fine pieces that the true system confirms, their classes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.constraints import Obstacle
from lie_codegen.steering.direct.assemble import Manoeuvre, constant_pieces, linear_pieces
from lie_codegen.steering.direct.clear_search import Clear, Course, arrive, cheaper
from lie_codegen.steering.direct.compiled import machine
from lie_codegen.steering.direct.inputs import Drive, Inputs
from lie_codegen.steering.direct.magnus_flow import states_reached
from lie_codegen.steering.direct.numpy_search import Lanes, Rows, reach
from lie_codegen.steering.direct.polish import Flown, corrected
from lie_codegen.steering.direct.polish import flown as as_flown
from lie_codegen.steering.direct.programme import Settings
from lie_codegen.steering.direct.report import cost_of, plan_of
from lie_codegen.steering.direct.starts import starts as first_controls
from lie_codegen.steering.direct.starts import with_free_slots
from lie_codegen.steering.obstacles.homotopy import Discs, planar_discs, resampled, shortest_classes
from lie_codegen.steering.obstacles.keep_out import KeepOut
from lie_codegen.steering.obstacles.lowest import lowest
from lie_codegen.steering.obstacles.path_guess import word_text
from lie_codegen.steering.obstacles.roadmap import Places, Space, drawn_into, seen, ways
from lie_codegen.steering.obstacles.tunnels import tunnels
from lie_codegen.steering.plan import Plan, Status

#: Pieces of linear controls of the search, and of the plan.
_COARSE, _FINE = 24, 64
#: Lanes that follow each way, random lanes that go by no way at least, those of them that descend, and results that are refined.
_EACH, STRAIGHT, _OTHERS, _REFINED = 2, 2, 2, 4
#: Costs of results on the coarse pieces that are taken for the same.
_ALIKE = 1e-3
#: Weight of a node's distance from the way beside the goal, and steps that follow it.
_FOLLOW, _FOLLOWING = 0.2, 25
#: Residual at which controls are there and clear.
ENOUGH = 1e-9
_WIDER, _AGAIN = 1.4, 8
#: Steps of a descent after margins were widened.
_LATER = 15
#: Largest motion between two looks, in units of the smallest obstacle; parts of a piece, at most.
_LOOK, _MOST_PARTS = 0.05, 64
#: Steps of a piece, at most, and how long they are with those, in units of the thinnest obstacle's size: obstacles are looked at after each.
_STEPS, _APART = 8, 1.0
#: Depth in an obstacle that is rounding.
CLEAR = 1e-7


@dataclass(frozen=True, eq=False)
class Result:
    """Controls on the fine pieces, flown: what they cost, how near they come to the obstacles, and their way."""

    flown: Flown
    variant: int
    cost: float
    clearance: float
    off: float
    way: Places
    name: str


@dataclass(frozen=True, eq=False)
class Scene:
    """A task among obstacles."""

    task: Manoeuvre
    keep_out: KeepOut
    obstacles: tuple[Obstacle, ...]
    settings: Settings
    objective: str = "energy"
    longest: float = 0.0

    @property
    def linear(self) -> bool:
        """Whether controls are linear between nodes, else constant on pieces: those of least energy have no jumps."""
        return self.objective in ("energy", "none")

    @cached_property
    def travel(self) -> float:
        """How far what obstacles look at is from where it must be: the length of a short way."""
        goals = [self.goal_state(variant) for variant in range(len(self.task.end.values))]
        known = [each for each in goals if each is not None]
        axes = self.keep_out.axes
        away = [np.linalg.norm((each - np.real(self.task.system.start)) @ axes.T, axis=0) for each in known]
        return float(np.max(away, initial=0.0))

    @cached_property
    def discs(self) -> Discs | None:
        """The obstacles as discs, where all of them are."""
        return planar_discs(self.obstacles) if self.task.system.group.degree == 3 else None

    def goal_state(self, variant: int) -> Array | None:
        """A state at the goal: one of many where it leaves motions free; None where only a part of it is known."""
        end = self.task.end
        if end.elements is not None:
            return np.asarray(np.real(end.elements[variant]))
        X, column = np.eye(self.task.system.group.degree), end.right[:, 0]
        value = end.values[variant][:, 0] / np.max(np.abs(end.left))
        if column[-1] == 1 and len(value) == len(X) - 1:
            X[:-1, -1] = value
            return X
        return None

    def first(
        self, classes: int, seed: int, variant: int, straight: int, guesses: Array | None
    ) -> tuple[Array, list[str]]:
        """First controls on the coarse pieces (L, C), and where each comes from."""
        lanes = [self.begin(_COARSE, straight, seed, 0)]
        names = [f"start {number}" for number in range(1, straight + 1)]
        if guesses is not None:
            lanes.append(self.given(guesses, _COARSE, seed))
            names += ["the guess given"] * len(guesses)
        course = self.course(_COARSE, variant)
        for number, way in enumerate(self.ways(classes, seed, variant), start=1):
            lanes.append(self.following(course, way, self.begin(_COARSE, _EACH, seed, number)))
            names += [f"way {number}"] * _EACH
        return np.concatenate(lanes), names

    def begin(self, pieces: int, count: int, seed: int, number: int) -> Array:
        """First lanes (count, C) on so many pieces."""
        u = first_controls(self.task, pieces + self.linear, count, seed, number)
        return self.lasting(with_free_slots(self.task, u, seed))

    def given(self, guesses: Array, pieces: int, seed: int) -> Array:
        """Lanes of controls (k, S, m) that were given."""
        own = np.stack([stretched(each, pieces + self.linear) for each in guesses])
        return self.lasting(with_free_slots(self.task, own, seed))

    def lasting(self, u: Array) -> Array:
        """Controls (L, S, m) as lanes (L, C), with a duration each where the least is sought."""
        flat = u.reshape(len(u), -1)
        return np.concatenate([flat, np.ones((len(u), 1))], axis=1) if self.longest else flat

    def ways(self, classes: int, seed: int, variant: int) -> list[Places]:
        """Ways around the obstacles, the shortest first."""
        goal = self.goal_state(variant)
        if goal is None or classes < 1:
            return []
        start = np.real(self.task.system.start)
        if self.discs is not None:
            found = shortest_classes(self.discs, start[:2, 2], goal[:2, 2], classes)
            return [Places(path, np.tile(np.eye(3), (len(path), 1, 1))) for _, path in found]
        return ways(Space.between(self.keep_out, start, goal), classes, seed)

    def course(self, pieces: int, variant: int, margins: Array | None = None) -> Clear:
        """The programme of that many pieces among the obstacles."""
        task = self.task
        speed = 4.0 / task.duration  # steps follow the integration that corrects; the search needs no more
        steps = self.steps(pieces)
        programme = linear_pieces(task, pieces, speed, steps) if self.linear else constant_pieces(task, pieces, steps)
        first, last = task.free_slots
        own = len(programme.slot) - first - last
        # two exponentials make a step, and one where nothing changes on it
        nodes = np.arange(1, own, 2) if self.linear or not task.system.steady else np.arange(own)
        given = self.kept(len(nodes), margins)
        goal = task.goal(np.array([variant]))
        system = task.system
        return Course(programme, goal, self.keep_out, system.start, first, nodes, given, self.longest, system.right)

    def steps(self, pieces: int) -> int:
        """Steps of a piece, so that obstacles are looked at often enough."""
        thinnest = float(np.min(self.keep_out.sizes))
        return int(np.clip(np.ceil(_APART * self.travel / (pieces * thinnest)), 1, _STEPS))

    def kept(self, nodes: int, margins: Array | None) -> Array:
        """(o,) gaps that are kept: an obstacle thinner than a step is long would be jumped over, and counts as thick as that."""
        thin = np.maximum(0.0, _APART * self.travel / nodes - self.keep_out.sizes) * self.keep_out.placed
        return np.asarray(thin if margins is None else np.maximum(thin, margins))

    def following(self, course: Clear, way: Places, u: Array) -> Array:
        """Controls (L, C) that end at the goal, as near to the way as they can."""
        space = Space.between(self.keep_out, np.real(course.start), np.real(course.start))
        states = space.states(way)
        at = np.linspace(0, len(states) - 1, len(course.nodes) + 1)[1:].round().astype(int)
        axes = self.keep_out.axes
        along = np.einsum("kij,aj->kai", states[at], axes)
        size = np.max(np.abs(along - np.einsum("ij,aj->ai", np.real(course.start), axes)), axis=(0, 2))
        weight = _FOLLOW / np.maximum(size, 1e-9) / np.sqrt(len(at))

        def look(_: Rows, u: Array) -> Lanes:
            at, off, rows = course.followed(u, along, axes, weight)
            total = np.sqrt(np.sum(at.r**2, axis=1) + np.sum(off**2, axis=1))
            total = np.where(np.isfinite(total), total, np.inf)
            r, J = np.concatenate([at.r, off], axis=1), np.concatenate([at.J, rows], axis=1)
            return Lanes(u, total, np.nan_to_num(r), np.nan_to_num(J))

        return reach(look, course.box, u, replace(self.settings, reach_iterations=_FOLLOWING)).u

    def solved(self, lanes: Array, names: list[str], variant: int) -> tuple[list[Result], int]:
        """Results of lanes that arrive, the cheapest of each origin refined; how many arrived."""
        coarse = self.course(_COARSE, variant)
        u, off = arrive(coarse, lanes, self.settings)
        there = np.flatnonzero((off <= 100 * ENOUGH) & ~coarse.jumps(u))
        if not len(there):
            lane = int(np.argmin(off))
            return [self.refined(u[lane], variant, names[lane])], 0
        cost = coarse.box.objective(self.settings.fuel, u)
        order = there[np.argsort(cost[there], kind="stable")]
        # the cheapest of each way, and the cheapest of those that went by none
        origins: dict[str, list[int]] = {}
        for lane in order:
            origins.setdefault(names[lane] if names[lane].startswith("way") else "straight", []).append(int(lane))
        chosen = [lane for name, lanes_ in origins.items() for lane in lanes_[: _OTHERS if name == "straight" else 1]]
        quick = replace(self.settings, descend_iterations=min(20, self.settings.descend_iterations), relative=1e-3)
        lower: list[tuple[float, Array, str]] = []
        for lane in chosen:
            v, least, _ = cheaper(coarse, u[lane], quick)
            lower.append((least, v, names[lane]))
        lower.sort(key=lambda each: each[0])
        picked: list[tuple[float, Array, str]] = []
        for each in lower:
            alike = [one for one in picked if abs(one[0] - each[0]) <= _ALIKE * each[0]]
            if not alike and len(picked) < _REFINED:
                picked.append(each)
        return [self.refined(v, variant, name) for _, v, name in picked], len(there)

    def refined(self, u: Array, variant: int, name: str) -> Result:
        """On the fine pieces, with margins where the true system cuts an obstacle between the nodes."""
        v = self.finer(u, _COARSE, _FINE)
        margins = np.zeros(len(self.obstacles))
        best: Result | None = None
        for number in range(_AGAIN):
            course = self.course(_FINE, variant, margins)
            v, _ = (each[0] for each in arrive(course, v[None], self.settings))
            limit = (
                self.settings
                if number == 0
                else replace(self.settings, descend_iterations=min(_LATER, self.settings.descend_iterations))
            )
            v, _, _ = cheaper(course, v, limit)
            v, task, flown = self.confirmed(course, v, variant)
            X = self.states(flown)
            gaps = np.array([lowest(partial(self._gap, one), X) for one in range(len(self.obstacles))])
            through = tunnels(self.obstacles, X)
            clearance = -1.0 if through else float(np.min(gaps))
            way = seen(self.keep_out, X[np.linspace(0, len(X) - 1, 129).round().astype(int)])
            now = Result(flown, variant, cost_of(task, flown.inputs, self.objective), clearance, flown.miss, way, name)
            if best is None or min(now.clearance, 0.0) > min(best.clearance, 0.0):
                best = now
            if clearance >= -CLEAR or through:
                break
            # nodes slide along an edge as long as they gain by it: what is left is widened by more each time
            margins = margins + np.where(gaps < 0, -(_WIDER ** (1 + number)) * gaps + CLEAR, 0.0)
        if best is None:
            raise ValueError("no round was made")
        return best

    def finer(self, u: Array, pieces: int, fine: int) -> Array:
        """A lane (C,) of `pieces` pieces on `fine` ones."""
        task = self.task
        coarse = (u[:-1] if self.longest else u).reshape(-1, task.controls)
        before, after = task.free_slots
        own = task.own(coarse)
        own = stretched(own, fine + 1) if self.linear else own[np.arange(fine) * len(own) // fine]
        lane = np.concatenate([coarse[:before], own, coarse[len(coarse) - after :]]).ravel()
        return np.append(lane, u[-1]) if self.longest else lane

    def confirmed(self, course: Clear, v: Array, variant: int) -> tuple[Array, Manoeuvre, Flown]:
        """The controls (C,) so that the true system is at the goal, the task with their duration, and how they were flown."""
        if self.longest:
            # arcs of constant velocity: the programme is the system
            task = replace(self.task, duration=float(v[-1]) * self.task.duration)
            return v, task, as_flown(task, v[:-1].reshape(-1, task.controls), variant, self.linear)
        task = self.task
        if not isinstance(course, Course):
            raise TypeError("a course of a chain is needed")
        solver = machine(task.system.group, task.controls)
        shape = v.reshape(-1, task.controls)
        shape, flown = corrected(task, solver, course.programme, shape, variant, self.linear, self.settings)
        return shape.ravel(), task, flown

    def states(self, flown: Flown) -> Array:
        """States of the true system, so many that it moves by little between two, or cannot meet an obstacle there."""
        step = _LOOK * float(np.min(self.keep_out.sizes))
        parts = 4
        while True:
            X = self.flight(flown, parts)
            moved = np.max(np.abs(np.diff(X @ self.keep_out.axes.T, axis=0)), initial=0.0)
            if moved <= step or parts >= _MOST_PARTS or self.keep_out.cleared(X):
                return X
            parts *= 2

    def flight(self, flown: Flown, parts: int) -> Array:
        """States of the true system, that many a piece."""
        return np.real(states_reached(Drive(self.task.system, flown.inputs), parts)[1])

    def plan(
        self, target: Any, best: Result, tolerance: float, details: dict[str, Any], took: dict[str, float], status: Status | None
    ) -> Plan:  # fmt: skip
        """The plan of a result."""
        task, objective = self.task, self.objective
        return plan_of(task, target, best.flown, best.variant, tolerance, objective, details, took, status)

    def options(self) -> dict[str, Any] | None:
        """The task as `lc.steer` has it for the transcription; None where that has no such task."""
        task = self.task
        system = task.system
        known = set(system.labels) <= set(system.group.labels) and system.steady
        if system.right or not known or self.objective not in ("energy", "time"):
            return None
        pairs = zip(task.low, task.high, strict=True)
        return {
            "obstacles": list(self.obstacles),
            "objective": self.objective,
            "bounds": {label: (float(a), float(b)) for label, (a, b) in zip(system.labels, pairs, strict=True)},
            "weights": task.weights,
            **({"drift": system.drift.constant} if np.any(system.drift.constant) else {}),
            **({"start": system.start} if np.any(system.start != np.eye(system.group.degree)) else {}),
            **({"longest": self.longest} if self.longest else {}),
        }

    def objective_of(self, plan: Plan) -> float:
        """What is made small: the duration, or int sum w u^2 dt, exactly for controls that are linear between breakpoints."""
        if self.longest:
            return plan.duration
        inputs = plan.details.get("inputs")
        if isinstance(inputs, Inputs):
            return inputs.integral_of_squares(self.task.weights)
        knots = np.unique(np.concatenate([[0.0], plan.u.breakpoints, [plan.duration]]))
        h = np.diff(knots)
        rows = [plan.group.labels.index(label) for label in self.task.system.labels]
        # Simpson's rule is exact for squares of linear functions; a breakpoint belongs to the later piece
        times = (knots[:-1], (knots[1:] + knots[:-1]) / 2, knots[1:] - 1e-9 * h)
        squares = [plan.u(t)[:, rows] ** 2 @ self.task.weights for t in times]
        return float(h @ (squares[0] + 4 * squares[1] + squares[2]) / 6)

    def clearances(self, flown: Flown) -> tuple[float, ...]:
        """Least of each obstacle's own clearance along the way."""
        X = self.states(flown)
        return tuple(lowest(each.clearance, X) for each in self.obstacles)

    def _gap(self, one: int, X: Array) -> Array:
        return np.asarray(self.keep_out.gaps(X)[..., one])

    def word(self, X: Array) -> str | None:
        """The class of a way between discs in the plane; None among other obstacles."""
        return None if self.discs is None else word_text(self.discs.word(resampled(X[:, :2, 2], 257)))

    def named(self, good: Sequence[Result]) -> tuple[dict[str, Any], ...]:
        """{"word", "cost", "clearance"} of the cheapest result of each class of ways, the cheapest first."""
        best: dict[str, dict[str, Any]] = {}
        kept: list[Places] = []
        space = Space.between(self.keep_out, np.real(self.task.system.start), np.real(self.task.system.start))
        for each in good:
            if self.discs is not None:
                word = word_text(self.discs.word(resampled(each.way.p, 257)))
            else:
                same = [number for number, way in enumerate(kept) if drawn_into(space, each.way, way)]
                if not same:
                    kept.append(each.way)
                word = f"way {same[0] + 1 if same else len(kept)}"
            best.setdefault(word, {"word": word, "cost": each.cost, "clearance": each.clearance})
        return tuple(best.values())


def stretched(values: Array, nodes: int) -> Array:
    """(k, m) values at equal times as (nodes, m)."""
    s, there = np.linspace(0, 1, nodes), np.linspace(0, 1, len(values))
    return np.column_stack([np.interp(s, there, column) for column in values.T])
