"""scipy's SLSQP on piecewise constant controls, with CasADi's gradients."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import minimize

from lie_codegen.benchmarks.steering_cases import INTERVALS, Case, Problem, Solver
from lie_codegen.benchmarks.steering_opti import rk4_step
from lie_codegen.flow.second_kind_coordinates import element_coordinates

_REACHED = 1e-5


def slsqp_row(asked: Problem) -> Solver:
    """Single shooting; from the straight path with a little noise, for zero controls are a saddle."""
    import casadi as ca

    group, controls, N = asked.group, asked.controls, INTERVALS
    d, m = group.degree, len(controls)
    step = rk4_step(group, controls)
    U, target = ca.SX.sym("U", m, N), ca.SX.sym("T", d, d)
    X: Any = ca.SX.eye(d)
    for k in range(N):
        X = step(X, U[:, k], 1.0 / N)
    rows = ca.DM(group.coordinate_rows[:, : d * d])
    miss = rows @ ca.vec((target @ X - ca.SX.eye(d)).T)
    gap = ca.Function("gap", [ca.vec(U), target], [miss])
    slope = ca.Function("slope", [ca.vec(U), target], [ca.jacobian(miss, ca.vec(U))])

    def solve(case: Case) -> float:
        x = element_coordinates(group, case.goal)
        inverse = np.linalg.inv(case.goal)
        start = np.tile(x[list(controls)], N) + 0.1 * np.random.default_rng(1).normal(size=m * N)
        result = minimize(
            lambda u: (float(u @ u) / N, 2 * u / N),
            start,
            jac=True,
            method="SLSQP",
            constraints=[
                {
                    "type": "eq",
                    "fun": lambda u: np.asarray(gap(u, inverse)).ravel(),
                    "jac": lambda u: np.asarray(slope(u, inverse)),
                }
            ],
            options={"maxiter": 300, "ftol": 1e-9},
        )
        reached = float(np.max(np.abs(np.asarray(gap(result.x, inverse)))))
        return float(result.fun) if reached < _REACHED else float("nan")

    return solve
