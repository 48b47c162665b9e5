"""First guesses of controls from the area rule: a straight part and one loop for each bracket that is needed."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.errors import NotOnGroupError
from lie_codegen.simulation.metric import matrix_log, second_kind
from lie_codegen.steering.task import Task

Array = NDArray[Any]


def displacement(task: Task) -> Array:
    """(n,) coordinates of the target: its logarithm where it has one, else its coordinates of the second kind."""
    x, off = matrix_log(task.group, task.target)
    if off <= 1e-6:
        return x
    try:
        return second_kind(task.group, task.target)
    except NotOnGroupError:
        return np.zeros(task.group.dim)


def area_rule_seed(task: Task, x: Array, s: Array, phase: float, stretch: float = 1.0) -> Array:
    """(k, m) controls in unit time s that reach x to second order of averaging.

    The controlled components are constant; a pair (i, j) of controls draws p circles of radius r whose areas p pi r^2
    add up, through the structure constants, to the components without a control (least squares over pairs):
    the area rule of Leonard and Krishnaprasad, TR 93-59, Corollary 2. Each pair has a harmonic p of its own.
    """
    c = task.group.algebra.structure_constants
    pairs = list(combinations(range(len(task.controls)), 2))
    v = np.tile(x[list(task.controls)], (len(s), 1))
    if not pairs:
        return v
    free = [k for k in range(task.group.dim) if k not in task.controls]
    columns = np.array([c[task.controls[a], task.controls[b]][free] for a, b in pairs]).T
    areas = np.linalg.lstsq(columns, x[free], rcond=None)[0] if free else np.zeros(len(pairs))
    order = np.argsort(-np.abs(areas), kind="stable")
    for harmonic, position in enumerate(order, start=1):
        area = areas[position]
        if abs(area) < 1e-9:
            continue
        a, b = pairs[position]
        w = 2 * np.pi * harmonic
        r = stretch * np.sqrt(abs(area) / (harmonic * np.pi))
        v[:, a] -= r * w * np.sin(w * s + phase)
        v[:, b] += np.sign(area) * r * w * np.cos(w * s + phase)
    return v


def seeds(task: Task, s: Array, starts: int, rng: np.random.Generator) -> list[Array]:
    """`starts` guesses: the area rule at several phases first, then the same with random Fourier content."""
    x = displacement(task)
    guesses = []
    for number in range(starts):
        v = area_rule_seed(task, x, s, phase=2 * np.pi * number / max(1, min(starts, 4)))
        if number >= 4 or task.report.depth > 1:
            size = 0.5 * (1 + np.linalg.norm(x))
            for harmonic in (1, 2):
                for wave in (np.cos, np.sin):
                    v = v + size * np.outer(wave(2 * np.pi * harmonic * s), rng.normal(size=v.shape[1]))
        guesses.append(v)
    return guesses
