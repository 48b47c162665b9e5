"""OptimalControlProblem: solved from anywhere, at any parameter, by one compiled solver."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.door import guard_methods
from lie_codegen.errors import InputError
from lie_codegen.exact.counts import count_between, whole_seed
from lie_codegen.flow.elements import group_element
from lie_codegen.runtime.patience import shows_progress
from lie_codegen.steering.ocp.elements import pack_element, unpack_elements
from lie_codegen.steering.ocp.end import end_error
from lie_codegen.steering.ocp.free_duration import best_duration
from lie_codegen.steering.ocp.machine import machine_of
from lie_codegen.steering.ocp.machine_base import Machine
from lie_codegen.steering.ocp.plan import OptimalPlan
from lie_codegen.steering.ocp.problem_data import ProblemData
from lie_codegen.steering.ocp.search import Options, Search
from lie_codegen.steering.ocp.stage_controls import StageControls
from lie_codegen.steering.plan import Status

_STATUS = (Status.SOLVED, Status.ADMISSIBLE, Status.NOT_ADMISSIBLE, Status.DIVERGED)


@guard_methods
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
        count = count_between(starts, 1, 1_000_000, f"{where}: starts")
        count_between(iterations, 1, 1_000_000_000, f"{where}: iterations")
        count_between(1 if threads is None else threads, 1, 4096, f"{where}: threads")
        for what, value in (("tolerance", tolerance), ("allowed", allowed)):
            if not (isinstance(value, int | float | np.number) and 0 <= value < np.inf):
                raise InputError(f"{where}: {what} must be a number of at least 0, got {value!r}")
        free = self.data.free_duration
        options = Options(count, whole_seed(seed, where), threads, tolerance, allowed, iterations, curvature)
        if free is None:
            return self._best(*self.start(X0, values, where), guess, options, where)
        first = guess.duration if isinstance(guess, OptimalPlan) else float(np.sqrt(free[0] * free[1]))
        x0, rows = self.start(X0, {**values, "T": first}, where)

        found = self._best(x0, rows, guess, replace(options, choose=True), where)
        if found.status is Status.SOLVED:
            return found

        def at(T: float, near: Any) -> OptimalPlan:
            x0[-1] = T
            return self._best(x0, rows, near, options if near is guess else replace(options, starts=1), where)

        return best_duration(at, first, free, guess)

    def _best(self, x0: Array, rows: Array, guess: Any, options: Options, where: str) -> OptimalPlan:
        """The plan of the best start."""
        machine = self.machine(second_order=options.curvature)
        began = time.perf_counter()
        space, tried = Search(self.data, machine, x0, rows, options, where).best(guess)
        return self.plan(machine, space, rows, tried, time.perf_counter() - began)

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
        self._check_elements(rows, where)
        return np.concatenate([pack_element(data, element), z]), np.ascontiguousarray(rows)

    def _check_elements(self, rows: Array, where: str) -> None:
        """What was declared an element of the group is one, at every stage: an end off the group is reached by nothing.

        Raises:
            NotOnGroupError: naming the parameter.
        """
        named = self.data.parameters.split(rows)
        for name in self.data.elements:
            for element in np.unique(named[name], axis=0):
                group_element(self.data.group, element, f"{where}: {name}")

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
