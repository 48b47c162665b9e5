"""method="direct": bounds, drift, goal sets, fuel, functions of time; reaches first, descends afterwards, polishes last.

Stage 1 only wants to arrive, from many starts side by side; stage 2 descends from each that did, and stays there; stage 3 makes
the controls continuous and lets the true system confirm them. Nothing is compiled for a problem.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from numpy.typing import ArrayLike

from lie_codegen.errors import InfeasibleError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.constraints import Obstacle, check_obstacles
from lie_codegen.steering.direct.around import around
from lie_codegen.steering.direct.assemble import Manoeuvre, constant_pieces
from lie_codegen.steering.direct.certificates import certificate
from lie_codegen.steering.direct.compiled import machine
from lie_codegen.steering.direct.continuation import tightened
from lie_codegen.steering.direct.guess import guessed
from lie_codegen.steering.direct.least_time import least_time
from lie_codegen.steering.direct.outcome import not_found, plan_at_the_edge, smoother
from lie_codegen.steering.direct.polish import as_inputs, corrected
from lie_codegen.steering.direct.problem import check_options, manoeuvre, piece_count
from lie_codegen.steering.direct.programme import Settings
from lie_codegen.steering.direct.report import cost_of, plan_of
from lie_codegen.steering.direct.robust import robust
from lie_codegen.steering.direct.search import LARGE, Budget, search
from lie_codegen.steering.direct.switches import switched
from lie_codegen.steering.plan import Plan

#: Of the starts whose bounds were narrowed, how many are read as arcs.
_FARTHEST = 12
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
        obstacles: `Cone`s, `Ball`s, `Box`es and `Cylinder`s to keep out of.
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
    check_options(objective, equation, starts, rounds, pieces, iterations, tolerance)
    task = manoeuvre(group, target, controls, duration, drift, bounds, weights, start, equation)
    count = piece_count(task) if pieces is None else pieces
    if obstacles is not None and len(checked := check_obstacles(group, obstacles)):
        return around(
            task, target, checked, classes, tolerance, starts, rounds, iterations, seed, guessed(task, guess, count), objective, longest, say
        )  # fmt: skip
    if objective == "time":
        limits = Settings(True, iterations, iterations)
        return least_time(task, target, tolerance, limits, starts, rounds, seed, longest, say, vertices)
    if spread is not None:
        guesses = guessed(task, guess, count)
        return robust(task, target, tolerance, spread, starts, count, iterations, seed, guesses, say)
    proof = certificate(task)
    if proof is not None:
        raise InfeasibleError(f"steer({group.name}): infeasible: {proof}", certificate=proof)
    settings, smooth = _settings(task, objective, iterations, polish)
    budget = Budget(starts, rounds, count, seed, settings)
    return _searched(task, target, objective, tolerance, budget, guess, smooth, say, began)


def _settings(task: Manoeuvre, objective: str, iterations: int, polish: bool | None) -> tuple[Settings, bool]:
    """How far a start descends, and whether controls become continuous."""
    settings = Settings(objective == "fuel", iterations, iterations)
    if objective == "none":
        return replace(settings, descend_iterations=0, wanted=1), False
    large = task.system.group.dim > LARGE
    if large:
        settings = replace(settings, descend_iterations=min(_LARGE_DESCENT, iterations))
    return settings, not large if polish is None else polish


def _searched(
    task: Manoeuvre,
    target: Any,
    objective: str,
    tolerance: float,
    budget: Budget,
    guess: Any,
    smooth: bool,
    say: Callable[[str], None],
    began: float,
) -> Plan:
    """The best of many starts: constant pieces, corrected on the true system, then continuous where that is as good."""
    group, settings, count = task.system.group, budget.settings, budget.pieces
    solver = machine(group, task.controls)
    built = time.perf_counter()
    programme = constant_pieces(task, count)
    found = search(task, programme, solver, budget, guessed(task, guess, count), say)
    if not found.arrived:
        nearest = found.near
        found = tightened(task, programme, solver, budget, found)
    if not found.arrived:
        edge = switched(task, found.near[:_FARTHEST]) or switched(task, nearest)
        if edge is not None:
            return plan_at_the_edge(task, target, found, *edge, budget, tolerance, objective, began)
        raise not_found(task, target, found, budget, tolerance, began)
    u, best = corrected(task, solver, programme, found.u, found.variant, False, settings)
    blocks = as_inputs(task, u, False)
    discretisation = f"{count} constant pieces"
    if smooth:
        best, discretisation = smoother(task, solver, u, found, best, settings)
    say(f"the true system ends {best.miss:.2g} from the goal; {discretisation}")
    seconds = {"build": built - began, "solve": time.perf_counter() - built}
    details = {
        "winner": "direct",
        "objective": objective,
        "tried": found.tried,
        "starts": found.starts,
        "reached": found.reached,
        "agree": found.agree,
        "seed": budget.seed,
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
