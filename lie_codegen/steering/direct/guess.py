"""The caller's own first controls: a plan, a function of time, samples; they are starts beside the others, never instead of them."""

from __future__ import annotations

from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import NotFiniteError, ShapeError
from lie_codegen.steering.direct.assemble import Manoeuvre
from lie_codegen.steering.path_samples import path_of, path_velocities
from lie_codegen.steering.plan import Plan


def guessed(task: Manoeuvre, guess: Any, pieces: int) -> Array | None:
    """(1, pieces, m) mean controls of the pieces, in the programme's own order of time; None without a guess.

    Raises:
        ShapeError, NotFiniteError: about the guess.
    """
    if guess is None:
        return None
    m, name = task.controls, task.system.group.name
    s = (np.arange(pieces) + 0.5) / pieces
    if isinstance(guess, Plan):
        values = _of_plan(task, guess, s)
    elif callable(guess):
        values = np.array([np.asarray(guess(float(t)), dtype=float) for t in s * task.duration])
    else:
        path = path_of(task.system.group, guess, f"steer({name}): guess")
        values = np.asarray(guess if path is None else _of_path(task, path), dtype=float)
        if values.ndim != 2 or len(values) < 1 or values.shape[1] != m:
            raise ShapeError(
                f"steer({name}): guess has shape {values.shape}; give (k, {m}) controls, a path (k, d, d), or a function of t"
            )
        there = (np.arange(len(values)) + 0.5) / len(values)
        values = np.column_stack([np.interp(s, there, column) for column in values.T])
    if values.shape != (pieces, m):
        raise ShapeError(f"steer({name}): the guess gives {values.shape[1:]} at a time; it must give ({m},)")
    if not np.all(np.isfinite(values)):
        raise NotFiniteError(f"steer({name}): the guess holds NaN or infinity")
    if task.system.right:
        values = values[::-1]
    return np.clip(values, task.low, task.high)[None]


def _of_plan(task: Manoeuvre, plan: Plan, s: Array) -> Array:
    """Its velocities projected on the controls here, slowed down to the duration here."""
    velocities = plan.u(s * plan.duration) * plan.duration / task.duration
    return _projected(task, velocities, s * task.duration)


def _of_path(task: Manoeuvre, X: Array) -> Array:
    """Controls whose velocity is nearest to that of a path at equal times, log(X_k^-1 X_(k+1)) / dt."""
    system, steps = task.system, len(X) - 1
    h = task.duration / steps
    t = (np.arange(steps) + 0.5) * h
    return _projected(task, path_velocities(system.group, X, h, right=system.right) - system.drift.at(t), t)


def _projected(task: Manoeuvre, velocities: Array, t: Array) -> Array:
    directions = task.system.directions_at(t)
    return np.array([np.linalg.lstsq(b.T, v, rcond=None)[0] for b, v in zip(directions, velocities, strict=True)])
