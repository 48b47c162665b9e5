"""What the candidates of a transcription amount to: the classes of ways that were found, tunnels, the nearest where none is good."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lie_codegen.steering.obstacles.homotopy import planar_discs
from lie_codegen.steering.obstacles.path_guess import word_text
from lie_codegen.steering.task import Task
from lie_codegen.steering.transcription.flow import simulated_path
from lie_codegen.steering.transcription.numbers import Numbers
from lie_codegen.steering.transcription.solve import Candidate


def classes_found(
    numbers: Numbers, candidates: Sequence[Candidate], duration: float, *, time: bool
) -> tuple[dict[str, Any], ...]:
    """{"word", "cost", "clearance"} of the best admissible candidate of each class of ways between discs, the cheapest first.

    The word is that of the result, which may have left the class of its guess; the cost is the objective: the
    energy, or the duration.
    """
    discs = planar_discs(numbers.obstacles)
    if discs is None:
        return ()
    best: dict[str, dict[str, Any]] = {}
    for each in sorted((one for one in candidates if one.admissible), key=lambda one: one.objective):
        if each.motion is None:
            continue
        way = each.motion.X[:, :2, 2]
        word = word_text(discs.word(way))
        clear = float(np.min(discs.clearance(way)))
        cost = each.duration * duration if time else each.objective / duration ** (2 * numbers.power - 1)
        best.setdefault(word, {"word": word, "cost": cost, "clearance": clear})
    return tuple(best.values())


def nearest_flown(task: Task, numbers: Numbers, candidates: Sequence[Candidate]) -> Candidate | None:
    """The candidate that misses its conditions by least, flown; None where none can be."""
    usable = [each for each in candidates if np.all(np.isfinite(each.values)) and np.isfinite(each.duration)]
    if not usable:
        return None
    nearest = min(usable, key=lambda each: (each.violation, each.miss))
    if nearest.motion is not None:
        return nearest
    return replace(nearest, motion=simulated_path(task.group, task.controls, numbers, nearest.values, nearest.duration))
