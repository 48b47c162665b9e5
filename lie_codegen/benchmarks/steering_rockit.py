"""rockit: multiple shooting with its RK4 and ipopt, the target a parameter, the straight path as a guess."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import expm

from lie_codegen.benchmarks.steering_cases import INTERVALS, Case, Problem, Solver
from lie_codegen.flow.logarithm import distance
from lie_codegen.flow.second_kind_coordinates import element_coordinates

_NEAR = 1e-3


def rockit_row(asked: Problem) -> Solver:
    """As many end conditions as there are dimensions.

    Raises:
        ImportError: rockit is not installed.
    """
    import casadi as ca
    import rockit  # type: ignore[import-not-found]

    group, controls, N = asked.group, asked.controls, INTERVALS
    d, m = group.degree, len(controls)
    ocp: Any = rockit.Ocp(T=1.0)
    x, u, inverse = ocp.state(d * d), ocp.control(m), ocp.parameter(d, d)
    X = ca.reshape(x, d, d)
    A: Any = sum(u[k] * ca.DM(np.real(group.basis[i])) for k, i in enumerate(controls))
    ocp.set_der(x, ca.vec(X @ A))
    ocp.subject_to(ocp.at_t0(x) == ca.vec(ca.DM.eye(d)))
    rows = ca.DM(group.coordinate_rows[:, : d * d])
    ocp.subject_to(ocp.at_tf(rows @ ca.vec((inverse @ X - ca.DM.eye(d)).T)) == 0)
    ocp.add_objective(ocp.integral(ca.sumsqr(u)))
    ocp.solver(
        "ipopt", {"print_time": False, "expand": True, "ipopt": {"print_level": 0, "sb": "yes", "max_iter": 500}}
    )
    ocp.method(rockit.MultipleShooting(N=N, M=1, intg="rk"))
    ocp.set_value(inverse, np.eye(d))
    _, states = ocp.sample(x, grid="control")
    _, v = ocp.sample(u, grid="control-")
    program = ocp.to_function("steer", [inverse, states, v], [states, v])

    def solve(case: Case) -> float:
        guess = element_coordinates(group, case.goal)
        along = np.array([expm(group.hat(guess * k / N)).T.ravel() for k in range(N + 1)]).T
        try:
            found, controls_found = program(
                np.linalg.inv(case.goal), along, np.tile(guess[list(controls), None], (1, N))
            )
        except RuntimeError:
            return float("nan")
        end = np.asarray(found[:, -1]).reshape(d, d).T
        if distance(group, case.goal, end) > _NEAR:
            return float("nan")
        return float(np.sum(np.asarray(controls_found) ** 2)) / N

    return solve
