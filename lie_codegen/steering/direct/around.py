"""method="direct" among obstacles: ways around them as guesses beside the straight one, stages 1 and 2 with gaps that are kept, an integration of its own.

The ways come from `obstacles`: words of discs in the plane, a sampled roadmap otherwise; no way is of the system. Controls follow each as
nearly as they can while they reach the goal, then leave it and only stay clear (stage 1), then become cheap (stage 2). Between the nodes
the true system is flown and looked at so often that it moves by less than a part of the smallest obstacle; what cuts one there
widens its margin, and a way through the seam of two discs is refused.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InfeasibleError, SteeringError, SteeringInputError
from lie_codegen.steering.constraints import Obstacle
from lie_codegen.steering.direct.assemble import Manoeuvre
from lie_codegen.steering.direct.certificates import certificate
from lie_codegen.steering.direct.programme import Settings
from lie_codegen.steering.direct.scene import CLEAR, ENOUGH, STRAIGHT, Result, Scene
from lie_codegen.steering.direct.sharper import sharper
from lie_codegen.steering.goals import cosets_of
from lie_codegen.steering.obstacles.blocked import refuse_blocked
from lie_codegen.steering.obstacles.keep_out import KeepOut
from lie_codegen.steering.plan import Plan, Status

#: Results that are sharpened, the cheapest first, and relative costs that are taken for one.
_SHARPENED, _ALIKE = 3, 1e-2


def around(
    task: Manoeuvre,
    target: Any,
    obstacles: Sequence[Obstacle],
    classes: int,
    tolerance: float,
    starts: int,
    rounds: int,
    iterations: int,
    seed: int,
    guesses: Array | None,
    objective: str,
    longest: float,
    say: Callable[[str], None],
) -> Plan:
    """The cheapest plan that stays clear of the obstacles; every class of ways that was found is in details["classes"].

    Raises:
        SteeringInputError: of least time, no bounds, or a system that depends on time.
        InfeasibleError: proved: obstacles or not, or by an end inside an obstacle.
        SteeringError: nothing was found, which proves nothing.
    """
    began = time.perf_counter()
    where = f"steer({task.system.group.name})"
    keep_out = KeepOut.of(task.system.group.degree, obstacles)
    refuse_blocked_ends(task, obstacles, where)
    proof = None if objective == "time" else certificate(task)
    if proof is not None:
        raise InfeasibleError(f"{where}: infeasible even without obstacles: {proof}", certificate=proof)
    timed = objective == "time"
    if timed:
        _refuse_endless(task, where)
    settings = scene_settings(objective, iterations)
    scene = Scene(task, keep_out, tuple(obstacles), settings, objective, longest if timed else 0.0)
    return searched_scene(scene, target, classes, tolerance, starts, rounds, seed, guesses, say, began)


def scene_settings(objective: str, iterations: int) -> Settings:
    """How far a start descends among obstacles."""
    descend = 0 if objective == "none" else iterations
    return Settings(objective in ("fuel", "time"), iterations, descend, enough=ENOUGH, relative=1e-6)


def searched_scene(
    scene: Scene,
    target: Any,
    classes: int,
    tolerance: float,
    starts: int,
    rounds: int,
    seed: int,
    guesses: Array | None,
    progress: Callable[[str], None] | None,
    began: float,
) -> Plan:
    """The cheapest plan of a scene.

    Raises:
        SteeringError: nothing was found, which proves nothing.
    """
    task, say = scene.task, progress or (lambda line: None)
    where, objective = f"steer({task.system.group.name})", scene.objective
    tried: list[str] = []
    found: list[Result] = []
    total = 0
    for round_ in range(rounds):
        for variant in range(len(task.end.values)):
            lanes, names = scene.first(
                classes, seed + round_, variant, max(STRAIGHT, starts // 3), guesses if round_ == 0 else None
            )
            total += len(lanes)
            results, there = scene.solved(lanes, names, variant)
            tried.append(f"round {round_ + 1}: {there} of {len(lanes)} starts reach the goal and stay clear")
            say(tried[-1])
            found += results
        if any(each.clearance >= -CLEAR and each.off <= tolerance for each in found):
            break
    good = [each for each in found if each.clearance >= -CLEAR and each.off <= tolerance]
    details: dict[str, Any] = {
        "tried": tuple(tried),
        "starts": total,
        "reached": len(good),
        "seed": seed,
        "objective": objective,
    }
    took = {"solve": time.perf_counter() - began}
    if not good:
        nearest = min(found, key=lambda each: max(each.off, -each.clearance))
        details |= {"agree": 0, "violation": {"end": nearest.off, "clearance": max(0.0, -nearest.clearance)}}
        plan = scene.plan(target, nearest, tolerance, details, took, Status.NOT_FOUND)
        raise SteeringError(
            f"{where}: not found, which proves nothing: the nearest of {total} starts ends {nearest.off:.3g} from the goal and cuts an obstacle "
            f"by {max(0.0, -nearest.clearance):.3g} (seed {seed}); it is in .best; more starts, more classes or another seed may find one",
            best=plan,
            violation=plan.violation,
        )
    good.sort(key=lambda each: each.cost)
    facts = {
        "agree": sum(each.cost <= good[0].cost * 1.01 for each in good),
        "classes": scene.named(good),
        "optimality": f"a local minimum, the cheapest of {len(good)} that were refined",
    }
    different: list[Result] = []
    for each in good:
        if len(different) < _SHARPENED and all(abs(each.cost - one.cost) > _ALIKE * each.cost for one in different):
            different.append(each)
    plans = [
        sharper(_plan(scene, target, each, tolerance, {**details, **facts}, took), scene, target, tolerance)
        for each in different
    ]
    return min(plans, key=scene.objective_of) if objective in ("energy", "time") else plans[0]


def _plan(
    scene: Scene, target: Any, best: Result, tolerance: float, details: dict[str, Any], took: dict[str, float]
) -> Plan:
    """The plan of a result, with what is known of it."""
    details |= {
        "winner": f"direct from {best.name}",
        "discretisation": f"{'continuous controls, linear on' if scene.linear else 'controls constant on'} "
        f"{len(best.flown.inputs.first)} pieces",
        "clearances": scene.clearances(best.flown),
    }
    if scene.task.end.phases:
        details["phase"] = scene.task.end.phases[best.variant]
    return scene.plan(target, best, tolerance, details, took, None)


def _refuse_endless(task: Manoeuvre, where: str) -> None:
    """Of least time: controls without bounds have none, and what depends on time has no unit of it."""
    if not np.all(np.isfinite(task.low)) or not np.all(np.isfinite(task.high)):
        raise SteeringInputError(f'{where}: objective="time" among obstacles needs bounds on every control')
    if not task.system.steady:
        raise SteeringInputError(
            f'{where}: objective="time" among obstacles stretches the time of the whole motion, which means nothing where controls or '
            "drift are functions of the time; give constant ones, or steer in given durations"
        )


def refuse_blocked_ends(task: Manoeuvre, obstacles: Sequence[Obstacle], where: str) -> None:
    """Nothing, where both ends are clear.

    Raises:
        InfeasibleError: one is inside an obstacle.
    """
    group = task.system.group
    elements, free = cosets_of(group, task.end, where)
    places = [("start", np.real(task.system.start), np.zeros((0, group.dim)))]
    if len(elements) == 1:
        places.append(("target", np.real(elements[0]), free))
    named = [(f"obstacle {number} ({type(each).__name__})", each) for number, each in enumerate(obstacles, start=1)]
    refuse_blocked(where, group, places, named)
