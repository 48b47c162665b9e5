"""The solver in numpy, where there is no compiler: the algorithm of templates/ocp_core.h, line by line, more slowly.

The model's functions run in CasADi's interpreter. See the core for why each step is right.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.ocp.box_program import box_program
from lie_codegen.steering.ocp.interpreted_model import InterpretedModel
from lie_codegen.steering.ocp.machine_base import EXACT_AT_ONCE, HELD, INPUT, OK, Machine
from lie_codegen.steering.ocp.model import Model
from lie_codegen.steering.ocp.problem_data import ProblemData

_LOOSE = (1e-3, 1e-4, 1e-5, 1e-7)
_LARGEST_PENALTY, _CLEAN_PENALTY, _FIRST_SHIFT = 1e7, 1e5, 0.1
_EPSILON = float(np.finfo(float).eps)


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


class InterpretedMachine(Machine):
    """The same methods as the compiled solver's."""

    def __init__(self, data: ProblemData, model: Model) -> None:
        super().__init__(data, model.sizes, model.row_names, compiled=False)
        self.model = InterpretedModel(data, model)
        self.low, self.high = np.array(data.lower), np.array(data.upper)
        self.h = data.duration / data.intervals

    # what the merit is made of

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
            at = x if c == 0 else following if c == 1 else self.model.step(x, u, p, self._time(run, k), c * self.h)
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

    # sweeps

    def end_model(self, run: Run) -> tuple[float, Array, Array]:
        N, nx = self.data.intervals, self.sizes.nx
        x, p, t, rho = run.space["x"][N], run.row(N), self._time(run, N), float(run.space["rho"])
        value, v, P = self.model.end_cost_model(x, p, t, nx, exact=run.exact)
        c, C = self.model.end_jacobian(x, p, t, nx)
        lam, below = run.space["lambda_end"][: len(c)], np.arange(len(c)) < self.sizes.end_path
        a = np.where(below, np.maximum(0, lam + rho * c), lam + rho * c)
        value += float(np.sum(np.where(below, (a * a - lam * lam) / (2 * rho), lam * c + rho * c * c / 2)))
        active = C[~below | (a > 0)]
        v, P = v + a @ C, P + rho * active.T @ active
        if run.exact and len(c):
            P = P + self.model.end_hessian(x, p, t, a, nx)
        return value, v, P

    def stage_model(self, run: Run, k: int, P: Array, v: Array) -> tuple[float, Array, Array]:
        nx, m, model = self.sizes.nx, self.sizes.m, self.model
        x, u, p, t = run.space["x"][k], run.space["u"][k], run.row(k), self._time(run, k)
        nv, value = nx + m, 0.0
        Q, q, W, w = np.zeros((nv, nv)), np.zeros(nv), np.zeros((nv, nv)), np.zeros(nv)
        W[:nx, :nx], w[:nx] = P, v
        for c, weight in model.nodes:
            if c == 0:
                cost, g, H = model.cost_model(x, u, p, t, exact=run.exact)
                value, q, Q = value + weight * cost, q + weight * g, Q + weight * H
            elif c == 1:
                ahead = run.space["x"][k + 1]
                cost, g, H = model.cost_model(ahead, u, run.row(k + 1), t + self.h, exact=run.exact)
                value, w, W = value + weight * cost, w + weight * g, W + weight * H
            else:
                middle, J, chain = model.linear_step(x, u, p, t, c * self.h)
                cost, g, H = model.cost_model(middle, u, p, t + c * self.h, exact=run.exact)
                value += weight * cost
                q, Q = q + weight * J.T @ g, Q + weight * J.T @ H @ J
                if run.exact:
                    Q = Q + model.curvature(x, u, p, t, c * self.h, chain, weight * g[:nx])
        _, J, chain = model.linear_step(x, u, p, t, self.h)
        q, Q = q + J.T @ w, Q + J.T @ W @ J
        if run.exact:
            Q = Q + model.curvature(x, u, p, t, self.h, chain, w[:nx])
        g, G = model.path_jacobian(x, u, p, t, nv)
        lam, rho = run.space["lambda"][k][: len(g)], float(run.space["rho"])
        a = np.where(model.given(k), 0, np.maximum(0, lam + rho * g))
        value += float(np.sum(np.where(model.given(k), 0, a * a - lam * lam))) / (2 * rho)
        pressed = G[a > 0]
        q, Q = q + a @ G, Q + rho * pressed.T @ pressed
        if run.exact and len(g):
            Q = Q + model.path_hessian(x, u, p, t, a, nv)
        return value, Q, q

    def _backward(self, run: Run, shift: float) -> tuple[float, float, Array, Array] | None:
        """Gain, merit, Hessian and gradient at the first state; None where a block is not positive definite."""
        space, nx, m = run.space, self.sizes.nx, self.sizes.m
        value, v, P = self.end_model(run)
        gain = 0.0
        for k in range(self.data.intervals - 1, -1, -1):
            cost, Q, q = self.stage_model(run, k, P, v)
            value += cost
            Quu, Qux, qu = Q[nx:, nx:], Q[nx:, :nx], q[nx:]
            u = space["u"][k]
            found = box_program(Quu + shift * np.eye(m), qu, self.low - u, self.high - u)
            if found is None:
                return None
            kappa, free, solve = found
            K = np.zeros((m, nx))
            K[free] = -solve(Qux[free])
            gain -= float(kappa @ (qu + Quu @ kappa / 2))
            v = q[:nx] + K.T @ (qu + Quu @ kappa) + Qux.T @ kappa
            P = Q[:nx, :nx] + Qux.T @ K + K.T @ Qux + K.T @ Quu @ K
            P = (P + P.T) / 2
            space["K"][k], space["kappa"][k] = K, kappa
            if not (np.isfinite(v).all() and np.isfinite(P).all()):
                return None
        return gain, value, P, v

    def _forward(self, run: Run, alpha: float) -> float:
        space, total = run.space, 0.0
        for k in range(self.data.intervals):
            d = self.model.difference(space["x"][k], space["x_new"][k])
            u = space["u"][k] + alpha * space["kappa"][k] + space["K"][k] @ d
            space["u_new"][k] = np.minimum(np.maximum(u, self.low), self.high)
            x, u = space["x_new"][k], space["u_new"][k]
            space["x_new"][k + 1] = self.model.step(x, u, run.row(k), self._time(run, k), self.h)
            total += self._interval_cost(run, k, x, u, space["x_new"][k + 1]) + self._path_terms(run, k, x, u)
            if not np.isfinite(total):
                return float("nan")
        return float(total + self._end_terms(run, space["x_new"][self.data.intervals]))

    def _take_new(self, run: Run) -> None:
        run.space["x"], run.space["u"] = run.space["x_new"].copy(), run.space["u_new"].copy()

    def _iterate(self, run: Run, M: float, shift: float, least: float) -> tuple[int, float, float]:
        for _ in range(21):
            swept = self._backward(run, shift)
            run.space["sweeps"] += 1
            if swept is not None:
                break
            if run.exact:
                run.exact = False
                continue
            shift = max(10 * shift, 1e-6)
        if swept is None:
            return 0, M, shift
        gain, change, durations = swept[0], np.zeros(len(run.space["x"][0])), self.data.free_duration
        if durations is not None and run.space["choose"]:
            P, v = swept[2], swept[3]
            change[-1] = _sought_duration(float(run.space["x"][0, -1]), P, v, durations)
            gain -= float(change[-1] * (v[-1] + change[-1] * P[-1, -1] / 2))
        if gain <= least:
            return 2, M, shift
        for halvings in range(12):
            alpha = 0.5**halvings
            run.space["x_new"][0] = run.space["x"][0] + alpha * change
            trial = self._forward(run, alpha)
            if M - trial >= 1e-4 * alpha * gain:
                self._take_new(run)
                return 1, trial, 0.0 if 0.3 * shift < 1e-5 else 0.3 * shift
        return 0, M, shift

    def _inner(self, run: Run, tolerance: float, most: int) -> None:
        M, shift, failures = self._merit(run), 0.0, 0
        while run.space["iterations"] < most:
            before, size, was_exact = M, 1 + abs(M), run.exact
            done, M, shift = self._iterate(run, M, shift, _EPSILON * size)
            run.space["iterations"] += 1
            if done == 2:
                return
            if done == 0:
                failures += 1
                if failures > 8:
                    return
                shift = max(10 * shift, 1e-3 if run.exact else 1e-6)
                continue
            failures = 0
            curved = bool(run.space["curvature"]) and self.model.second_order
            if before - M < tolerance * size and (was_exact or not curved):
                return
            if before - M < 1e-2 * size and curved:
                run.exact = True

    # the machine

    def solve(
        self, space: Array, rows: Array, t0: float, tolerance: float, allowed: float, outer: int, most: int
    ) -> None:
        with np.errstate(all="ignore"):
            self._solve(Run(space[0], rows, t0), tolerance, allowed, outer, most)

    def _solve(self, run: Run, tolerance: float, allowed: float, outer: int, most: int) -> None:
        w, N = run.space, self.data.intervals
        conditions = self.sizes.path + self.sizes.end_path + self.sizes.end > 0
        run.exact = bool(self.model.second_order and w["curvature"] == EXACT_AT_ONCE)
        w["iterations"] = w["sweeps"] = 0
        w["u"] = np.minimum(np.maximum(w["u"], self.low), self.high)
        for k in range(N):
            w["x"][k + 1] = self.model.step(w["x"][k], w["u"][k], run.row(k), self._time(run, k), self.h)
        if not np.isfinite(w["x"]).all():
            w["status"], w["cost"], w["violation"] = 3, np.inf, np.inf
            return
        finished, last, stuck = False, np.inf, 0
        for attempt in range(outer):
            loose = max(tolerance, _LOOSE[attempt]) if conditions and attempt < len(_LOOSE) else tolerance
            self._inner(run, loose, most)
            self._violation(run)
            if conditions:
                self._multipliers(run, 1.0)
            met = w["violation"] <= allowed
            finished = bool(met and loose <= tolerance and w["iterations"] < most)
            if finished or w["iterations"] >= most:
                break
            if not met:
                w["rho"] = min(10 * w["rho"], _LARGEST_PENALTY)
            stuck = stuck + 1 if not met and w["violation"] > last / 2 and w["rho"] >= _LARGEST_PENALTY else 0
            if stuck == 3:
                break
            last = float(w["violation"])
        w["cost"] = self._merit(run, plain=True)
        if not np.isfinite(w["cost"]):
            w["status"] = 3
        else:
            w["status"] = 2 if not w["violation"] <= allowed else 0 if finished else 1

    def gains(self, space: Array, rows: Array, t0: float) -> float:
        w = space[0]
        run = Run(w, rows, t0, exact=bool(self.model.second_order and w["curvature"]))
        w["rho"] = max(w["rho"], _CLEAN_PENALTY)
        shift = 0.0
        for _ in range(21):
            swept = self._backward(run, shift)
            if swept is not None:
                w["P"], w["v"] = swept[2], swept[3]
                break
            shift = max(10 * shift, 1e-6)
        return shift

    def first_guess(self, space: Array, rows: Array, t0: float) -> None:
        w, nx = space[0], self.sizes.nx
        u = np.minimum(np.maximum(0.0, self.low), self.high)
        for _ in range(10):
            _, g, H = self.model.cost_model(w["x"][0], u, rows[0], t0, exact=False)
            found = box_program(H[nx:, nx:], g[nx:], self.low - u, self.high - u) if np.isfinite(H).all() else None
            if found is None:
                break
            u = u + found[0]
        w["u"] = u

    def advance(self, x: Array, u: Array, p: Array, t: float, h: float, parts: int) -> Array:
        for i in range(parts):
            x = self.model.step(x, u, p, t + i * h / parts, h / parts)
        return x

    def running_cost(self, x: Array, u: Array, p: Array, t: float) -> float:
        return self.model.cost(x, u, p, t)

    def plan_cost(self, space: Array, rows: Array, t0: float) -> float:
        return self._merit(Run(space[0], rows, t0), plain=True)

    def step(self, space: Array, X: Array, z: Array, rows: Array, t0: float, iterations: int, u: Array) -> int:
        with np.errstate(all="ignore"):
            exact = self.data.free_duration is not None and self.model.second_order
            status = self._step(Run(space[0], rows, t0, exact), self.model.packed(X, z), iterations)
        space["status"] = status
        u[:] = np.minimum(np.maximum(np.nan_to_num(self._held_control(space[0])), self.low), self.high)
        return status

    def _step(self, run: Run, measured: Array, iterations: int) -> int:
        w, _N = run.space, self.data.intervals
        fresh = bool(w["fresh"])
        good = bool(np.isfinite(measured).all() and np.isfinite(run.rows).all() and np.isfinite(run.t0))
        w["fresh"] = 0
        if not good:
            if not fresh:
                self._shift_in_time(w)
            return INPUT
        if not fresh:
            self._shift_plan(run)
        durations = self.data.free_duration
        if durations is not None:
            measured[-1] = w["x"][0, -1]  # nobody measures how long it will take
        status, length, shift = OK, 1.0, 0.0 if fresh else float(w["shift"])
        for attempt in range(iterations):
            swept = None
            for _ in range(4):
                swept = self._backward(run, shift)
                if swept is not None:
                    break
                shift = shift if run.exact else max(10 * shift, 1e-6)
                run.exact = False
            if swept is None:
                status = HELD if attempt == 0 else status
                break
            d = self.model.difference(w["x"][0], measured)
            change = np.zeros(len(measured))
            if durations is not None:
                change[-1] = d[-1] = _better_duration(float(w["x"][0, -1]), swept[2], swept[3], d, durations)
            expected = swept[1] + 256 * _EPSILON * (1 + abs(swept[1])) + float(d @ (swept[3] + swept[2] @ d / 2))
            taken = self._improve(run, expected, measured, change)
            if taken is None:
                status = HELD if attempt == 0 else status
                shift = max(10 * shift, _FIRST_SHIFT)
                w["x_new"][0] = measured
                held = self._forward(run, 0.0)
                if np.isfinite(held):
                    self._take_new(run)
                else:
                    w["u"][0] = w["u"][0] + w["K"][0] @ d
                    w["x"][0] = measured
                break
            self._take_new(run)
            measured = measured + taken * change
            length, shift = taken, 0.0 if 0.3 * shift < 1e-5 else 0.3 * shift
        w["shift"] = shift
        if status == OK:
            self._multipliers(run, length)
            self._violation(run)
        return status

    def _improve(self, run: Run, reference: float, measured: Array, change: Array) -> float | None:
        """The length of a step whose roll-out, then in x_new and u_new, does as well as the plan fed back; None if none does."""

        def tried(alpha: float) -> float:
            run.space["x_new"][0] = measured + alpha * change
            return self._forward(run, alpha)

        full = tried(1.0)
        if np.isfinite(full) and full <= reference:
            return 1.0
        held = tried(0.0)
        held += 256 * _EPSILON * (1 + abs(held))
        if not np.isfinite(held) or full <= held:
            return 1.0 if np.isfinite(full) and np.isfinite(tried(1.0)) else None
        return next((alpha for alpha in (0.5, 0.25, 0.125) if tried(alpha) <= held), None)

    def _shift_in_time(self, w: Any) -> None:
        N, durations = self.data.intervals, self.data.free_duration
        if durations is None:
            w["x"][:N], w["u"][: N - 1] = w["x"][1:].copy(), w["u"][1:].copy()
            return
        T, sample = float(w["x"][0, -1]), float(w["sample"])
        left = min(max(T - sample, durations[0]), durations[1])
        taken = np.minimum((sample + (np.arange(N) + 0.5) * left / N) / T * N, N - 1).astype(int)
        for name in ("x", "u", "lambda"):
            w[name][:N] = w[name][taken].copy()
        w["x"][:, -1] = left

    def _shift_plan(self, run: Run) -> None:
        w, N = run.space, self.data.intervals
        if self.data.free_duration is None:
            self._shift_in_time(w)
            w["lambda"][: N - 1] = w["lambda"][1:].copy()
            last = (w["x"][N - 1], w["u"][N - 1], run.row(N - 1), self._time(run, N - 1))
            w["x"][N] = self.model.step(*last, self.h)
            return
        at, rest = w["x"][0].copy(), float(w["sample"]) / float(w["x"][0, -1])
        for k in range(N):
            if rest <= 0:
                break
            at = self.model.step(at, w["u"][k], run.row(k), self._time(run, k), min(rest, self.h))
            rest -= self.h
        self._shift_in_time(w)
        w["x"][0, :-1] = at[:-1]
        for k in range(N):
            w["x"][k + 1] = self.model.step(w["x"][k], w["u"][k], run.row(k), self._time(run, k), self.h)

    def _held_control(self, w: Any) -> Array:
        """The mean of the plan's control over a sample."""
        if self.data.free_duration is None:
            return np.array(w["u"][0])
        N, sample = self.data.intervals, float(w["sample"])
        ends = np.append(np.arange(N) * float(w["x"][0, -1]) / N, np.inf)
        held = np.diff(np.minimum(ends, sample))
        return np.asarray(held / sample @ w["u"])


def _better_duration(T: float, P: Array, v: Array, d: Array, durations: tuple[float, float]) -> float:
    """The change of T at which the quadratic model is least, for a first state that is d away from the plan's."""
    slope, curvature = v[-1] + P[-1, :-1] @ d[:-1], P[-1, -1]
    return float(min(max(T - slope / curvature, durations[0]), durations[1]) - T) if curvature > 0 else 0.0


def _sought_duration(T: float, P: Array, v: Array, durations: tuple[float, float]) -> float:
    """The same where a plan is sought, far from which the cost may bend downwards: then a large step the way that it falls."""
    if P[-1, -1] > 0:
        return _better_duration(T, P, v, np.zeros(len(v)), durations)
    return float(min(max(T * (0.7 if v[-1] > 0 else 1.4), durations[0]), durations[1]) - T)
