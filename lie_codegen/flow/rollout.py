"""One pass of a step over a grid: u as a formula inside the loop, or sampled block by block."""

from __future__ import annotations

from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import NotFiniteError
from lie_codegen.flow.grid import Grid, sample
from lie_codegen.flow.inputs import Signal
from lie_codegen.runtime.call import Compiled
from lie_codegen.runtime.drive import driven_loop

#: Steps for which u is sampled at once.
BLOCK = 16_384


def rollout(
    step: Compiled[Any], grid: Grid, u: Signal, eps: Array, start: Array, name: str, threads: int = 1
) -> tuple[Array, float]:
    """The states at the output times, and the largest |h eps u| of any step.

    Args:
        step: (X, u0, um, u1, h) -> X_next.
        grid: the steps.
        u: the input.
        eps: () or (N,).
        start: (d, d) or (N, d, d).
        name: of the group, for messages.
        threads: over which trajectories are shared out.

    Returns:
        (k, d, d), or (k, N, d, d) if eps, u or start has N.
    """
    if u.formula is not None:
        states, move = driven_loop(step, start, u.formula.scaled(eps), grid.spans, threads=threads)
    else:
        states, move = _sampled(step, grid, u, eps, start, name, threads)
    kept = states[..., grid.at, :, :]
    return (kept if kept.ndim == 3 else np.ascontiguousarray(np.moveaxis(kept, 0, 1))), move


def _sampled(
    step: Compiled[Any], grid: Grid, u: Signal, eps: Array, start: Array, name: str, threads: int
) -> tuple[Array, float]:
    many = start.ndim == 3 or eps.ndim == 1
    current = start if start.ndim == 3 or not many else np.repeat(start[None], len(eps), axis=0)
    block = BLOCK // max(1, eps.size) // grid.parts * grid.parts or grid.parts
    pieces, move = [current[..., None, :, :]], 0.0
    for first in range(0, grid.steps, block):
        last = min(first + block, grid.steps)
        *values, h = sample(u, grid, first, last)
        if not all(np.all(np.isfinite(each)) for each in values):
            raise NotFiniteError(f"simulate({name}): u(t) is NaN or infinite at some t")
        peak = max(float(np.max(h * np.linalg.norm(each, axis=1), initial=0.0)) for each in values)
        move = max(move, peak * float(np.max(np.abs(eps))))
        count = last - first
        if many:
            three = [np.ascontiguousarray(eps[..., None, None] * each).reshape(-1, count, u.dim) for each in values]
            made = step.scan_batch(current, *three, h[None], n=count, every=grid.parts, threads=threads)
        else:
            made = step.scan(current, *(eps * each for each in values), h, n=count, every=grid.parts)
        pieces.append(made[..., 1:, :, :])
        current = np.ascontiguousarray(made[..., -1, :, :])
    return np.concatenate(pieces, axis=-3), move
