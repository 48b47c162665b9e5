"""A sample of the loop in numpy: the plan moved on by one interval, one sweep, one roll-out, and what holds where none is better."""

from __future__ import annotations

from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.ocp.interpreted_merit import Run
from lie_codegen.steering.ocp.interpreted_sweep import InterpretedSweep
from lie_codegen.steering.ocp.machine_base import HELD, INPUT, OK

_FIRST_SHIFT = 0.1
_EPSILON = float(np.finfo(float).eps)


class InterpretedLoop(InterpretedSweep):
    """The samples of a loop."""

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
                change[-1] = d[-1] = better_duration(float(w["x"][0, -1]), swept[2], swept[3], d, durations)
            expected = swept[1] + 256 * _EPSILON * (1 + abs(swept[1])) + float(d @ (swept[3] + swept[2] @ d / 2))
            taken = self._improve(run, expected, measured, change)
            if taken is None:
                status = HELD if attempt == 0 else status
                shift = max(10 * shift, _FIRST_SHIFT)
                w["x_new"][0] = measured
                held = self._forward(run, 0.0)
                if np.isfinite(held):
                    self._take_new(run)
                    continue  # the next sweep, from the plan fed back, tries a shorter step
                w["u"][0] = w["u"][0] + w["K"][0] @ d
                w["x"][0] = measured
                break
            self._take_new(run)
            status = OK
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


def better_duration(T: float, P: Array, v: Array, d: Array, durations: tuple[float, float]) -> float:
    """The change of T at which the quadratic model is least, for a first state that is d away from the plan's."""
    slope, curvature = v[-1] + P[-1, :-1] @ d[:-1], P[-1, -1]
    return float(min(max(T - slope / curvature, durations[0]), durations[1]) - T) if curvature > 0 else 0.0
