"""The same minimum-energy tasks by our solver and by what a user would pick instead, interleaved in one process.

    python -m lie_codegen.studies.bench_steering so3 20

Peers: plain CasADi Opti with ipopt on the matrix entries (RK4 multiple shooting, N = 50, parametric, zero guess), the same by an
expert (expanded to SX, minimal end conditions, the straight path as a guess), scipy's SLSQP on piecewise-constant controls with
CasADi's gradients. Costs are compared with ours, medians over the targets all of them solved.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import minimize

from lie_codegen.groups.catalogue_load import group as load
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.simulation.metric import distance, element_coordinates
from lie_codegen.steering.shooting import shooter
from lie_codegen.steering.task import make_task
from lie_codegen.steering.transcription import transcription

Array = NDArray[Any]

SYSTEMS = {"h3": (0, 1), "se2": (0, 1), "so3": (0, 1), "se3": (0, 1, 2, 3)}
_N = 50
_REACHED = 1e-5


@dataclass(frozen=True)
class Row:
    """One solver over all targets.

    Attributes:
        solver: its name.
        median_ms: over all targets.
        solved: share of targets reached to 1e-5 by its own discretisation.
        cost_over_ours: median ratio of energies over the targets it solved.
        global_share: share of targets within 0.1 % (1 % for discretised controls) of the best of all solvers.
        times_ours: median time over ours.
    """

    solver: str
    median_ms: float
    solved: float
    cost_over_ours: float
    global_share: float
    times_ours: float


def bench_steering(name: str, targets: int = 20, seed: int = 0) -> list[Row]:
    """One row a solver, ours first."""
    group, controls = load(name), SYSTEMS[name]
    rng = np.random.default_rng(seed)
    goals = [expm(group.hat(rng.uniform(-1, 1, group.dim))) for _ in range(targets)]
    solvers = {
        "shooting in C": _shooting(group, controls),
        "transcription": _transcription(group, controls),
        "Opti + ipopt, plain": _opti(group, controls, expert=False),
        "Opti + ipopt, expert": _opti(group, controls, expert=True),
        "scipy SLSQP, CasADi gradients": _slsqp(group, controls),
    }
    for solve in solvers.values():
        solve(goals[0])
    seconds: dict[str, list[float]] = {solver: [] for solver in solvers}
    costs: dict[str, list[float]] = {solver: [] for solver in solvers}
    for goal in goals:
        for solver, solve in solvers.items():
            started = time.perf_counter()
            cost = solve(goal)
            seconds[solver].append(time.perf_counter() - started)
            costs[solver].append(cost)
    table = np.array([costs[solver] for solver in solvers])
    best = np.nanmin(table, axis=0)
    ours = float(np.median(seconds["shooting in C"]))
    rows = []
    for solver, values in zip(solvers, table, strict=True):
        good = np.isfinite(values)
        slack = 1.001 if solver in ("shooting in C", "transcription") else 1.01
        rows.append(
            Row(
                solver,
                1e3 * float(np.median(seconds[solver])),
                float(np.mean(good)),
                float(np.median(values[good] / table[0][good])) if np.any(good) else float("nan"),
                float(np.mean(np.where(good, values, np.inf) <= slack * best)),
                float(np.median(seconds[solver])) / ours,
            )
        )
    return rows


def _shooting(group: MatrixGroup, controls: Sequence[int]) -> Callable[[Array], float]:
    solver = shooter(group, tuple(controls))

    def solve(goal: Array) -> float:
        found = solver.solve(goal)
        return float(found.cost[0]) if found.status[0] == 1 else float("nan")

    return solve


def _transcription(group: MatrixGroup, controls: Sequence[int]) -> Callable[[Array], float]:
    def solve(goal: Array) -> float:
        task = make_task(group, goal, controls, 1.0, 1e-6)
        return transcription(task, intervals=_N, starts=1, solver="fatrop").cost

    return solve


def _step(group: MatrixGroup, controls: Sequence[int]) -> Any:
    """(X, u) -> X after 1/N by one RK4 step of X' = X hat(u), as anybody would write it."""
    import casadi as ca

    d = group.degree
    X, u = ca.SX.sym("X", d, d), ca.SX.sym("u", len(controls))
    A: Any = sum((u[k] * ca.DM(np.real(group.basis[i])) for k, i in enumerate(controls)), ca.SX.zeros(d, d))
    h = 1.0 / _N
    k1 = X @ A
    k2 = (X + h / 2 * k1) @ A
    k3 = (X + h / 2 * k2) @ A
    k4 = (X + h * k3) @ A
    return ca.Function("step", [X, u], [X + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])


def _opti(group: MatrixGroup, controls: Sequence[int], *, expert: bool) -> Callable[[Array], float]:
    import casadi as ca

    d, m = group.degree, len(controls)
    step = _step(group, controls)
    opti: Any = ca.Opti()
    U = opti.variable(m, _N)
    states = [opti.variable(d, d) for _ in range(_N + 1)]
    target = opti.parameter(d, d)
    opti.subject_to(ca.vec(states[0]) == ca.vec(ca.DM.eye(d)))
    for k in range(_N):
        opti.subject_to(ca.vec(states[k + 1]) == ca.vec(step(states[k], U[:, k])))
    if expert:
        relative = target @ states[-1] - ca.DM.eye(d)
        rows = ca.DM(group.coordinate_rows[:, : d * d])
        opti.subject_to(rows @ ca.vec(relative.T) == 0)
    else:
        opti.subject_to(ca.vec(states[-1]) == ca.vec(target))
    opti.minimize(ca.sumsqr(U) / _N)
    settings = {"print_level": 0, "sb": "yes", "max_iter": 500}
    opti.solver("ipopt", {"print_time": False, "expand": expert}, settings)

    def solve(goal: Array) -> float:
        opti.set_value(target, np.linalg.inv(goal) if expert else goal)
        x = element_coordinates(group, goal) if expert else np.zeros(group.dim)
        opti.set_initial(U, np.tile(x[list(controls)][:, None], (1, _N)))
        for k, state in enumerate(states):
            opti.set_initial(state, expm(group.hat(x * k / _N)))
        try:
            solution = opti.solve()
        except RuntimeError:
            return float("nan")
        reached = distance(group, goal, np.asarray(solution.value(states[-1])))
        return float(solution.value(ca.sumsqr(U) / _N)) if reached < 1e-3 else float("nan")

    return solve


def _slsqp(group: MatrixGroup, controls: Sequence[int]) -> Callable[[Array], float]:
    import casadi as ca

    d, m = group.degree, len(controls)
    step = _step(group, controls)
    U = ca.SX.sym("U", m, _N)
    target = ca.SX.sym("T", d, d)
    X: Any = ca.SX.eye(d)
    for k in range(_N):
        X = step(X, U[:, k])
    rows = ca.DM(group.coordinate_rows[:, : d * d])
    miss = rows @ ca.vec((target @ X - ca.SX.eye(d)).T)
    gap = ca.Function("gap", [ca.vec(U), target], [miss])
    slope = ca.Function("slope", [ca.vec(U), target], [ca.jacobian(miss, ca.vec(U))])

    def solve(goal: Array) -> float:
        x = element_coordinates(group, goal)
        inverse = np.linalg.inv(goal)
        rng = np.random.default_rng(1)
        start = np.tile(x[list(controls)], _N) + 0.1 * rng.normal(size=m * _N)
        constraint = {
            "type": "eq",
            "fun": lambda u: np.asarray(gap(u, inverse)).ravel(),
            "jac": lambda u: np.asarray(slope(u, inverse)),
        }
        result = minimize(
            lambda u: (float(u @ u) / _N, 2 * u / _N),
            start,
            jac=True,
            method="SLSQP",
            constraints=[constraint],
            options={"maxiter": 300, "ftol": 1e-9},
        )
        reached = np.max(np.abs(constraint["fun"](result.x)))  # type: ignore[operator]
        return float(result.fun) if reached < _REACHED else float("nan")

    return solve


def main(arguments: Sequence[str]) -> None:
    """Prints one JSON object a row."""
    name = arguments[0] if arguments else "so3"
    count = int(arguments[1]) if len(arguments) > 1 else 20
    for row in bench_steering(name, count):
        sys.stdout.write(json.dumps(row.__dict__) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
