"""crocoddyl's FDDP with an action model in Python, derivatives by hand, on the group itself.

State X with X (+) dx = X exp(dx), step X_next = X (+) h u, so that d X_next = Ad_{exp(-h u)} dX + h J_r(h u) du; the end is a
penalty w |log(goal^-1 X)|^2 (FDDP has no end conditions), Gauss-Newton.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import expm

from lie_codegen.arrays import Array
from lie_codegen.benchmarks.steering_cases import INTERVALS, Case, Problem, Solver
from lie_codegen.flow.logarithm import distance
from lie_codegen.flow.second_kind_coordinates import element_coordinates
from lie_codegen.groups.build import build
from lie_codegen.groups.matrix_group import MatrixGroup

_PENALTY = 1e5
_NEAR = 1e-3
_MOST = 300


def crocoddyl_row(asked: Problem) -> Solver:
    """FDDP from the straight path; the group's functions are our compiled kernels, so that Python is all that costs.

    Raises:
        ImportError: crocoddyl is not installed.
    """
    import crocoddyl  # type: ignore[import-not-found]

    group, controls, N = asked.group, list(asked.controls), INTERVALS
    state, moving, arriving = _models(crocoddyl, group, controls)
    running = moving(state)

    def solve(case: Case) -> float:
        x = element_coordinates(group, case.goal)
        terminal = arriving(state, np.linalg.inv(case.goal))
        start = np.eye(group.degree).ravel()
        solver = crocoddyl.SolverFDDP(crocoddyl.ShootingProblem(start, [running] * N, terminal))
        solver.th_stop = 1e-9
        xs = [expm(group.hat(x * k / N)).ravel() for k in range(N + 1)]
        solver.solve(xs, [x[controls] + 0.02] * N, _MOST, False)
        end = np.asarray(solver.xs[-1]).reshape(group.degree, group.degree)
        if distance(group, case.goal, end) > _NEAR:
            return float("nan")
        return float(sum(np.sum(np.asarray(u) ** 2) for u in solver.us)) / N

    return solve


def _models(crocoddyl: Any, group: MatrixGroup, controls: list[int]) -> tuple[Any, Any, Any]:
    """The state and the classes of the running and the terminal model."""
    lib, d, n, m = (
        build(group, kernels=("exp", "log", "Ad", "rjac", "rjac_inv")),
        group.degree,
        group.dim,
        len(controls),
    )
    h = 1.0 / INTERVALS

    class State(crocoddyl.StateAbstract):  # type: ignore[misc]
        def __init__(self) -> None:
            crocoddyl.StateAbstract.__init__(self, d * d, n)

        def zero(self) -> Array:
            return np.eye(d).ravel()

        def rand(self) -> Array:
            return np.asarray(lib.exp(np.random.default_rng(0).normal(size=n))).ravel()

        def diff(self, x0: Array, x1: Array) -> Array:
            return np.asarray(lib.log(np.linalg.solve(x0.reshape(d, d), x1.reshape(d, d))))

        def integrate(self, x: Array, dx: Array) -> Array:
            return np.asarray(x.reshape(d, d) @ lib.exp(np.ascontiguousarray(dx))).ravel()

    class Moving(crocoddyl.ActionModelAbstract):  # type: ignore[misc]
        def __init__(self, state: Any) -> None:
            crocoddyl.ActionModelAbstract.__init__(self, state, m)

        def _twist(self, u: Array) -> Array:
            xi = np.zeros(n)
            xi[controls] = h * u
            return xi

        def calc(self, data: Any, x: Array, u: Array | None = None) -> None:
            if u is not None:
                data.xnext = (x.reshape(d, d) @ lib.exp(self._twist(u))).ravel()
                data.cost = h * float(u @ u)

        def calcDiff(self, data: Any, x: Array, u: Array | None = None) -> None:
            if u is not None:
                xi = self._twist(u)
                data.Fx = lib.Ad(lib.exp(-xi))
                data.Fu = h * np.asarray(lib.rjac(xi))[:, controls]
                data.Lu = 2 * h * u
                data.Luu = 2 * h * np.eye(m)

    class Arriving(crocoddyl.ActionModelAbstract):  # type: ignore[misc]
        def __init__(self, state: Any, inverse: Array) -> None:
            crocoddyl.ActionModelAbstract.__init__(self, state, m)
            self._inverse = inverse

        def calc(self, data: Any, x: Array, u: Array | None = None) -> None:
            miss = lib.log(self._inverse @ x.reshape(d, d))
            data.cost = _PENALTY * float(miss @ miss)

        def calcDiff(self, data: Any, x: Array, u: Array | None = None) -> None:
            miss = lib.log(self._inverse @ x.reshape(d, d))
            slope = np.asarray(lib.rjac_inv(miss))
            data.Lx = 2 * _PENALTY * slope.T @ miss
            data.Lxx = 2 * _PENALTY * slope.T @ slope

    return State(), Moving, Arriving
