"""First guesses of controls from the area rule: a straight part and one loop for each bracket that is needed."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow.second_kind_coordinates import element_coordinates
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.task import Task

_SEED = 5
_QUIET = 8


def coordinates(group: MatrixGroup, target: Array) -> Array:
    """(n,) coordinates of the target: its logarithm where it has one, else its coordinates of the second kind, else 0."""
    return element_coordinates(group, target)


def loop_areas(group: MatrixGroup, controls: Sequence[int], x: Array) -> tuple[list[tuple[int, int]], Array]:
    """Pairs of controls and the areas of their loops that make up, by least squares, what x needs without a control."""
    pairs = list(combinations(range(len(controls)), 2))
    free = [k for k in range(group.dim) if k not in controls]
    if not pairs or not free:
        return pairs, np.zeros(len(pairs))
    c = group.algebra.structure_constants
    columns = np.array([c[controls[a], controls[b]][free] for a, b in pairs]).T
    return pairs, np.asarray(np.linalg.lstsq(columns, x[free], rcond=None)[0])


def area_rule_seed(
    group: MatrixGroup, controls: Sequence[int], x: Array, s: Array, phase: float, stretch: float = 1.0
) -> Array:
    """(k, m) controls in unit time s that reach x to second order of averaging.

    The controlled components are constant; a pair (i, j) of controls draws p circles of radius r whose areas p pi r^2
    add up, through the structure constants, to the components without a control (least squares over pairs):
    the area rule of Leonard and Krishnaprasad, TR 93-59, Corollary 2. Each pair has a harmonic p of its own.
    """
    v = np.tile(x[list(controls)], (len(s), 1))
    pairs, areas = loop_areas(group, controls, x)
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


def seed_controls(
    group: MatrixGroup, controls: Sequence[int], depth: int, x: Array, starts: int, samples: int = 33
) -> Array:
    """(starts, samples, m) guesses: the area rule at eight phases, then with random waves; waves at once if depth > 1."""
    rng = np.random.default_rng(_SEED)
    s = np.linspace(0, 1, samples)
    guesses = []
    for number in range(starts):
        quiet = number < _QUIET
        stretch = 1.0 if quiet else 1.0 + 0.5 * rng.uniform(-1, 1)
        v = area_rule_seed(group, controls, x, s, 2 * np.pi * number / _QUIET + (0 if quiet else np.pi / 8), stretch)
        if not quiet or (depth > 1 and number > 0):
            size = 0.85 * (1 + np.linalg.norm(x))
            for harmonic in (1, 2):
                for wave in (np.cos, np.sin):
                    v = v + size * np.outer(wave(2 * np.pi * harmonic * s), rng.uniform(-1, 1, size=v.shape[1]))
        guesses.append(v)
    return np.array(guesses)


def seeds(task: Task, s: Array, starts: int) -> list[Array]:
    """`starts` guesses (len(s), m) for the transcription."""
    x = coordinates(task.group, task.target)
    return list(seed_controls(task.group, task.controls, task.report.depth, x, starts, len(s)))
