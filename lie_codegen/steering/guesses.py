"""First guesses for the transcription: the exact optimum without constraints, the area rule, a straight path."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.simulation.flow import simulate
from lie_codegen.steering.extremals import SOLVED
from lie_codegen.steering.plan import Controls
from lie_codegen.steering.seeds import coordinates, seed_controls
from lie_codegen.steering.shooting import shooter
from lie_codegen.steering.task import Task
from lie_codegen.steering.transcription_problem import Structure

Array = NDArray[Any]


def guesses(task: Task, structure: Structure, via: Sequence[Array], starts: int) -> Iterator[tuple[str, Array]]:
    """`starts` pairs (name, (N + 1, m) controls in unit time)."""
    shot = _shot(task, structure, via)
    made: list[tuple[str, Array]] = [] if shot is None else [("shooting", shot)]
    x = coordinates(task.group, task.target)
    seeds = seed_controls(task.group, task.controls, task.report.depth, x, max(starts, 2), structure.intervals + 1)
    made.append(("a straight path", np.tile(x[list(task.controls)], (structure.intervals + 1, 1)) + 0.02))
    made += [(f"the area rule, start {number}", seed) for number, seed in enumerate(seeds, start=1)]
    yield from made[:starts]


def _shot(task: Task, structure: Structure, via: Sequence[Array]) -> Array | None:
    """The extremals of least energy from via point to via point, in the time each has; None where one is not found."""
    solver = shooter(task.group, task.controls)
    nodes = [0, *structure.via, structure.intervals]
    elements = [np.eye(task.group.degree), *via, task.target]
    v = np.zeros((structure.intervals + 1, len(task.controls)))
    for first, last, here, there in zip(nodes, nodes[1:], elements, elements[1:], strict=False):
        found = solver.solve(np.linalg.solve(here, there))
        if found.status[0] != SOLVED:
            return None
        s = np.linspace(0, 1, last - first + 1)
        part = solver.extremal(found.mu0[0]).control(s) * structure.intervals / (last - first)
        v[first : last + 1] = part
    return v


def rollout(group: MatrixGroup, controls: tuple[int, ...], v: Array, drift: Array) -> Array:
    """(N + 1, d, d) X at the nodes under controls linear between them, in unit time."""
    t = np.linspace(0, 1, len(v))

    def evaluate(times: Array) -> Array:
        u = np.tile(drift, (len(times), 1))
        for position, column in zip(controls, v.T, strict=True):
            u[:, position] += np.interp(times, t, column)
        return u

    return np.asarray(simulate(group, Controls(evaluate, ()), t=t, tolerance=1e-8).X)
