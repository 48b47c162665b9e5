"""method="direct": bounds, drift, goal sets, fuel, functions of time; reaches first, descends afterwards, polishes last.

Stage 1 only wants to arrive, from many starts side by side; stage 2 descends from each that did, and stays there; stage 3 makes
the controls continuous and lets the true system confirm them. Nothing is compiled for a problem.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InfeasibleError, ShapeError, SteeringError, SteeringInputError
from lie_codegen.flow.elements import group_element
from lie_codegen.groups.matrix_group import MatrixGroup, require_group
from lie_codegen.steering.constraints import Obstacle, box_limits, check_obstacles
from lie_codegen.steering.direct.around import around
from lie_codegen.steering.direct.assemble import Manoeuvre, constant_pieces
from lie_codegen.steering.direct.certificates import certificate
from lie_codegen.steering.direct.compiled import machine
from lie_codegen.steering.direct.guess import guessed
from lie_codegen.steering.direct.least_time import least_time
from lie_codegen.steering.direct.polish import Flown, PolishError, as_inputs, corrected, flown, polished, refined
from lie_codegen.steering.direct.programme import Machine, Settings
from lie_codegen.steering.direct.reach import require_reach
from lie_codegen.steering.direct.report import cost_of, plan_of
from lie_codegen.steering.direct.robust import robust
from lie_codegen.steering.direct.search import LARGE, Budget, Found, search
from lie_codegen.steering.direct.switches import switched
from lie_codegen.steering.direct.system import System, controls_of, velocity
from lie_codegen.steering.goals import end_of
from lie_codegen.steering.plan import Plan, Status
from lie_codegen.steering.task import check_duration

_OBJECTIVES = ("energy", "fuel", "time", "none")
_FUEL_TIMES = 4
#: Steps of a descent on large groups, where each takes a tenth of a second.
_LARGE_DESCENT = 40


def direct(
    group: MatrixGroup,
    target: Any,
    controls: Sequence[Any],
    duration: float,
    *,
    tolerance: float = 1e-6,
    drift: Any = None,
    bounds: Any = None,
    weights: ArrayLike | None = None,
    objective: str = "energy",
    start: ArrayLike | None = None,
    equation: str = "left",
    guess: Any = None,
    spread: Sequence[Any] | None = None,
    starts: int = 16,
    rounds: int = 4,
    pieces: int | None = None,
    iterations: int = 150,
    seed: int = 0,
    polish: bool | None = None,
    longest: float = 20.0,
    vertices: ArrayLike | None = None,
    obstacles: Sequence[Obstacle] | None = None,
    classes: int = 4,
    progress: Callable[[str], None] | None = None,
) -> Plan:
    """Least energy, fuel or time within bounds, from many starts.

    Args:
        group, target, controls, duration, tolerance: as `steer`; a control may be a vector (n,), n formulas of t, or a function of t.
        drift: (n,) velocity that is there without controls, n formulas of t, or a function of t.
        bounds: of the controls: a number (both signs), a (low, high) pair, or {label: either}.
        weights: (m,) positive w_i of the objective, ones if not given.
        objective: "energy", int sum w u^2 dt; "fuel", int sum w |u| dt; "time", the duration, of which the given
            one is a guess; "none", any controls that reach the goal, as soon as a start has arrived.
        start: (d, d) X(0), the identity if not given.
        equation: "left", X' = X hat(u); "right", X' = hat(u) X, as Schroedinger's equation.
        guess: controls to start from beside the others: a Plan, a function of t, or samples (k, m) at equal times.
        spread: systems that shall all end at the goal under the same controls, {"drift": added to the common one, "gain": of the
            controls} each; then the plan is the one of least squared errors, and details["worst_infidelity"] (gates) tells how good.
        starts: first guesses a round.
        rounds: rounds, with new guesses, before the goal counts as not found.
        pieces: of constant controls in the search, 48 (32 on large groups) if not given.
        iterations: most steps of each start in each stage; twice, three times ... as many to reach in later rounds.
        seed: of the guesses; the same seed, the same answer.
        polish: whether the controls become continuous (energy); else they stay constant on each piece. Where not given, they do on
            groups of up to 20 dimensions.
        longest: for "time": the longest duration allowed, in units of the given one.
        obstacles: `Cone`s and `Ball`s to keep out of, "energy" alone.
        classes: classes of ways around them that are tried.
        vertices: for "time": the (k, m) control vectors that arcs take, where the controls are not free in a box: (omega, v) = (+-1, +-1),
            (0, +-1) is the car of Reeds and Shepp, whose turning rate is bounded by its speed. Box vertices and zeros if not given.
        progress: called with one line a stage.

    Raises:
        SteeringInputError, ShapeError, NotFiniteError, NotOnGroupError: about an argument.
        UncontrollableError: controls and drift do not generate the algebra.
        InfeasibleError: proved; with the proof in `.certificate`.
        SteeringError: not found, which proves nothing; with the nearest plan in `.best` and by how much it misses in `.violation`.
    """
    say = progress or (lambda line: None)
    began = time.perf_counter()
    _check(objective, equation, starts, rounds, pieces, iterations, tolerance)
    task = manoeuvre(group, target, controls, duration, drift, bounds, weights, start, equation)
    if obstacles and objective != "energy":
        raise SteeringInputError(
            f'steer({group.name}): method="direct" goes around obstacles at least energy; objective={objective!r} beside them is for '
            "method='transcription' (\"time\") or without them"
        )
    if objective == "time":
        limits = Settings(True, iterations, iterations)
        return least_time(task, target, tolerance, limits, starts, rounds, seed, longest, say, vertices)
    count = _pieces(task) if pieces is None else pieces
    if obstacles is not None and len(checked := check_obstacles(group, obstacles)):
        guesses = guessed(task, guess, count)
        return around(task, target, checked, classes, tolerance, starts, rounds, iterations, seed, guesses, say)
    if spread is not None:
        guesses = guessed(task, guess, count)
        return robust(task, target, tolerance, spread, starts, count, iterations, seed, guesses, say)
    proof = certificate(task)
    if proof is not None:
        raise InfeasibleError(f"steer({group.name}): infeasible: {proof}", certificate=proof)
    settings = Settings(objective == "fuel", iterations, iterations)
    large = group.dim > LARGE
    polish = not large if polish is None else polish
    if large:
        settings = replace(settings, descend_iterations=min(_LARGE_DESCENT, iterations))
    if objective == "none":
        settings, polish = replace(settings, descend_iterations=0, wanted=1), False
    budget = Budget(starts, rounds, count, seed, settings)
    solver = machine(group, task.controls)
    built = time.perf_counter()
    programme = constant_pieces(task, count)
    found = search(task, programme, solver, budget, guessed(task, guess, count), say)
    if not found.arrived:
        edge = switched(task, found.near)
        if edge is not None:
            return _at_the_edge(task, target, found, *edge, budget, tolerance, objective, began)
        raise _not_found(task, target, found, budget, tolerance, began)
    u, best = corrected(task, solver, programme, found.u, found.variant, False, settings)
    blocks = as_inputs(task, u, False)
    discretisation = f"{count} constant pieces"
    if polish:
        best, discretisation = _smoother(task, solver, u, found, best, settings)
    say(f"the true system ends {best.miss:.2g} from the goal; {discretisation}")
    seconds = {"build": built - began, "solve": time.perf_counter() - built}
    details = {
        "winner": "direct",
        "objective": objective,
        "tried": found.tried,
        "starts": found.starts,
        "reached": found.reached,
        "agree": found.agree,
        "seed": seed,
        "pieces": blocks,
        "pieces_cost": cost_of(task, blocks, objective),
        "pieces_peaks": blocks.peaks(),
        "discretisation": discretisation,
        "compiled": solver.compiled,
        "optimality": "none asked for"
        if objective == "none"
        else f"a local minimum, the cheapest of {found.reached} starts that arrived; {found.agree} ended within 1 % of it",
    }
    if task.end.phases:
        details["phase"] = task.end.phases[found.variant]
    return plan_of(task, target, best, found.variant, tolerance, objective, details, seconds)


def manoeuvre(
    group: MatrixGroup,
    target: Any,
    controls: Sequence[Any],
    duration: float,
    drift: Any,
    bounds: Any,
    weights: ArrayLike | None,
    start: ArrayLike | None,
    equation: str,
) -> Manoeuvre:
    """The problem, checked.

    Raises:
        As `direct`.
    """
    require_group(group, "steer")
    where = f"steer({group.name})"
    check_duration(duration, where)
    labels, directions = controls_of(group, controls, where)
    free = velocity(group, np.zeros(group.dim) if drift is None else drift, f"{where}: drift")
    eye = np.eye(group.degree, dtype=group.basis.dtype)
    here = eye if start is None else group_element(group, start, f"{where}: start")
    system = System(group, labels, directions, free, here, equation == "right")
    end = end_of(group, target, f"{where}: target")
    low, high = box_limits(labels, bounds, f"{where}: bounds")
    w = np.ones(len(labels)) if weights is None else np.array(weights, dtype=float)
    if w.shape != (len(labels),):
        raise ShapeError(f"{where}: weights have shape {w.shape}; give one for each of {len(labels)} controls")
    if not np.all(np.isfinite(w)) or np.any(w <= 0):
        raise SteeringInputError(f"{where}: weights must be positive, got {w.tolist()}")
    require_reach(system, float(duration), end)
    return Manoeuvre(system, end, float(duration), low, high, w)


def _smoother(
    task: Manoeuvre, solver: Machine, u: Array, found: Found, before: Flown, settings: Settings
) -> tuple[Flown, str]:
    """Better controls than the constant pieces, if they keep to the goal as well: what was flown, in words."""
    plain = f"{len(task.own(u))} constant pieces"
    if settings.fuel:
        finer, programme = refined(task, solver, u, found.variant, _FUEL_TIMES, settings)
        _, now = corrected(task, solver, programme, finer, found.variant, False, settings)
        pieces = len(now.inputs.first)
        cheaper = now.inputs.integral_of_sizes(task.weights) < before.inputs.integral_of_sizes(task.weights)
        good = cheaper and now.miss <= max(10 * before.miss, 1e-9)
        return (now, f"{pieces} constant pieces") if good else (before, plain)
    try:
        nodes, programme, pieces = polished(task, solver, u, found.variant, found.cost, settings)
    except PolishError:
        return before, plain
    _, now = corrected(task, solver, programme, nodes, found.variant, True, settings)
    if now.miss <= max(10 * before.miss, 1e-9):
        return now, f"continuous controls, linear on {pieces} pieces"
    return before, plain


def _at_the_edge(
    task: Manoeuvre,
    target: Any,
    found: Found,
    best: Flown,
    variant: int,
    budget: Budget,
    tolerance: float,
    objective: str,
    began: float,
) -> Plan:
    """The plan of arcs whose ends moved: nothing cheaper was sought, at the edge of what can be reached there is next to no choice."""
    arcs = len(best.inputs.first)
    details = {
        "winner": "direct, arcs with free ends",
        "objective": objective,
        "tried": (
            *found.tried,
            f"{arcs} arcs with free ends reach it from one of the nearest {len(found.near)} starts",
        ),
        "starts": found.starts,
        "reached": 0,
        "agree": 1,
        "seed": budget.seed,
        "pieces": best.inputs,
        "pieces_cost": cost_of(task, best.inputs, objective),
        "pieces_peaks": best.inputs.peaks(),
        "discretisation": f"none: {arcs} arcs of constant controls",
        "optimality": "not sought: equal pieces did not reach the goal, which lies at the edge of what the bounds allow",
    }
    if task.end.phases:
        details["phase"] = task.end.phases[variant]
    took = {"solve": time.perf_counter() - began}
    return plan_of(task, target, best, variant, tolerance, objective, details, took, Status.SOLVED)


def _not_found(
    task: Manoeuvre, target: Any, found: Found, budget: Budget, tolerance: float, began: float
) -> SteeringError:
    """The error, with the nearest plan; it says what was tried and proves nothing."""
    best = flown(task, found.u, found.variant, False)
    details = {
        "tried": found.tried,
        "starts": found.starts,
        "reached": 0,
        "agree": 0,
        "seed": budget.seed,
        "objective": "none",
    }
    plan = plan_of(
        task,
        target,
        best,
        found.variant,
        tolerance,
        "energy",
        details,
        {"solve": time.perf_counter() - began},
        Status.NOT_FOUND,
    )
    name = task.system.group.name
    return SteeringError(
        f"steer({name}): not found, which proves nothing: the nearest of {found.starts} starts ends {plan.error:.3g} from the goal "
        f"({len(found.tried)} rounds, {budget.pieces} pieces, {budget.settings.reach_iterations} iterations, seed {budget.seed}); "
        "it is in .best; more starts, more pieces or another seed may find one, wider bounds may make it possible",
        best=plan,
        violation=plan.violation,
    )


def _pieces(task: Manoeuvre) -> int:
    """More where there are more equations a control."""
    n, m = task.system.group.dim, task.controls
    return max(48 if n <= 8 else 32, -(-4 * n // m))


def _check(
    objective: str, equation: str, starts: int, rounds: int, pieces: int | None, iterations: int, tolerance: float
) -> None:
    if objective not in _OBJECTIVES:
        raise SteeringInputError(f"objective is one of {', '.join(_OBJECTIVES)}, got {objective!r}")
    if equation not in ("left", "right"):
        raise SteeringInputError(f'equation is "left" (X\' = X hat(u)) or "right" (X\' = hat(u) X), got {equation!r}')
    for name, value in (
        ("starts", starts),
        ("rounds", rounds),
        ("iterations", iterations),
        ("pieces", 1 if pieces is None else pieces),
    ):
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
            raise SteeringInputError(f"{name} must be a whole number of at least 1, got {value!r}")
    if not tolerance > 0:
        raise SteeringInputError(f"tolerance must be positive, got {tolerance!r}")
