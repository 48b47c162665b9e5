"""The solver in numpy, where there is no compiler: the algorithm of templates/ocp_core.h, line by line, more slowly.

The model's functions run in CasADi's interpreter. See the core for why each step is right.
"""

from __future__ import annotations

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.ocp.box_program import box_program
from lie_codegen.steering.ocp.interpreted_loop import InterpretedLoop, better_duration
from lie_codegen.steering.ocp.interpreted_merit import Run
from lie_codegen.steering.ocp.machine_base import EXACT_AT_ONCE

_LOOSE = (1e-3, 1e-4, 1e-5, 1e-7)
_LARGEST_PENALTY, _CLEAN_PENALTY = 1e7, 1e5
_EPSILON = float(np.finfo(float).eps)


class InterpretedMachine(InterpretedLoop):
    """The same methods as the compiled solver's."""

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
            # The first rounds need not be exact, for the multipliers still move.
            loose = max(tolerance, _LOOSE[attempt]) if conditions and attempt < len(_LOOSE) else tolerance
            self._inner(run, loose, most)
            self._violation(run)
            if conditions:
                self._multipliers(run, 1.0)
            met = w["violation"] <= allowed
            finished = bool(met and loose <= tolerance and w["iterations"] < most)
            if finished or w["iterations"] >= most:
                break
            # The penalty grows only while conditions are unmet; near a solution the multipliers alone do the rest.
            if not met:
                w["rho"] = min(10 * w["rho"], _LARGEST_PENALTY)
            # Three rounds in which the largest penalty does not halve the violation: no point near here meets the conditions.
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


def _sought_duration(T: float, P: Array, v: Array, durations: tuple[float, float]) -> float:
    """The same where a plan is sought, far from which the cost may bend downwards: then a large step the way that it falls."""
    if P[-1, -1] > 0:
        return better_duration(T, P, v, np.zeros(len(v)), durations)
    return float(min(max(T * (0.7 if v[-1] > 0 else 1.4), durations[0]), durations[1]) - T)
