"""The tasks of the steering benchmark: minimum energy, or time, with or without something in the way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from lie_codegen.arrays import Array
from lie_codegen.groups.catalogue_load import group as load
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.constraints import Ball, Cone
from lie_codegen.steering.shooting.shooter import shooter

#: Actuated basis elements of each system.
SYSTEMS = {"h3": (0, 1), "se2": (0, 1), "so3": (0, 1), "se3": (0, 1, 2, 3)}
#: Number of intervals, for everybody.
INTERVALS = 50
_BOUND = 2.0
_TRACKER = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Case:
    """One task: from the identity to the goal in unit time, or as fast as |u_i| <= 2 allows.

    Attributes:
        goal: (d, d).
        obstacle: None, a `Cone` or a `Ball`.
        bound: of the controls in a minimum-time task, else None.
    """

    goal: Array
    obstacle: Cone | Ball | None = None
    bound: float | None = None


@dataclass(frozen=True)
class Problem:
    """A system and what is asked of it: "energy", "cone", "disc" or "time"."""

    name: str
    group: MatrixGroup
    controls: tuple[int, ...]
    what: str


#: A solver: its cost (energy, or time) for a case, NaN where it does not get there.
Solver = Callable[[Case], float]


def problem(name: str) -> Problem:
    """ "so3", "so3-cone", "se2-disc", "so3-time" ..."""
    system, _, what = name.partition("-")
    return Problem(name, load(system), SYSTEMS[system], what or "energy")


def cases(asked: Problem, count: int, seed: int) -> list[Case]:
    """Random targets; obstacles stand on the way of the unconstrained optimum."""
    rng = np.random.default_rng(seed)
    made: list[Case] = []
    while len(made) < count:
        if asked.what == "disc":
            ahead, aside, turn = rng.uniform((1.5, -0.5, -0.5), (2.5, 0.5, 0.5))
            goal = expm(asked.group.hat([turn, 0, 0]))
            goal[:2, 2] = ahead, aside
            center = np.array([ahead, aside]) / 2 + rng.uniform(-0.1, 0.1, 2)
            made.append(Case(goal, Ball((float(center[0]), float(center[1])), 0.3)))
            continue
        goal = expm(asked.group.hat(rng.uniform(-1, 1, asked.group.dim)))
        if asked.what == "cone":
            cone = _cone(asked, goal)
            made += [Case(goal, cone)] if cone is not None else []
        else:
            made.append(Case(goal, bound=_BOUND if asked.what == "time" else None))
    return made


def _cone(asked: Problem, goal: Array) -> Cone | None:
    """A cone around where the optimum points the third axis half-way; None where the ends are too near to it."""
    solver = shooter(asked.group, asked.controls)
    middle = solver.extremal(solver.solve(goal).mu0[0], nodes=2).X[1] @ _TRACKER
    nearest = float(np.arccos(np.clip(max(middle @ _TRACKER, middle @ goal @ _TRACKER), -1, 1)))
    half = min(0.2, 0.5 * nearest)
    return Cone((0.0, 0.0, 1.0), (float(middle[0]), float(middle[1]), float(middle[2])), half) if half > 0.02 else None
