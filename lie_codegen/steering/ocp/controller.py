"""The controller of lc.mpc: what it holds between two samples, a sample, and its loop and package."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.door import guard_methods
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.counts import count_between
from lie_codegen.steering.ocp.elements import pack_element
from lie_codegen.steering.ocp.loop import LoopRun, run_loop
from lie_codegen.steering.ocp.machine import CompiledMachine, loop_machine
from lie_codegen.steering.ocp.machine_base import HELD, INPUT, OK
from lie_codegen.steering.ocp.plan import OptimalPlan
from lie_codegen.steering.ocp.problem import OptimalControlProblem

if TYPE_CHECKING:
    from lie_codegen.steering.ocp.machine_base import Machine

_STATUS = {OK: "ok", HELD: "held", INPUT: "input"}


@guard_methods
class ModelPredictiveControl:
    """The controller. One object is one loop: give each thread its own.

    Attributes:
        problem, iterations, penalty, sample: what it was made of.
        status: of the last step: "ok"; "held" (no trial did better: the plan's own control, fed back); "input" (a number
            that is none was given: the plan's own control); "reset" before the first step.
    """

    def __init__(self, problem: OptimalControlProblem, iterations: int, penalty: float, sample: float) -> None:
        data = problem.data
        self.problem = problem
        self.iterations = iterations
        self.penalty = penalty
        self.sample = sample
        self.status = "not reset"
        self._is_free = data.free_duration is not None
        self._started: OptimalPlan | None = None
        self._machine: Machine = loop_machine(data)
        self._space = self._machine.workspace()
        kind = complex if data.group.is_complex else float
        self._X = np.zeros((data.group.degree, data.group.degree), kind)
        self._z = np.zeros(max(1, data.states.size))
        self._u = np.zeros(data.inputs.size)
        self._records = np.zeros(data.intervals + 1, _row_type(data.parameters.shapes))
        self._rows = self._records.view(float).reshape(data.intervals + 1, -1)
        self._good = self._rows.copy()
        self._states = {
            name: (self._z[place].reshape(shape), shape)
            for name, (place, shape) in data.states.slices().items()
            if name != "T" or not self._is_free
        }
        self._parameters = {name: (self._records[name], shape[:2]) for name, shape in data.parameters.shapes}
        self._t = 0.0
        self._call = self._bound_call()

    def __repr__(self) -> str:
        return f"<mpc of {self.problem.data.name}: {self.iterations} iteration(s) a sample, status {self.status}>"

    def reset(self, plan: OptimalPlan | None = None, X0: ArrayLike | None = None, **values: Any) -> OptimalPlan:
        """Starts from a plan of this problem, or from one solved here from X0, states and parameters.

        Raises:
            InputError, ShapeError, NotFiniteError, NotOnGroupError: as `solve`; a plan of another problem.
        """
        if plan is None:
            plan = self.problem.solve(X0, **values)
        elif not isinstance(plan, OptimalPlan) or plan.problem != self.problem.data:
            raise InputError(f"mpc({self.problem.data.name}).reset: expected a plan of this problem, got {plan!r:.60}")
        elif X0 is not None or values:
            raise InputError(f"mpc({self.problem.data.name}).reset: give a plan, or X0 with states and parameters")
        space = self._space[0]
        space["x"] = [
            np.concatenate([pack_element(self.problem.data, X), z]) for X, z in zip(plan.X, plan.z, strict=True)
        ]
        space["u"], space["K"] = plan.u, plan.gain
        space["lambda"], space["lambda_end"] = plan.multipliers, plan.end_multipliers
        space["rho"], space["fresh"], space["curvature"] = self.penalty, 1, 0
        space["violation"], space["worst"], space["sample"] = plan.violation, -1, self.sample
        if plan.parameters.shape[1]:
            self._rows[...] = plan.parameters
        self._good[...] = self._rows
        self._t = 0.0
        self._started = plan
        self.status = "reset"
        return plan

    def step(self, X: Any = None, *, t: float | None = None, **values: Any) -> Array:
        """(m,) the control for the measured state.

        Args:
            X: (d, d) measured element; the identity if not given. Numbers that are none are met with the plan's own
                control and status "input".
            t: time of the sample; one sample after the last if not given.
            **values: every state by name, and the parameters that changed, constant or with a row a stage.

        Raises:
            InputError: before `reset`, a state that is missing, or an unknown name.
            ShapeError: naming the culprit.
        """
        if self.status == "not reset":
            raise InputError(f"mpc({self.problem.data.name}).step: reset it with a plan first")
        given, changed = 0, False
        try:
            self._X[...] = np.eye(len(self._X)) if X is None else X
        except (TypeError, ValueError):
            raise ShapeError(f"{self._where()}: X has shape {np.shape(X)}; it is {self._X.shape}") from None
        for name, value in values.items():
            if name in self._states:
                place, shape = self._states[name]
                given += 1
            elif name in self._parameters:
                place, shape = self._parameters[name]
                changed = True
            else:
                known = ", ".join([*self._states, *self._parameters])
                raise InputError(f"{self._where()}: no state or parameter {name!r}; there are {known or 'none'}")
            self._assign(name, place, shape, value)
        if given < len(self._states):
            missing = [name for name in self._states if name not in values]
            raise InputError(f"{self._where()}: no value for the state {', '.join(missing)}")
        now = self._t if t is None else float(t)
        status = self._call(0.0 if self._is_free else now)
        # a time that is no number is forgotten, as every other: the next sample is one later than this one should have been
        self._t = (now if np.isfinite(now) else self._t) + self.sample
        self.status = _STATUS[status]
        if changed:
            # what was no number is not kept for the next sample
            if status == INPUT:
                self._rows[...] = self._good
            else:
                self._good[...] = self._rows
        return self._u.copy()

    @property
    def violation(self) -> float:
        """Of the worst condition along the plan."""
        return float(self._space["violation"][0])

    def parameters_now(self) -> Array:
        """(numbers,) the parameters of the first stage, as last told."""
        return np.array(self._rows[0, : self.problem.data.parameters.size])

    @property
    def duration(self) -> float:
        """Seconds of the plan as it stands: what is left of a free duration."""
        return float(self._space["x"][0, 0, -1]) if self._is_free else self.problem.data.duration

    @property
    def plan(self) -> OptimalPlan:
        """The plan as it stands, from the last measurement on; its gains are those of the last sweep (Gauss-Newton)."""
        space = self._space.copy()
        rows = self._rows if self.problem.data.parameters.size else np.zeros((1, 0))
        started = 0.0 if self._is_free else self._t - self.sample
        space["cost"] = self._machine.plan_cost(space, rows, started)
        admissible = self.violation <= 1e-8
        space["status"] = 1 if admissible else 2
        tried = np.array([[space["cost"][0], space["violation"][0]]])
        return self.problem.plan(self._machine, space, rows.copy(), tried, 0.0)

    def simulate(
        self,
        X0: ArrayLike | None = None,
        *,
        steps: int | None = None,
        duration: float | None = None,
        values: Mapping[str, Any] | None = None,
        plant: Any = None,
        plant_values: Mapping[str, Any] | None = None,
        noise: Any = 0.0,
        delay: int = 0,
        compensate: bool = True,
        substeps: int = 4,
        seed: int = 0,
        runs: int | None = None,
    ) -> Any:
        """The closed loop for a number of steps, or for a duration: a LoopRun; with `runs` a tuple of them, of seeds in turn.

        Each run starts from the plan that this controller holds, which is left as it is. See
        `lie_codegen.steering.ocp.loop.run_loop` for the rest.

        Raises:
            InputError, ShapeError, NotFiniteError, NotOnGroupError: naming the culprit.
        """
        if (steps is None) == (duration is None):
            raise InputError(f"closed loop of {self.problem.data.name}: give steps or a duration")
        count = steps if steps is not None else max(1, round(float(duration or 0.0) / self.sample))

        def run(number: int) -> LoopRun:
            return run_loop(
                copy.copy(self), X0, steps=count, values=values or {}, plant=plant, plant_values=plant_values or {},
                noise=noise, delay=delay, compensate=compensate, substeps=substeps, seed=number,
            )  # fmt: skip

        if runs is None:
            return run(seed)
        many = count_between(runs, 1, 1_000_000, f"closed loop of {self.problem.data.name}: runs")
        return tuple(run(seed + i) for i in range(many))

    def render_package(self, real: str = "double") -> dict[str, str]:
        """The C package that `lc.generate(mpc, folder)` writes: {path: text}; its example starts from the plan of `reset`.

        Raises:
            InputError: before `reset`.
            CodegenError: no such real type, or a constant beyond float's range.
        """
        from lie_codegen.steering.ocp.package import render_mpc_package

        if self._started is None:
            raise InputError(
                f"generate: reset the mpc of {self.problem.data.name} with a plan first: its example needs one"
            )
        return render_mpc_package(
            self._started, iterations=self.iterations, penalty=self.penalty, sample=self.sample, real=real
        )

    def __getstate__(self) -> dict[str, Any]:
        """A copy in another process is made anew, and put where this one stands."""
        return {
            "problem": self.problem,
            "settings": (self.iterations, self.penalty, self.sample),
            "space": self._space.copy(),
            "rows": self._rows.copy(),
            "t": self._t,
            "status": self.status,
            "started": self._started,
        }

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        self.__init__(state["problem"], *state["settings"])  # type: ignore[misc]
        self._space[...], self._rows[...], self._good[...] = state["space"], state["rows"], state["rows"]
        self._t, self.status, self._started = state["t"], state["status"], state["started"]

    def _assign(self, name: str, place: Array, shape: tuple[int, ...], value: ArrayLike) -> None:
        array = np.asarray(value)
        if array.shape == shape or (array.shape == () and shape == (1,)):
            place[...] = array
            return
        N = len(self._rows) - 1
        if name in self._parameters and array.shape[1:] == shape and len(array) in (N, N + 1):
            place[: len(array)] = array
            place[len(array) :] = array[-1]
            return
        raise ShapeError(f"{self._where()}: {name} has shape {array.shape}; it is {shape}")

    def _where(self) -> str:
        return f"mpc({self.problem.data.name}).step"

    def _bound_call(self) -> Callable[[float], int]:
        """The step with every address at hand; asking numpy for them costs more than the call."""
        machine, stride = self._machine, self._rows.shape[1]
        if not isinstance(machine, CompiledMachine):
            z = self._z[: self.problem.data.states.size]
            return lambda t: machine.step(self._space, self._X, z, self._rows, t, self.iterations, self._u)
        pointers = [each.ctypes.data for each in (self._space, self._X, self._z, self._rows)]
        u, iterations, raw = self._u.ctypes.data, self.iterations, machine.raw_step
        return lambda t: int(raw(*pointers, stride, t, iterations, u))


def _row_type(shapes: tuple[tuple[str, tuple[int, ...]], ...]) -> np.dtype[Any]:
    """One stage's parameters as a record, so that each name has a view."""
    if not shapes:
        return np.dtype([("none", float)])
    fields: list[Any] = [
        (name, complex, shape[:2]) if len(shape) == 3 else (name, float, shape if prod(shape) else ())
        for name, shape in shapes
    ]
    return np.dtype(fields)
