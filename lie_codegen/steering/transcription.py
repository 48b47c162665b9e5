"""method="transcription": whatever has bounds, obstacles, drift, via points or a free time; multiple shooting on the group.

The program is built once for its structure (`transcription_problem`) and solved for any numbers, from several first guesses:
the unconstrained optimum by shooting, the area rule, a straight path. Solvers' own flags are not believed: the true
system is integrated under the controls found, and the clearance of every obstacle is taken on a fine grid; where it
is violated between the nodes, the obstacle is enlarged by as much and the program solved again.
"""

from __future__ import annotations

import operator
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lie_codegen.errors import ShapeError, SteeringError, SteeringInputError
from lie_codegen.simulation.flow import simulate
from lie_codegen.simulation.metric import group_element
from lie_codegen.steering.constraints import Cone, Obstacle, check_obstacles, limits
from lie_codegen.steering.finish import finish
from lie_codegen.steering.guesses import guesses, rollout
from lie_codegen.steering.packing import pack_element
from lie_codegen.steering.plan import Controls, Plan, Status
from lie_codegen.steering.task import Task
from lie_codegen.steering.transcription_problem import Program, Structure, program

Array = NDArray[Any]

_ROUNDS = 5
_FALLBACK = 4
_FINE = 8
_FEASIBLE = 1e-7
_CLEAR = 1e-8
_EXACT = 1e-9


@dataclass(frozen=True)
class _Numbers:
    """The numbers of a problem, in units of the task's duration."""

    bounds: tuple[Array, Array]
    rates: tuple[Array, Array]
    obstacles: tuple[Obstacle, ...]
    via: tuple[Array, ...]
    drift: Array
    weights: Array
    rest: bool
    longest: float


@dataclass(frozen=True)
class _Candidate:
    objective: float
    values: Array
    duration: float
    violation: float
    iterations: int
    message: str
    solution: Array


def transcription(
    task: Task,
    *,
    bounds: Any = None,
    rate_bounds: Any = None,
    obstacles: Sequence[Obstacle] = (),
    via: Sequence[tuple[float, ArrayLike]] = (),
    drift: ArrayLike | None = None,
    rest: bool = False,
    objective: str = "energy",
    longest: float = 20.0,
    weights: ArrayLike | None = None,
    intervals: int = 64,
    starts: int = 3,
    solver: str = "ipopt",
    progress: Callable[[str], None] | None = None,
) -> Plan:
    """Minimum energy, or minimum time, under constraints; controls are continuous and linear on each interval.

    Args:
        task: the task; for minimum time its duration is the first guess, and the unit of `longest`.
        bounds: of the controls: a number (both signs), a (low, high) pair, or {label: either}; units of u.
        rate_bounds: of the controls' time derivatives, as bounds.
        obstacles: `Cone`s (attitude exclusion) and `Ball`s (position), for all of the way.
        via: (fraction of the duration, element or coordinates of the second kind) to pass through.
        drift: (n,) constant velocity added to the controls' own: X' = X hat(drift + u).
        rest: controls are zero at both ends.
        objective: "energy", int sum w_i u_i^2, or "time".
        longest: for "time": the longest duration allowed, in units of the task's.
        weights: (m,) positive w_i, ones if not given.
        intervals: N, pieces of the controls.
        starts: first guesses tried; the cheapest admissible result wins.
        solver: "ipopt" or "fatrop".
        progress: called with one line a solve.

    Raises:
        SteeringInputError, ShapeError: about an option.
        SteeringError: no admissible manoeuvre found; says which limit the unconstrained optimum breaks.
    """
    started = time.perf_counter()
    structure, numbers = _pose(
        task, bounds, rate_bounds, obstacles, via, drift, rest, objective, longest, weights, intervals, starts, solver
    )
    return _run(task, structure, numbers, starts, "transcription", (), progress or (lambda line: None), started)


def least_energy(
    task: Task,
    *,
    weights: ArrayLike | None = None,
    tried: tuple[str, ...] = (),
    progress: Callable[[str], None] | None = None,
) -> Plan:
    """Minimum energy without constraints, where shooting failed."""
    started = time.perf_counter()
    structure, numbers = _pose(task, None, None, (), (), None, False, "energy", 20.0, weights, 64, _FALLBACK, "ipopt")
    return _run(task, structure, numbers, _FALLBACK, "optimal", tried, progress or (lambda line: None), started)


def _pose(
    task: Task,
    bounds: Any,
    rate_bounds: Any,
    obstacles: Sequence[Obstacle],
    via: Sequence[tuple[float, ArrayLike]],
    drift: ArrayLike | None,
    rest: bool,
    objective: str,
    longest: float,
    weights: ArrayLike | None,
    intervals: int,
    starts: int,
    solver: str,
) -> tuple[Structure, _Numbers]:
    group, D, m = task.group, task.duration, len(task.controls)
    where = f"steer({group.name})"
    for name, value, least in (("intervals", intervals, 4), ("starts", starts, 1)):
        if operator.index(value) < least:
            raise SteeringInputError(f"{where}: {name} must be at least {least}, got {value}")
    if objective not in ("energy", "time"):
        raise SteeringInputError(f'{where}: objective is "energy" or "time", got {objective!r}')
    if solver not in ("ipopt", "fatrop"):
        raise SteeringInputError(f'{where}: solver is "ipopt" or "fatrop", got {solver!r}')
    low, high = limits(group, task.controls, bounds, f"{where}: bounds")
    slow, fast = limits(group, task.controls, rate_bounds, f"{where}: rate_bounds")
    if objective == "time" and not np.all(np.isfinite(low) & np.isfinite(high)):
        free = [group.labels[i] for i, a, b in zip(task.controls, low, high, strict=True) if not np.isfinite(b - a)]
        raise SteeringInputError(f"{where}: minimum time needs bounds on every control; {', '.join(free)} has none")
    if rest and (np.any(low > 0) or np.any(high < 0)):
        raise SteeringInputError(f"{where}: rest needs bounds that allow zero")
    nodes, elements = [], []
    for fraction, element in via:
        node = round(float(fraction) * intervals)
        if not 0 < node < intervals or node in nodes:
            raise SteeringInputError(
                f"{where}: via fractions must fall on different inner nodes of {intervals} intervals, got {fraction!r}"
            )
        nodes.append(node)
        elements.append(group_element(group, element, f"{where}: via point at {fraction}"))
    order = [int(i) for i in np.argsort(nodes)]
    w = np.ones(m) if weights is None else np.array(weights, dtype=float)
    shift = np.zeros(group.dim) if drift is None else np.array(drift, dtype=float)
    if w.shape != (m,) or not np.all(w > 0):
        raise SteeringInputError(f"{where}: weights must be {m} positive numbers, got {weights!r}")
    if shift.shape != (group.dim,) or not np.all(np.isfinite(shift)):
        raise ShapeError(f"{where}: drift must be {group.dim} finite numbers, got {drift!r}")
    checked = check_obstacles(group, obstacles)
    structure = Structure(
        group,
        task.controls,
        intervals,
        cones=sum(isinstance(each, Cone) for each in checked),
        balls=sum(not isinstance(each, Cone) for each in checked),
        via=tuple(nodes[i] for i in order),
        free_time=objective == "time",
        solver=solver,
    )
    numbers = _Numbers(
        bounds=(low * D, high * D),
        rates=(slow * D * D, fast * D * D),
        obstacles=tuple(sorted(checked, key=lambda each: not isinstance(each, Cone))),
        via=tuple(elements[i] for i in order),
        drift=shift * D,
        weights=w,
        rest=rest,
        longest=longest,
    )
    return structure, numbers


def _run(
    task: Task,
    structure: Structure,
    numbers: _Numbers,
    starts: int,
    method: str,
    tried: tuple[str, ...],
    say: Callable[[str], None],
    started: float,
) -> Plan:
    built_program = program(structure)
    built = time.perf_counter()
    candidates: list[tuple[_Candidate, str]] = []
    margins = np.zeros(len(numbers.obstacles))
    for name, v in guesses(task, structure, numbers.via, starts):
        candidate = _refined(task, structure, built_program, numbers, margins, _start(task, structure, numbers, v))
        candidates.append((candidate, name))
        say(
            f"from {name}: {candidate.message}, objective {candidate.objective:.9g}, violation {candidate.violation:.1e}"
        )
    good = [pair for pair in candidates if pair[0].violation <= _FEASIBLE]
    if not good:
        raise SteeringError(_complaint(task, structure, numbers, [pair[0] for pair in candidates]))
    best, name = min(good, key=lambda pair: pair[0].objective)
    duration = best.duration * task.duration
    done = replace(task, duration=duration)
    u = _piecewise_linear(done, best.values / task.duration)
    drift = numbers.drift / task.duration
    fine, states = _fine_states(done, u, drift, structure.intervals)
    details = {
        "winner": f"transcription from {name}",
        "tried": (*tried, *(f"transcription from {each}: {candidate.message}" for candidate, each in candidates)),
        "intervals": structure.intervals,
        "solver": structure.solver,
        "iterations": sum(candidate.iterations for candidate, _ in candidates),
        "objective": "time" if structure.free_time else "energy",
        "discretisation": "controls continuous and linear on each interval: the cost is an upper bound of the optimum's",
        "clearances": tuple(float(np.min(obstacle.clearance(states))) for obstacle in numbers.obstacles),
        "control_peaks": tuple(float(x) for x in np.max(np.abs(best.values), axis=0) / task.duration),
        "drift": drift,
        "optimality": "a local minimum of the discretised problem, the best of the starts tried",
        "fine_times": fine,
    }
    seconds = {"build": built - started, "solve": time.perf_counter() - built}
    return finish(done, method, u, details, seconds, solved=Status.LOCAL, otherwise=Status.NOT_CONVERGED, drift=drift)


def _refined(
    task: Task, structure: Structure, built: Program, numbers: _Numbers, margins: Array, start: Array
) -> _Candidate:
    """Solves, and again with the aim corrected by the true system's miss, and obstacles enlarged where the path cuts them."""
    aim = task.target
    candidate = _solve(task, structure, built, numbers, margins, aim, start)
    for _ in range(_ROUNDS):
        if candidate.violation > _FEASIBLE:
            return candidate
        done = replace(task, duration=candidate.duration * task.duration)
        u = _piecewise_linear(done, candidate.values / task.duration)
        _, states = _fine_states(done, u, numbers.drift / task.duration, structure.intervals)
        cut = np.array([max(0.0, -float(np.min(obstacle.clearance(states)))) for obstacle in numbers.obstacles])
        miss = np.linalg.solve(states[-1], task.target)
        if np.max(cut, initial=0.0) <= _CLEAR and np.max(np.abs(miss - np.eye(task.group.degree))) <= _EXACT:
            return candidate
        aim = aim @ miss
        margins = margins + 1.1 * cut
        candidate = _solve(task, structure, built, numbers, margins, aim, candidate.solution)
    return candidate


def _start(task: Task, structure: Structure, numbers: _Numbers, v: Array) -> Array:
    """The variables of a guess of the controls v, (N + 1, m), in unit time."""
    N = structure.intervals
    scale = 1.0
    if structure.free_time:
        low, high = numbers.bounds
        with np.errstate(divide="ignore"):
            scale = float(np.clip(1.05 * np.max(np.maximum(v / high, v / low)), 1e-3, 0.9 * numbers.longest))
    states = rollout(task.group, structure.controls, v, numbers.drift * scale)
    v = v / scale
    parts = []
    for k in range(N + 1):
        parts.append(np.concatenate([pack_element(task.group, states[k]), v[k], [scale]]))
        if k < N:
            parts.append(v[k + 1] - v[k])
    return np.concatenate(parts)


def _solve(
    task: Task, structure: Structure, built: Program, numbers: _Numbers, margins: Array, aim: Array, start: Array
) -> _Candidate:
    group, m, N, size = task.group, len(structure.controls), structure.intervals, structure.size
    stage = structure.stage
    low, high = np.full(len(start), -np.inf), np.full(len(start), np.inf)
    h = 1.0 / N
    for k in range(N + 1):
        at = k * (stage + m)
        if k == 0:
            identity = pack_element(group, np.eye(group.degree))
            low[:size] = high[:size] = identity
        low[at + size : at + size + m], high[at + size : at + size + m] = numbers.bounds
        if numbers.rest and k in (0, N):
            low[at + size : at + size + m] = high[at + size : at + size + m] = 0.0
        low[at + size + m], high[at + size + m] = (1e-3, numbers.longest) if structure.free_time else (1.0, 1.0)
        if k < N and not structure.free_time:
            low[at + stage : at + stage + m], high[at + stage : at + stage + m] = (h * each for each in numbers.rates)
    upper = np.where(built.equality, 0.0, np.inf)
    result = built.solver(
        x0=start, p=_parameters(task, numbers, margins, aim), lbx=low, ubx=high, lbg=np.zeros(len(upper)), ubg=upper
    )
    solution = np.asarray(result["x"]).ravel()
    g = np.asarray(result["g"]).ravel()
    violation = float(np.max(np.where(built.equality, np.abs(g), np.maximum(-g, 0.0))))
    violation = max(violation, float(np.max(np.maximum(np.maximum(low - solution, solution - high), 0.0))))
    rows = [solution[k * (stage + m) : k * (stage + m) + stage] for k in range(N + 1)]
    values = np.array([row[size : size + m] for row in rows])
    last = pack_element(group, aim)
    if not np.all(np.isfinite(solution)) or np.max(np.abs(rows[-1][:size] - last)) > 1e-5 * max(
        1.0, np.max(np.abs(last))
    ):
        violation = np.inf
    stats = built.solver.stats()
    return _Candidate(
        float(result["f"]),
        values,
        float(rows[0][size + m]),
        violation,
        int(stats.get("iter_count", -1)),
        str(stats.get("return_status", stats.get("unified_return_status", ""))),
        solution,
    )


def _parameters(task: Task, numbers: _Numbers, margins: Array, aim: Array) -> Array:
    parts: list[Any] = [pack_element(task.group, aim), numbers.drift, numbers.weights]
    for obstacle, margin in zip(numbers.obstacles, margins, strict=True):
        values = list(obstacle.parameters())
        values[-1] = values[-1] - margin if isinstance(obstacle, Cone) else np.sqrt(values[-1] ** 2 + margin)
        parts.append(values)
    parts += [pack_element(task.group, element) for element in numbers.via]
    parts.append(np.minimum(np.minimum(-numbers.rates[0], numbers.rates[1]), 1e6))
    return np.concatenate([np.asarray(part, dtype=float) for part in parts])


def _fine_states(task: Task, u: Controls, drift: Array, intervals: int) -> tuple[Array, Array]:
    t = np.linspace(0, task.duration, _FINE * intervals + 1)
    return t, simulate(task.group, u.plus(drift), t=t, tolerance=1e-10).X


def _piecewise_linear(task: Task, values: Array) -> Controls:
    knots = np.linspace(0, task.duration, len(values))

    def evaluate(t: Array) -> Array:
        u = np.zeros((len(t), task.group.dim))
        for position, column in zip(task.controls, values.T, strict=True):
            u[:, position] = np.interp(t, knots, column)
        return u

    return Controls(evaluate, knots[1:-1])


def _complaint(task: Task, structure: Structure, numbers: _Numbers, candidates: list[_Candidate]) -> str:
    """What was tried, how near it came, and which limits the unconstrained optimum breaks."""
    nearest = min(candidate.violation for candidate in candidates)
    lines = [
        f"steer({task.group.name}): no admissible manoeuvre from {len(candidates)} starts with {structure.intervals} "
        f"intervals (smallest violation {nearest:.2g}; {candidates[0].message})"
    ]
    _, v = next(iter(guesses(task, structure, numbers.via, 1)))
    low, high = numbers.bounds
    with np.errstate(divide="ignore", invalid="ignore"):
        over = np.nanmax(np.maximum(v / high, v / low), axis=0)
    for position, ratio in zip(structure.controls, over, strict=True):
        if np.isfinite(ratio) and ratio > 1:
            label = task.group.labels[position]
            lines.append(f"without limits the least-energy manoeuvre needs {ratio:.3g} times the bound of {label}")
    if np.max(over, initial=0.0) > 1 and not structure.free_time and not np.any(numbers.drift):
        lines.append(f"{task.duration * float(np.max(over)):.4g} s would be enough for the bounds on the controls")
    states = rollout(task.group, structure.controls, v, numbers.drift)
    for number, obstacle in enumerate(numbers.obstacles, start=1):
        if np.min(obstacle.clearance(states)) < 0:
            lines.append(f"it crosses obstacle {number} ({type(obstacle).__name__})")
        for which, element in (("start", np.eye(task.group.degree)), ("target", task.target)):
            if obstacle.clearance(element[None])[0] < 0:
                lines.append(f"the {which} itself is inside obstacle {number} ({type(obstacle).__name__})")
    return "; ".join([*lines, "try a longer duration, more starts or more intervals"])
