"""X' = X hat(xi), J xi' = ad*_xi J xi - D xi + f(t) from rest, by an explicit method of order 8 on the entries of X."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from lie_codegen.algebra.brackets import ad_star
from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError
from lie_codegen.groups.matrix_group import MatrixGroup


def damped_end(
    group: MatrixGroup, force: Callable[[float], Array], inertia: Array, damping: Array, duration: float
) -> tuple[Array, Array]:
    """X and xi at the end.

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

    y = np.concatenate([np.eye(d, dtype=kind).ravel(), np.zeros(group.dim)])
    inner = np.asarray(getattr(force, "breakpoints", ()), dtype=float)
    for a, b in pairwise(np.unique(np.concatenate([[0.0], inner, [duration]]))):
        run = solve_ivp(rate, (a, b), y, method="DOP853", rtol=1e-10, atol=1e-12)
        if not run.success:
            raise ComputationError(f"the integration failed: {run.message}")
        y = run.y[:, -1]
    return y[:size].reshape(d, d), y[size:].real
