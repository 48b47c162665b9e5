"""Controls -> Plan: the true system is always simulated; a method's own claim is never taken."""

from __future__ import annotations

import time
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.polynomial.legendre import leggauss

from lie_codegen.arrays import Array
from lie_codegen.flow.logarithm import distance
from lie_codegen.flow.simulate import simulate
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.plan import Controls, Facts, Plan, Status
from lie_codegen.steering.task import Task

_NODES, _WEIGHTS = leggauss(10)
_PANELS = 400


def energy(u: Controls, duration: float) -> float:
    """int_0^duration |u|^2 dt by Gauss-Legendre quadrature, split at the breakpoints of u."""
    inner = u.breakpoints[(u.breakpoints > 0) & (u.breakpoints < duration)]
    knots = np.unique(np.concatenate([[0.0], inner, [duration]]))
    parts = max(1, -(-_PANELS // (len(knots) - 1)))
    edges = np.concatenate([np.linspace(a, b, parts, endpoint=False) for a, b in pairwise(knots)])
    widths = np.diff(np.append(edges, duration))
    t = edges[:, None] + widths[:, None] * (1 + _NODES) / 2
    values = np.sum(u(t.ravel()) ** 2, axis=1).reshape(t.shape)
    return float(np.sum(values @ _WEIGHTS * widths / 2))


def simulated_end(group: MatrixGroup, u: Controls, duration: float, accuracy: float = 1e-11) -> Array:
    """(d, d) where the true system ends."""
    end: Array = simulate(group, u, t=[0.0, duration], tolerance=accuracy).X[-1]
    return end


def simulated_plan(
    task: Task,
    method: str,
    u: Controls,
    details: Mapping[str, Any],
    seconds: Mapping[str, float],
    *,
    solved: Status,
    otherwise: Status,
    drift: Array | None = None,
    end: Array | None = None,
    accuracy: float = 1e-11,
) -> Plan:
    """Simulates the true system under u, and the drift if there is one, and reports where it ends.

    Where u is not a velocity the caller has simulated, and says where the true system ends. `accuracy` is of the simulation.
    """
    started = time.perf_counter()
    if end is None:
        end = simulated_end(task.group, u if drift is None else u.plus(drift), task.duration, accuracy)
    error = distance(task.group, task.target, end)
    return Plan(
        group=task.group,
        target=task.target,
        controls=tuple(task.group.labels[i] for i in task.controls),
        duration=task.duration,
        method=method,
        u=u,
        cost=energy(u, task.duration),
        outcome=Facts(
            end,
            error,
            solved if error <= task.tolerance else otherwise,
            details,
            {**seconds, "simulate": time.perf_counter() - started},
        ),
    )
