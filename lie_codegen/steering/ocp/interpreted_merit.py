"""The merit of a trajectory in numpy: cost, augmented Lagrangian of the conditions, and their violation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.ocp.interpreted_model import InterpretedModel
from lie_codegen.steering.ocp.machine_base import Machine
from lie_codegen.steering.ocp.model_sizes import Model
from lie_codegen.steering.ocp.problem_data import ProblemData


@dataclass
class Run:
    """One solution in progress: its workspace record, parameters, first time, and whether curvature is exact."""

    space: Any
    rows: Array
    t0: float
    exact: bool = False

    def row(self, k: int) -> Array:
        """Parameters of stage k."""
        return np.asarray(self.rows[min(k, len(self.rows) - 1)])


class InterpretedMerit(Machine):
    """What trajectories are compared by."""

    def __init__(self, data: ProblemData, model: Model) -> None:
        super().__init__(data, model.sizes, model.row_names, compiled=False)
        self.model = InterpretedModel(data, model)
        self.low, self.high = np.array(data.lower), np.array(data.upper)
        self.h = data.duration / data.intervals

    def _time(self, run: Run, k: int) -> float:
        return run.t0 + k * self.h

    def _path_terms(self, run: Run, k: int, x: Array, u: Array) -> float:
        g, given = self.model.path(x, u, run.row(k), self._time(run, k)), self.model.given(k)
        lam, rho = run.space["lambda"][k][: len(g)], float(run.space["rho"])
        a = np.maximum(0, lam + rho * g)
        return float(np.sum(np.where(given, 0, a * a - lam * lam))) / (2 * rho)

    def _end_terms(self, run: Run, x: Array) -> float:
        N = self.data.intervals
        value = self.model.end_cost(x, run.row(N), self._time(run, N))
        c, rho = self.model.end(x, run.row(N), self._time(run, N)), float(run.space["rho"])
        lam, below = run.space["lambda_end"][: len(c)], np.arange(len(c)) < self.sizes.end_path
        a = np.maximum(0, lam + rho * c)
        return value + float(np.sum(np.where(below, (a * a - lam * lam) / (2 * rho), lam * c + rho * c * c / 2)))

    def _interval_cost(self, run: Run, k: int, x: Array, u: Array, following: Array) -> float:
        total = 0.0
        for c, weight in self.model.nodes:
            p, t = run.row(k + (c == 1)), self._time(run, k) + c * self.h
            at = x if c == 0 else following
            if 0 < c < 1:
                at = self.model.step(x, u, p, self._time(run, k), self.h, self.model.inner)
            total += weight * self.model.cost(at, u, p, t)
        return total

    def _merit(self, run: Run, *, plain: bool = False) -> float:
        x, u, N = run.space["x"], run.space["u"], self.data.intervals
        end = self.model.end_cost(x[N], run.row(N), self._time(run, N)) if plain else self._end_terms(run, x[N])
        total = end
        for k in range(N):
            total += self._interval_cost(run, k, x[k], u[k], x[k + 1])
            total += 0.0 if plain else self._path_terms(run, k, x[k], u[k])
        return float(total)

    def _violation(self, run: Run) -> None:
        space, N = run.space, self.data.intervals
        worst = (0.0, -1, -1)
        for k in range(N):
            g = self.model.path(space["x"][k], space["u"][k], run.row(k), self._time(run, k))
            for i in np.flatnonzero(~self.model.given(k)):
                if not g[i] <= worst[0]:
                    worst = (float(g[i]), int(i), k)
        c = self.model.end(space["x"][N], run.row(N), self._time(run, N))
        for row, value in enumerate(c):
            off = float(value if row < self.sizes.end_path else abs(value))
            if not off <= worst[0]:
                worst = (off, self.sizes.path + row, N)
        space["violation"], space["worst"], space["worst_stage"] = worst

    def _multipliers(self, run: Run, share: float) -> None:
        space, N = run.space, self.data.intervals
        rho = float(space["rho"])
        for k in range(N):
            g = self.model.path(space["x"][k], space["u"][k], run.row(k), self._time(run, k))
            moved = np.maximum(0, space["lambda"][k][: len(g)] + rho * g)
            lam = space["lambda"][k][: len(g)]
            lam += share * (np.where(self.model.given(k), 0, moved) - lam)
        c = self.model.end(space["x"][N], run.row(N), self._time(run, N))
        moved = space["lambda_end"][: len(c)] + rho * c
        below = np.arange(len(c)) < self.sizes.end_path
        lam = space["lambda_end"][: len(c)]
        lam += share * (np.where(below, np.maximum(0, moved), moved) - lam)
