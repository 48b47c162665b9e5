"""CasADi's Opti with ipopt on the entries of the matrix, as a user writes it first, and as an expert does.

RK4 multiple shooting with piecewise constant controls, targets and obstacles as parameters. Plain: from zero controls, all
entries of the end given. Expert: expanded to SX, as many end conditions as there are dimensions, the straight path as a guess.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import expm

from lie_codegen.benchmarks.steering_cases import INTERVALS, Case, Problem, Solver
from lie_codegen.flow.logarithm import distance
from lie_codegen.flow.second_kind_coordinates import element_coordinates
from lie_codegen.groups.matrix_group import MatrixGroup

_NEAR = 1e-3


def rk4_step(group: MatrixGroup, controls: tuple[int, ...]) -> Any:
    """(X, u, h) -> X after h by one RK4 step of X' = X hat(u), as anybody would write it."""
    import casadi as ca

    d = group.degree
    X, u, h = ca.SX.sym("X", d, d), ca.SX.sym("u", len(controls)), ca.SX.sym("h")
    A: Any = sum((u[k] * ca.DM(np.real(group.basis[i])) for k, i in enumerate(controls)), ca.SX.zeros(d, d))
    k1 = X @ A
    k2 = (X + h / 2 * k1) @ A
    k3 = (X + h / 2 * k2) @ A
    k4 = (X + h * k3) @ A
    return ca.Function("step", [X, u, h], [X + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])


def plain_opti_row(asked: Problem) -> Solver:
    """What a user writes first."""
    return _opti(asked, expert=False)


def expert_opti_row(asked: Problem) -> Solver:
    """What an expert writes."""
    return _opti(asked, expert=True)


def _opti(asked: Problem, *, expert: bool) -> Solver:
    import casadi as ca

    group, controls, N = asked.group, asked.controls, INTERVALS
    d, m = group.degree, len(controls)
    step = rk4_step(group, controls)
    opti: Any = ca.Opti()
    U = opti.variable(m, N)
    states = [opti.variable(d, d) for _ in range(N + 1)]
    target = opti.parameter(d, d)
    duration: Any = 1.0
    if asked.what == "time":
        duration, bound = opti.variable(), opti.parameter()
        opti.subject_to(opti.bounded(1e-3, duration, 20.0))
        opti.subject_to(opti.bounded(-bound, ca.vec(U), bound))
    opti.subject_to(ca.vec(states[0]) == ca.vec(ca.DM.eye(d)))
    for k in range(N):
        opti.subject_to(ca.vec(states[k + 1]) == ca.vec(step(states[k], U[:, k], duration / N)))
    if expert:
        rows = ca.DM(group.coordinate_rows[:, : d * d])
        opti.subject_to(rows @ ca.vec((target @ states[-1] - ca.DM.eye(d)).T) == 0)
    else:
        opti.subject_to(ca.vec(states[-1]) == ca.vec(target))
    obstacle = opti.parameter(7 if asked.what == "cone" else 3)
    for state in states[1:-1]:
        if asked.what == "cone":
            opti.subject_to(obstacle[3:6].T @ state @ obstacle[:3] <= obstacle[6])
        elif asked.what == "disc":
            opti.subject_to(ca.sumsqr(state[:2, 2] - obstacle[:2]) >= obstacle[2] ** 2)
    cost = duration if asked.what == "time" else ca.sumsqr(U) / N
    opti.minimize(cost)
    settings = {"print_level": 0, "sb": "yes", "max_iter": 500}
    opti.solver("ipopt", {"print_time": False, "expand": expert}, settings)

    def solve(case: Case) -> float:
        opti.set_value(target, np.linalg.inv(case.goal) if expert else case.goal)
        x = element_coordinates(group, case.goal) if expert else np.zeros(group.dim)
        if case.obstacle is not None:
            opti.set_value(obstacle, case.obstacle.parameters())
        scale = 1.0
        if case.bound is not None:
            opti.set_value(bound, case.bound)
            scale = max(1.0, float(np.max(np.abs(x))) / case.bound)
            opti.set_initial(duration, scale)
        opti.set_initial(U, np.tile(x[list(controls)][:, None] / scale, (1, N)))
        for k, state in enumerate(states):
            opti.set_initial(state, expm(group.hat(x * k / N)))
        try:
            solution = opti.solve()
        except RuntimeError:
            return float("nan")
        reached = distance(group, case.goal, np.asarray(solution.value(states[-1])))
        return float(solution.value(cost)) if reached < _NEAR else float("nan")

    return solve
