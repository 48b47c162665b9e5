"""A fourth-order step on a grid that is halved until two runs agree."""

from __future__ import annotations

from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError
from lie_codegen.flow.grid import Grid, refine
from lie_codegen.flow.inputs import Signal
from lie_codegen.flow.rollout import rollout
from lie_codegen.runtime.call import Compiled

#: |h u| and w h (of the fastest sine) that a step may span.
_LARGEST_STEP, _LARGEST_ANGLE = 0.25, 1.0
#: Steps that are taken where u is a formula, evaluated in C (some seconds on SO(3)), and where it is sampled by numpy.
_MOST_STEPS, _MOST_SAMPLES = 2**26, 2**23


def refined(
    step: Compiled[Any],
    signal: Signal,
    eps: Array,
    start: Array,
    times: Array,
    *,
    rtol: float,
    atol: float = 0.0,
    name: str,
    threads: int = 1,
) -> tuple[Array, Grid, float]:
    """X at the times, the grid, and the error: the difference to the run with half the steps, over 15 (Richardson).

    Raises:
        ComputationError: the tolerance is not reached with 67 million steps (8 million where u is sampled).
    """
    most = _MOST_SAMPLES if signal.formula is None else _MOST_STEPS
    grid = Grid.coarse(times, signal.breakpoints)
    if signal.formula is not None:
        grid = _divided(grid, signal.formula.fastest * grid.largest_step / _LARGEST_ANGLE, most, name)
    coarse, move = rollout(step, grid, signal, eps, start, name, threads)
    while move > _LARGEST_STEP:
        grid = _divided(grid, move / _LARGEST_STEP, most, name)
        coarse, move = rollout(step, grid, signal, eps, start, name, threads)
    while True:
        grid = refine(grid, most, name)
        fine, _ = rollout(step, grid, signal, eps, start, name, threads)
        estimate = float(np.max(np.abs(fine - coarse), initial=0.0)) / 15
        scale = max(1.0, float(np.max(np.abs(fine))))
        if not np.isfinite(estimate):
            raise ComputationError(f"simulate({name}): the solution left the range of double precision")
        if estimate <= max(rtol * scale, atol, 4e-16 * scale * np.sqrt(grid.steps)):
            return fine, grid, estimate
        coarse = fine


def _divided(grid: Grid, ratio: float, most: int, name: str) -> Grid:
    """Steps shorter by at least the ratio, a power of two."""
    if ratio <= 1:
        return grid
    return refine(grid, most, name, 2 ** int(np.ceil(np.log2(ratio))))
