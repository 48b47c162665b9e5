"""X' = X hat(eps u(t, X)) for a Python function, or without a compiler: the pair 8(5,3) in Python."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError, ShapeError
from lie_codegen.flow.product_rate import reach_of, turning
from lie_codegen.groups.build import library_of
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.wei_norman.body import rate as wei_norman_rate
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.runtime import ode_numpy


def interpreted(
    group: MatrixGroup, function: Callable[..., Any], reads: str, times: Array, eps: Array, X0: Array, g0: Array,
    rtol: float, atol: float, where: str,
) -> tuple[Array, Array, Array, int, float, int]:  # fmt: skip
    """The same pair in Python; the error is the difference to a run with local errors eight times as large."""
    runs = [
        [_alone(group, function, reads, times, float(e), X, g, rtol / part, atol / part, where) for e, X, g in zip(eps, X0, g0, strict=True)]
        for part in (1, 8)
    ]  # fmt: skip
    coarse, fine = (np.stack([each[0] for each in run], axis=1) for run in runs)
    g, u = (np.stack([each[place] for each in runs[1]], axis=1) for place in (1, 2))
    steps = sum(each[3] for each in runs[1])
    evaluations = sum(each[4] for run in runs for each in run)
    return fine, g, u, steps, 2 * float(np.max(np.abs(fine - coarse))) / 7, evaluations


def _alone(
    group: MatrixGroup, function: Callable[..., Any], reads: str, times: Array, eps: float, X0: Array, g0: Array,
    rtol: float, atol: float, where: str,
) -> tuple[Array, Array, Array, int, int]:  # fmt: skip
    n, ops, data = group.dim, FloatArithmetic(), derivation_of(group).wei_norman
    exp, reach = library_of(group).exp, min(1.0, reach_of(group, closed=True)) / 2
    scale = np.full(n + len(g0), max(atol, rtol * 1e-3))

    def value(t: float, X: Array, g: Array) -> Array:
        u = np.asarray(function(t, X if reads == "X" else g), dtype=float)
        if u.shape != (n,):
            raise ShapeError(f"{where}: u(t, {reads}) has shape {u.shape}; give ({n},)")
        return u

    def rate(t: float, y: Array) -> Array:
        X = X_here @ exp(y[:n])
        xi = (eps * value(t, X, y[n:])).tolist()
        turn = turning(ops, group, y[:n].tolist(), xi)
        return np.array([*turn, *(wei_norman_rate(ops, data, y[n:].tolist(), xi) if len(g0) else [])], dtype=float)

    X_here, g = np.array(X0), np.array(g0)
    path, chart = [X_here], [g]
    steps, calls, t = 0, 0, float(times[0])
    for stop in times[1:]:
        length = float(stop) - t
        while t < stop:
            end = min(float(stop), t + length)
            end = float(stop) if stop - end < 1e-12 * abs(stop - times[0]) else end
            knots, states, status, _, count = ode_numpy.run(
                rate, np.concatenate([np.zeros(n), g]), t, end, rtol, scale, None, (), end - t
            )
            calls += count
            if status == 3 or not np.all(np.isfinite(states[-1])):
                raise ComputationError(f"{where}: no step is short enough at t = {knots[-1]:.9g}; is u smooth there?")
            if np.linalg.norm(states[-1][:n]) > reach:  # too far from where the series of Theta' holds: half as far
                length = (end - t) / 2
                continue
            steps += len(knots) - 1
            X_here, g, t = X_here @ exp(states[-1][:n]), states[-1][n:], end
        path.append(X_here)
        chart.append(g)
    u = np.array([value(float(s), X, c) for s, X, c in zip(times, path, chart, strict=True)])
    return np.array(path), np.array(chart), u, steps, calls
