"""The best of several starts of a problem: first guesses, seeded perturbations of them, and the solver on threads."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.door import on_behalf
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.steering.ocp.machine_base import EXACT_AT_ONCE, GAUSS_NEWTON, Machine
from lie_codegen.steering.ocp.plan import OptimalPlan
from lie_codegen.steering.ocp.problem_data import Affine, ProblemData

_SPREAD = 0.3
_PENALTY = 10.0
_OUTER = 25
#: Further starts where none of those asked for is admissible.
_MORE = 8


@dataclass(frozen=True)
class Options:
    """Those of `solve`; and whether a free duration is chosen with the controls."""

    starts: int
    seed: int
    threads: int | None
    tolerance: float
    allowed: float
    iterations: int
    curvature: bool
    choose: bool = False


class Search:
    """Solutions of one problem from one first state with one set of parameters.

    Attributes:
        data: the problem.
        machine: its solver.
        x0: first state as stored.
        rows: parameters, one row or one a stage.
        options: of the search.
        where: for messages.
    """

    def __init__(
        self, data: ProblemData, machine: Machine, x0: Array, rows: Array, options: Options, where: str
    ) -> None:
        self.data, self.machine, self.x0, self.rows = data, machine, x0, rows
        self.options, self.where = options, where

    def best(self, guess: Any) -> tuple[Array, Array]:
        """The workspace of the best start, with its exact gains, and (starts, 2) cost and violation of all."""
        machine, rows = self.machine, self.rows
        guesses = _several(guess)
        firsts = [self._controls(each) for each in guesses]
        count = max(self.options.starts, len(guesses))
        lanes = self.options.threads if self.options.threads is not None else os.cpu_count() or 1
        lanes = lanes if machine.compiled else 1

        def made(number: int) -> Array:
            which = number % len(guesses)
            return self._workspace(firsts[which], guesses[which], number if number >= len(guesses) else 0)

        spaces = self._solved(map(made, range(count)), lanes)
        best = min(spaces, key=_rank)
        if _rank(best)[0] > 0:
            # one start may be caught in a corner between conditions: others are tried before it is said that none was found
            spaces += self._solved(map(made, range(count, count + _MORE)), lanes)
            best = min(spaces, key=_rank)
        if int(best["status"][0]) < 3:
            kept = best.copy()
            machine.gains(kept, rows, 0.0)
            best["K"], best["P"], best["v"] = kept["K"], kept["P"], kept["v"]
        return best, np.array([[space["cost"][0], space["violation"][0]] for space in spaces])

    def _solved(self, made: Iterable[Array], lanes: int) -> list[Array]:
        """The workspaces, each solved; Ctrl-C ends all of them behind the iteration that they are at."""
        spaces, options = list(made), self.options

        def run(space: Array) -> None:
            self.machine.solve(space, self.rows, 0.0, options.tolerance, options.allowed, _OUTER, options.iterations)

        if not self.machine.compiled or (threading.current_thread() is not threading.main_thread() and lanes == 1):
            for space in spaces:
                run(space)
            return spaces
        run_on_behalf = on_behalf(run)
        # compiled code hears no signal: it runs beside the thread that does, which tells it to stop
        with ThreadPoolExecutor(max(1, min(lanes, len(spaces)))) as pool:
            try:
                # handing out thousands of starts takes a while too: the key may be pressed in the midst of it
                for each in [pool.submit(run_on_behalf, space) for space in spaces]:
                    each.result()
            except BaseException:
                for space in spaces:
                    space["stop"] = 1
                pool.shutdown(wait=False, cancel_futures=True)
                raise
        return spaces

    def _controls(self, guess: Any) -> Array | None:
        """(N, m) controls of a guess, or None."""
        shape = (self.data.intervals, self.data.inputs.size)
        if guess is None:
            return None
        if isinstance(guess, OptimalPlan):
            guess = np.asarray(guess.u)
        elif callable(getattr(guess, "u", None)):
            guess = self._sampled(guess)
        try:
            array = np.asarray(guess, dtype=float)
        except (TypeError, ValueError):
            raise InputError(f"{self.where}: guess is neither a plan nor controls: {guess!r:.60}") from None
        if array.shape not in (shape, shape[1:]):
            raise ShapeError(f"{self.where}: guess has shape {array.shape}; controls are {shape}")
        if not np.isfinite(array).all():
            raise NotFiniteError(f"{self.where}: guess holds NaN or infinity")
        return np.array(np.broadcast_to(array, shape))

    def _sampled(self, plan: Any) -> Array:
        """Controls of a plan of `lc.steer` in the middle of each interval: its velocities as this problem's controls.

        Raises:
            InputError: xi is no combination of this problem's controls.
        """
        law = self.data.velocity
        if not isinstance(law, Affine):
            raise InputError(
                f"{self.where}: a plan of steer says velocities; it is a guess only where controls are velocities"
            )
        middles = (np.arange(self.data.intervals) + 0.5) * (plan.duration / self.data.intervals)
        velocities = np.asarray(plan.u(middles), dtype=float) * (plan.duration / self.data.duration)
        return np.asarray((velocities - np.array(law.drift)) @ np.linalg.pinv(np.array(law.columns)).T)

    def _workspace(self, first: Array | None, guess: Any, number: int) -> Array:
        """A workspace at its first guess, perturbed for a number above 0."""
        curvature = self.options.curvature
        space = self.machine.workspace()
        space["x"][0, 0] = self.x0
        space["choose"] = int(self.options.choose)
        space["rho"], space["curvature"] = _PENALTY, int(curvature)
        if first is None:
            self.machine.first_guess(space, self.rows, 0.0)
        else:
            space["u"][0] = first
        if isinstance(guess, OptimalPlan) and number == 0 and guess.multipliers.shape == space["lambda"][0].shape:
            space["lambda"][0], space["lambda_end"][0] = guess.multipliers, guess.end_multipliers
            space["rho"] = guess.penalty
            space["curvature"] = EXACT_AT_ONCE if curvature else GAUSS_NEWTON
        if number:
            noise = np.random.default_rng((self.options.seed, number)).normal(size=space["u"][0].shape)
            space["u"][0] += _SPREAD * noise
            durations = self.data.free_duration
            if self.options.choose and durations is not None:
                # one start in the middle is not enough: with a drift the durations that reach a goal have gaps
                share = np.random.default_rng((self.options.seed, number, 1)).uniform()
                space["x"][0, 0, -1] = durations[0] * (durations[1] / durations[0]) ** share
        return space


def _several(guess: Any) -> list[Any]:
    """The guesses of a list of plans (None among them for the one that the solver makes), or the one there is."""
    if isinstance(guess, list | tuple) and any(each is None or callable(getattr(each, "u", None)) for each in guess):
        return list(guess)
    return [guess]


def _rank(space: Array) -> tuple[int, float]:
    """Admissible ones by cost, the others behind them by violation."""
    status = int(space["status"][0])
    if status <= 1:
        return 0, float(space["cost"][0])
    return status, float(space["violation"][0])
