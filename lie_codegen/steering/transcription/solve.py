"""Solving a posed transcription: from a guess of the controls to a candidate that the true system confirms."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.groups.maps.packed_arrays import packed_elements
from lie_codegen.steering.constraints import Ball, Cone
from lie_codegen.steering.obstacles.lowest import lowest
from lie_codegen.steering.obstacles.tunnels import tunnels
from lie_codegen.steering.task import Task
from lie_codegen.steering.transcription.flow import SimulatedPath, simulated_path
from lie_codegen.steering.transcription.layout import (
    at_rest,
    free_motion,
    stages_of,
    tightened,
    unpack_elements,
    unpacked,
    variable_limits,
)
from lie_codegen.steering.transcription.numbers import Numbers
from lie_codegen.steering.transcription.problem import Program
from lie_codegen.steering.transcription.structure import Structure

#: Violations above it are not taken for rounding.
FEASIBLE = 1e-6
_ROUNDS = 6
_CLEAR = 1e-8
_EXACT = 2e-9
_PUSH = 1.1
_ASTRAY = 1e-2
#: Solves beyond the others in which the target moves along the goal's free directions, and the motion at which it stands still.
_MOVES, _SETTLED = 12, 0.05


@dataclass(frozen=True)
class Solve:
    """One call of the solver.

    Attributes:
        start: the name of the first guess.
        solver: "fatrop" or "ipopt".
        iterations, message: the solver's.
        objective, violation: of the result, recomputed.
        seconds: wall time.
        residuals: {name: one number an iteration}, where the solver keeps them (ipopt: inf_pr, inf_du, obj, mu).
    """

    start: str
    solver: str
    iterations: int
    message: str
    objective: float
    violation: float
    seconds: float = field(compare=False)
    residuals: dict[str, tuple[float, ...]]


@dataclass(frozen=True)
class Candidate:
    """What a first guess led to.

    Attributes:
        objective, values, duration: the objective, (N + 1, m) controls and the duration, in the task's units.
        violation: of the constraints by the program's answer, infinite if the end is missed.
        target: (d, d) the element of the goal that it was to end at.
        miss: of the target by the true system, or how deep it cuts an obstacle.
        motion: of the true system; None where the program's conditions are not kept.
        solution: all variables.
        solves: the calls of the solver, the last one gave this.
    """

    objective: float
    values: Array
    duration: float
    violation: float
    target: Array
    miss: float
    motion: SimulatedPath | None
    solution: Array
    solves: tuple[Solve, ...]

    @property
    def astray(self) -> bool:
        """Whether it met the end conditions at another element than the target, as half a turn away."""
        return self.violation <= FEASIBLE and self.miss > _ASTRAY

    @property
    def admissible(self) -> bool:
        """Whether it keeps all conditions."""
        return self.violation <= FEASIBLE and self.miss <= FEASIBLE


@dataclass(frozen=True)
class ProgramEnd:
    """Where the program is told to end, so that the true system ends where it must: X, and xi to second order."""

    X: Array
    xi: Array


@dataclass(frozen=True)
class Workbench:
    """What stays the same from solve to solve of one problem."""

    task: Task
    structure: Structure
    numbers: Numbers
    built: Program
    say: Callable[[str], None]


def refined(bench: Workbench, name: str, start: Array, first_end: ProgramEnd) -> Candidate:
    """Solves, and again with the aim corrected by the true system's miss, obstacles enlarged where the path cuts them, and the
    target moved along the directions that the goal leaves free."""
    task, numbers = bench.task, bench.numbers
    second = numbers.dynamics
    aim, margins = first_end, np.zeros(len(numbers.obstacles))
    solves: list[Solve] = []
    best: Candidate | None = None
    moving = False
    for _ in range(_ROUNDS + (_MOVES if task.freedom else 0)):
        solution, solve = _solve(bench, name, margins, aim, start)
        solves.append(solve)
        values, duration = unpacked(bench.structure, solution)
        h = free_motion(bench.structure, solution)
        target = task.moved(h)
        if not solve.violation <= FEASIBLE:
            failed = Candidate(
                solve.objective, values, duration, solve.violation, target, np.inf, None, solution, tuple(solves)
            )
            return failed if best is None else replace(best, solves=tuple(solves))
        motion = simulated_path(task.group, task.controls, numbers, values, duration)
        if tunnels(numbers.obstacles, motion.X):
            # through a seam between discs, in one fast step: to enlarge the discs would find the next seam
            tunnel = Candidate(
                solve.objective, values, duration, solve.violation, target, np.inf, motion, solution, tuple(solves)
            )
            return tunnel if best is None else replace(best, solves=tuple(solves))
        cut = np.array([max(0.0, -lowest(each.clearance, motion.X)) for each in numbers.obstacles])
        relative = np.linalg.solve(motion.X[-1], target)
        slip = np.zeros(task.group.dim) if second is None else second.ends[1] - motion.xi[-1]
        off = float(max(np.max(np.abs(relative - np.eye(task.group.degree))), np.max(np.abs(slip))))
        deepest = float(np.max(cut, initial=0.0))
        miss = max(off, deepest)
        candidate = Candidate(
            solve.objective, values, duration, solve.violation, target, miss, motion, solution, tuple(solves)
        )
        settled = float(np.max(np.abs(h), initial=0.0)) <= _SETTLED
        if best is None or candidate.miss < best.miss or (moving and candidate.miss <= FEASIBLE):
            best = candidate
        moving = not settled
        if (settled and deepest <= _CLEAR and off <= _EXACT) or off > _ASTRAY:
            break
        aim = ProgramEnd(aim.X @ np.linalg.solve(task.target, target) @ relative, aim.xi + slip)
        task = replace(task, target=target)
        margins = margins + _PUSH * cut
        start = at_rest(bench.structure, solution)
    if best is None:
        raise ValueError("no round was made")
    return replace(best, solves=tuple(solves))


def predicted_end(bench: Workbench, start: Array) -> ProgramEnd:
    """Where the program should end for the true system to hit the target, judged by a guess made of true states.

    At true states the program's gaps are its errors of each step, which the rest of the way carries to the end.
    """
    task, structure = bench.task, bench.structure
    second = bench.numbers.dynamics
    if second is not None:
        return ProgramEnd(task.target, second.ends[1])
    p = _parameters(bench, np.zeros(len(bench.numbers.obstacles)), task.target)
    g = np.asarray(bench.built.solver.get_function("nlp_g")(start, p)).ravel()
    rows = bench.built.gap_rows[:, None] + np.arange(structure.size)
    states = unpack_elements(structure, stages_of(structure, start)[0][1:, : structure.size])
    errors = -unpack_elements(structure, g[rows], of_difference=True)
    carried = np.linalg.solve(states, np.broadcast_to(states[-1], states.shape))
    end = states[-1] + np.sum(errors @ carried, axis=0)
    if not np.all(np.isfinite(end)):
        return ProgramEnd(task.target, np.zeros(task.group.dim))
    return ProgramEnd(task.target @ np.linalg.solve(states[-1], end), np.zeros(task.group.dim))


def _solve(bench: Workbench, name: str, margins: Array, aim: ProgramEnd, start: Array) -> tuple[Array, Solve]:
    structure, built = bench.structure, bench.built
    low, high = variable_limits(structure, bench.numbers, aim.xi)
    asked = tightened(low, high) if built.name == "fatrop" else (low, high)
    began = time.perf_counter()
    p = _parameters(bench, margins, aim.X)
    if built.listener is not None:
        built.listener.listen(lambda line: bench.say(f"{built.name} from {name}: {line}"))
    result = built.solver(x0=start, p=p, lbx=asked[0], ubx=asked[1], lbg=built.lower, ubg=built.upper)
    seconds = time.perf_counter() - began
    solution, g = np.asarray(result["x"]).ravel(), np.asarray(result["g"]).ravel()
    violation = float(
        max(np.max(np.maximum(built.lower - g, g - built.upper)), np.max(np.maximum(low - solution, solution - high)))
    )
    if not np.all(np.isfinite(solution)):
        violation = np.inf
    stats = built.solver.stats()
    kept = stats.get("iterations") or {}
    solve = Solve(
        start=name,
        solver=built.name,
        iterations=int(stats.get("iter_count", -1)),
        message=str(stats.get("unified_return_status", "")),
        objective=float(result["f"]),
        violation=violation,
        seconds=seconds,
        residuals={key: tuple(map(float, kept[key])) for key in ("inf_pr", "inf_du", "obj", "mu") if key in kept},
    )
    bench.say(
        f"{solve.solver} from {name}: {solve.iterations} iterations, {1e3 * seconds:.3g} ms, {solve.message}, "
        f"objective {solve.objective:.9g}, violation {violation:.1e}"
    )
    return solution, solve


def _parameters(bench: Workbench, margins: Array, aim: Array) -> Array:
    numbers, group = bench.numbers, bench.task.group
    parts: list[Any] = [packed_elements(group, aim), numbers.drift, numbers.weights]
    for obstacle, margin in zip(numbers.obstacles, margins, strict=True):
        if isinstance(obstacle, Cone | Ball):
            values = list(obstacle.parameters())
            values[-1] = values[-1] - margin if isinstance(obstacle, Cone) else np.sqrt(values[-1] ** 2 + margin)
        else:
            one = obstacle.solid()
            values = [*one.centers[0], *one.axes[0].T.ravel(), *one.halves[0], *one.tubes, one.rounding[0] + margin]
        parts.append(values)
    parts += [packed_elements(group, element) for element in numbers.via]
    parts.append(np.minimum(np.minimum(-numbers.rates[0], numbers.rates[1]), 1e6))
    if numbers.dynamics is not None:
        parts += [numbers.dynamics.inertia.ravel(), np.linalg.inv(numbers.dynamics.inertia).ravel()]
    if bench.task.free is not None:
        parts.append(bench.task.free.ravel())
    return np.concatenate([np.asarray(part, dtype=float) for part in parts])
