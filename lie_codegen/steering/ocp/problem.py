"""OptimalControlProblem: solved from anywhere, at any parameter, by one compiled solver."""

from __future__ import annotations

import operator
import os
import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.flow.elements import group_element
from lie_codegen.groups.maps.element_pattern import varying_entries
from lie_codegen.runtime.patience import shows_progress
from lie_codegen.steering.ocp.end import end_error
from lie_codegen.steering.ocp.free_duration import best_duration
from lie_codegen.steering.ocp.machine import machine_of
from lie_codegen.steering.ocp.machine_base import EXACT_AT_ONCE, GAUSS_NEWTON, Machine
from lie_codegen.steering.ocp.plan import OptimalPlan
from lie_codegen.steering.ocp.problem_data import Affine, ProblemData
from lie_codegen.steering.ocp.stage_controls import StageControls
from lie_codegen.steering.plan import Status

_STATUS = (Status.SOLVED, Status.ADMISSIBLE, Status.NOT_ADMISSIBLE, Status.DIVERGED)
_SPREAD = 0.3
_PENALTY = 10.0
_OUTER = 25
#: Further starts where none of those asked for is admissible.
_MORE = 8


@dataclass(frozen=True)
class _Search:
    """The options of `solve`."""

    starts: int
    seed: int
    threads: int | None
    tolerance: float
    allowed: float
    iterations: int
    curvature: bool


@dataclass(frozen=True)
class OptimalControlProblem:
    """A problem that `lc.ocp` checked. Its solver is compiled when first used, once for all states and parameters.

    Attributes:
        data: what it is made of.
    """

    data: ProblemData

    def __repr__(self) -> str:
        d = self.data
        parts = [
            f"{d.name}: {d.group.name}, {d.intervals} intervals in {d.duration:g} s",
            f"controls {', '.join(d.inputs.entry_names())}",
            f"states X{''.join(', ' + name for name in d.states.names)}",
            f"parameters {', '.join(d.parameters.names) or 'none'}",
            f"quadrature {d.quadrature}, integrator {d.integrator}",
        ]
        return f"<optimal control problem {'; '.join(parts)}>"

    def machine(self, *, second_order: bool = True) -> Machine:
        """The solver, compiled (or interpreted where there is no compiler) when first asked for."""
        return machine_of(self.data, second_order=second_order)

    @shows_progress
    def solve(
        self,
        X0: ArrayLike | None = None,
        *,
        guess: Any = None,
        starts: int = 1,
        seed: int = 0,
        threads: int | None = None,
        tolerance: float = 1e-10,
        allowed: float = 1e-8,
        iterations: int = 600,
        curvature: bool = True,
        **values: ArrayLike,
    ) -> OptimalPlan:
        """The cheapest admissible solution of several starts.

        Args:
            X0: (d, d) first element of the group, or (n,) coordinates of the second kind; the identity if not given.
            guess: a plan of this problem (its multipliers are taken over), (N, m) or (m,) controls, or a plan of
                `lc.steer`; controls that cost least at the first state if not given. Or a list of plans (None among them for
                those controls), each of which is a start: closed forms, extremals, direct plans.
            starts: first guesses: the guess, and it with seeded normal perturbations. One start finds one local minimum;
                where none is admissible eight more are tried.
            seed: of the perturbations: the same seed gives the same plan.
            threads: over the starts; as many as there are processors if not given.
            tolerance: relative decrease at which an inner loop stops.
            allowed: violation of conditions.
            iterations: most iterations of a start.
            curvature: exact curvature once a step gains less than 1 %; False for Gauss-Newton throughout.
            **values: first states (zero if not given) and parameters by name; a parameter may have a leading axis of N
                or N + 1 stages.

        Raises:
            InputError, ShapeError, NotFiniteError, NotOnGroupError: naming the culprit.
        """
        where = f"{self.data.name}.solve"
        count = _at_least_one(starts, "starts", where)
        _at_least_one(iterations, "iterations", where)
        _at_least_one(1 if threads is None else threads, "threads", where)
        for what, value in (("tolerance", tolerance), ("allowed", allowed)):
            if not (isinstance(value, int | float | np.number) and 0 <= value < np.inf):
                raise InputError(f"{where}: {what} must be a number of at least 0, got {value!r}")
        free = self.data.free_duration
        search = _Search(count, seed, threads, tolerance, allowed, iterations, curvature)
        if free is None:
            x0, rows = self.start(X0, values, where)
            return self._search(x0, rows, guess, search, where)
        first = guess.duration if isinstance(guess, OptimalPlan) else float(np.sqrt(free[0] * free[1]))
        x0, rows = self.start(X0, {**values, "T": first}, where)

        def at(T: float, near: Any) -> OptimalPlan:
            x0[-1] = T
            again = search if near is guess else replace(search, starts=1)
            return self._search(x0, rows, near, again, where)

        return best_duration(at, first, free, guess)

    def _search(self, x0: Array, rows: Array, guess: Any, search: _Search, where: str) -> OptimalPlan:
        """The best of several starts."""
        guesses = _several(guess)
        firsts = [self._guess(each, where) for each in guesses]
        count = max(search.starts, len(guesses))
        machine = self.machine(second_order=search.curvature)
        began = time.perf_counter()

        def run(number: int) -> Array:
            which = number % len(guesses)
            noise = number >= len(guesses)
            space = self._workspace(machine, x0, rows, firsts[which], guesses[which], number if noise else 0, search)
            machine.solve(space, rows, 0.0, search.tolerance, search.allowed, _OUTER, search.iterations)
            return space

        lanes = search.threads if search.threads is not None else os.cpu_count() or 1
        spaces = _in_lanes(run, range(count), lanes if machine.compiled else 1)
        best = min(spaces, key=_rank)
        if _rank(best)[0] > 0:
            # one start may be caught in a corner between conditions: others are tried before it is said that none was found
            spaces += _in_lanes(run, range(count, count + _MORE), lanes if machine.compiled else 1)
            best = min(spaces, key=_rank)
        if int(best["status"][0]) < 3:
            kept = best.copy()
            machine.gains(kept, rows, 0.0)
            best["K"], best["P"], best["v"] = kept["K"], kept["P"], kept["v"]
        tried = np.array([[space["cost"][0], space["violation"][0]] for space in spaces])
        return self.plan(machine, best, rows, tried, time.perf_counter() - began)

    def start(self, X0: ArrayLike | None, values: Mapping[str, ArrayLike], where: str) -> tuple[Array, Array]:
        """The first state as stored, and the rows of the parameters."""
        data = self.data
        X = np.eye(data.group.degree) if X0 is None else X0
        element = group_element(data.group, X, f"{where}: X0")
        if data.free_duration is not None and "T" not in values:
            values = {**values, "T": data.free_duration[0]}
        states = {name: np.zeros(shape) for name, shape in data.states.shapes}
        states.update({name: value for name, value in values.items() if name in states})  # type: ignore[misc]
        rest = {name: value for name, value in values.items() if name not in states}
        z = data.states.rows(states, 1, where)[0]
        rows = data.parameters.rows(rest, data.intervals + 1, where)
        return np.concatenate([pack_element(data, element), z]), np.ascontiguousarray(rows)

    def _guess(self, guess: Any, where: str) -> Array | None:
        """(N, m) controls, or None."""
        data = self.data
        shape = (data.intervals, data.inputs.size)
        if guess is None:
            return None
        if isinstance(guess, OptimalPlan):
            guess = np.asarray(guess.u)
        elif callable(getattr(guess, "u", None)):
            guess = self._sampled(guess, where)
        try:
            array = np.asarray(guess, dtype=float)
        except (TypeError, ValueError):
            raise InputError(f"{where}: guess is neither a plan nor controls: {guess!r:.60}") from None
        if array.shape not in (shape, shape[1:]):
            raise ShapeError(f"{where}: guess has shape {array.shape}; controls are {shape}")
        if not np.isfinite(array).all():
            raise NotFiniteError(f"{where}: guess holds NaN or infinity")
        return np.array(np.broadcast_to(array, shape))

    def _sampled(self, plan: Any, where: str) -> Array:
        """Controls of a plan of `lc.steer` in the middle of each interval: its velocities as this problem's controls.

        Raises:
            InputError: xi is no combination of this problem's controls.
        """
        law = self.data.velocity
        if not isinstance(law, Affine):
            raise InputError(
                f"{where}: a plan of steer says velocities; it is a guess only where controls are velocities"
            )
        middles = (np.arange(self.data.intervals) + 0.5) * (plan.duration / self.data.intervals)
        velocities = np.asarray(plan.u(middles), dtype=float) * (plan.duration / self.data.duration)
        return np.asarray((velocities - np.array(law.drift)) @ np.linalg.pinv(np.array(law.columns)).T)

    def _workspace(
        self,
        machine: Machine,
        x0: Array,
        rows: Array,
        first: Array | None,
        guess: Any,
        number: int,
        search: _Search,
    ) -> Array:
        space = machine.workspace()
        space["x"][0, 0] = x0
        space["rho"], space["curvature"] = _PENALTY, int(search.curvature)
        if first is None:
            machine.first_guess(space, rows, 0.0)
        else:
            space["u"][0] = first
        if isinstance(guess, OptimalPlan) and number == 0 and guess.multipliers.shape == space["lambda"][0].shape:
            space["lambda"][0], space["lambda_end"][0] = guess.multipliers, guess.end_multipliers
            space["rho"] = guess.penalty
            space["curvature"] = EXACT_AT_ONCE if search.curvature else GAUSS_NEWTON
        if number:
            noise = np.random.default_rng((search.seed, number)).normal(size=space["u"][0].shape)
            space["u"][0] += _SPREAD * noise
        return space

    def plan(self, machine: Machine, space: Array, rows: Array, tried: Array, seconds: float) -> OptimalPlan:
        """The plan that a workspace holds."""
        data, record = self.data, space[0]
        x = record["x"].copy()
        X, z = unpack_elements(data, x)
        worst = self._worst(machine, int(record["worst"]), int(record["worst_stage"]), float(record["violation"]))
        duration = data.duration if data.free_duration is None else float(z[0, -1])
        return OptimalPlan(
            problem=data,
            t=duration / data.intervals * np.arange(data.intervals + 1),
            X=X,
            z=z,
            u=StageControls(record["u"], duration),
            cost=float(record["cost"]),
            violation=float(record["violation"]),
            worst=worst,
            error=end_error(data, X[-1], z[-1], rows[-1]),
            status=_STATUS[min(int(record["status"]), 3)],
            iterations=int(record["iterations"]),
            sweeps=int(record["sweeps"]),
            gain=record["K"].copy(),
            value_gradient=record["v"].copy(),
            value_hessian=record["P"].copy(),
            multipliers=record["lambda"].copy(),
            end_multipliers=record["lambda_end"].copy(),
            penalty=float(record["rho"]),
            starts=tried,
            parameters=rows,
            quadrature=data.quadrature,
            integrator="exact" if data.is_invariant else data.integrator,
            seconds=seconds,
        )

    def _worst(self, machine: Machine, row: int, stage: int, violation: float) -> tuple[str, int] | None:
        if row < 0 or not violation > 0:
            return None
        return machine.row_names[row], stage


def _several(guess: Any) -> list[Any]:
    """The guesses of a list of plans (None among them for the one that the solver makes), or the one there is."""
    if isinstance(guess, list | tuple) and any(each is None or callable(getattr(each, "u", None)) for each in guess):
        return list(guess)
    return [guess]


def _in_lanes(run: Callable[[int], Array], numbers: Iterable[int], lanes: int) -> list[Array]:
    chosen = list(numbers)
    if lanes == 1 or len(chosen) <= 1:
        return [run(number) for number in chosen]
    with ThreadPoolExecutor(min(lanes, len(chosen))) as pool:
        return list(pool.map(run, chosen))


def _rank(space: Array) -> tuple[int, float]:
    """Admissible ones by cost, the others behind them by violation."""
    status = int(space["status"][0])
    if status <= 1:
        return 0, float(space["cost"][0])
    return status, float(space["violation"][0])


def _at_least_one(value: Any, what: str, where: str) -> int:
    try:
        count = operator.index(value)
    except TypeError:
        count = 0
    if count < 1:
        raise InputError(f"{where}: {what} must be a whole number of at least 1, got {value!r}")
    return count


def pack_element(data: ProblemData, X: Array) -> Array:
    """The varying entries of an element, complex ones as re, im."""
    rows, columns = np.array(varying_entries(data.group)).T
    entries = np.ascontiguousarray(X[rows, columns])
    return entries.astype(complex).view(float) if data.group.is_complex else entries.real.astype(float)


def unpack_elements(data: ProblemData, x: Array) -> tuple[Array, Array]:
    """(k, d, d) elements and (k, q) other states of (k, stored) states."""
    group = data.group
    rows, columns = np.array(varying_entries(group)).T
    size = len(rows) * (2 if group.is_complex else 1)
    entries = np.ascontiguousarray(x[:, :size])
    X = np.tile(np.eye(group.degree, dtype=complex if group.is_complex else float), (len(x), 1, 1))
    X[:, rows, columns] = entries.view(complex) if group.is_complex else entries
    return X, np.ascontiguousarray(x[:, size:])
