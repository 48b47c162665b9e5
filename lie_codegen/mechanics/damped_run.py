"""X' = X hat(xi), J xi' = ad*_xi J xi - D xi + f(t) by an explicit method of order 8 on the entries of X."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from lie_codegen.algebra.brackets import ad_star
from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError
from lie_codegen.groups.matrix_group import MatrixGroup


def damped_run(
    group: MatrixGroup,
    force: Callable[[float], Array],
    inertia: Array,
    damping: Array,
    t: Array,
    xi0: Array,
    tolerance: float,
) -> tuple[Array, Array, float, int]:
    """X and xi at increasing times, from X = I and xi0 at the first of them; a bound of the error, and the steps taken.

    Raises:
        ComputationError: the integration fails.
    """
    from scipy.integrate import solve_ivp

    inverse = np.linalg.inv(inertia)
    kind = complex if group.is_complex else float
    d, size = group.degree, group.degree**2

    def rate(t: float, y: Array) -> Array:
        X, xi = y[:size].reshape(d, d), y[size:].real
        total = ad_star(group.algebra, xi, inertia @ xi) - damping @ xi + force(t)
        return np.concatenate([(X @ group.hat(xi)).ravel(), inverse @ total])

    y = np.concatenate([np.eye(d, dtype=kind).ravel(), xi0])
    inner = np.asarray(getattr(force, "breakpoints", ()), dtype=float)
    stops = np.unique(np.concatenate([t, inner[(inner > t[0]) & (inner < t[-1])]]))
    path, steps = [y], 0
    for a, b in pairwise(stops):
        run = solve_ivp(rate, (a, b), y, method="DOP853", rtol=tolerance, atol=tolerance / 100)
        if not run.success:
            raise ComputationError(f"simulate_driven({group.name}): the integration failed: {run.message}")
        y, steps = run.y[:, -1], steps + len(run.t) - 1
        path.append(y)
    rows = np.array(path)[np.searchsorted(stops, t)]
    # the method's own tolerance is one of each step
    X = rows[:, :size].reshape(len(t), d, d)
    return (
        X,
        np.ascontiguousarray(rows[:, size:].real),
        tolerance * max(1.0, float(np.max(np.abs(rows)))) * steps,
        steps,
    )
