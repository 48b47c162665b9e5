"""OptimalPlan: what an open optimal control problem returns."""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.saved import Saved
from lie_codegen.steering.ocp.problem_data import ProblemData
from lie_codegen.steering.ocp.stage_controls import StageControls
from lie_codegen.steering.plan import Status

#: What simulates a plan knows the solver, which stands above this file, and is loaded when it is asked for.
SIMULATION = "lie_codegen.steering.ocp.simulation"


@dataclass(frozen=True, eq=False, repr=False)
class OptimalPlan(Saved):
    """A solution of an optimal control problem.

    Attributes:
        problem: the data of the problem.
        t: (N + 1,) times.
        X: (N + 1, d, d) group elements.
        z: (N + 1, q) other states, in the order of the problem; `states` has them by name.
        u: (N, m) controls, constant on each interval; u(t) works too.
        cost: what was minimised, by the problem's quadrature.
        violation: of the worst condition, bounds aside (they hold exactly).
        worst: (its name, its stage), or None where nothing is violated.
        error: true distance from the end asked for: |log(target^-1 X_N)| where X - target is, else the norm of e.
        status: SOLVED, ADMISSIBLE (iteration limit), NOT_ADMISSIBLE (see worst), DIVERGED.
        iterations, sweeps: of the start that won.
        gain: (N, m, nx) du*/dx, x in local coordinates (eta, z): exact derivatives where curvature is exact; rows of
            controls at a bound are 0.
        value_gradient: (nx,) first derivative of the optimal cost by the first state, in local coordinates.
        value_hessian: (nx, nx) second derivative of the optimal cost by the first state.
        multipliers, end_multipliers, penalty: of g, of what holds at the end, and rho: a warm start takes them over.
        starts: (starts, 2) cost and violation of every start tried.
        parameters: (rows, numbers) of the parameters, one row or one a stage.
        quadrature, integrator: how cost and motion were discretised.
        seconds: of the search.
    """

    problem: ProblemData = field(repr=False)
    t: Array = field(repr=False)
    X: Array = field(repr=False)
    z: Array = field(repr=False)
    u: StageControls = field(repr=False)
    cost: float
    violation: float
    worst: tuple[str, int] | None
    error: float
    status: Status
    iterations: int
    sweeps: int
    gain: Array = field(repr=False)
    value_gradient: Array = field(repr=False)
    value_hessian: Array = field(repr=False)
    multipliers: Array = field(repr=False)
    end_multipliers: Array = field(repr=False)
    penalty: float = field(repr=False)
    starts: Array = field(repr=False)
    parameters: Array = field(repr=False)
    quadrature: str
    integrator: str
    seconds: float = field(compare=False)

    @property
    def states(self) -> dict[str, Array]:
        """The states beside X by name: (N + 1, *shape)."""
        return self.problem.states.split(self.z)

    @property
    def controls(self) -> dict[str, Array]:
        """The inputs by name: (N, *shape)."""
        return self.problem.inputs.split(np.asarray(self.u))

    @property
    def X_final(self) -> Array:
        """(d, d) where it ends."""
        return np.asarray(self.X[-1])

    def __simulate__(self, group: MatrixGroup | None, **options: Any) -> Any:
        """`lc.simulate` of this plan."""
        return import_module(SIMULATION).simulated(self, group, **options)

    @property
    def group(self) -> Any:
        """The problem's group."""
        return self.problem.group

    @property
    def duration(self) -> float:
        """Seconds; what was found where the duration is free."""
        return float(self.t[-1])

    def sensitivity(self, name: str) -> Array:
        """du*/dp of a parameter: (N, m, *shape of the parameter), exact where curvature is.

        Raises:
            InputError: there is no such parameter.

        Warns:
            AssumptionWarning: where a bound or a condition is active without pressing, it is one-sided.
        """
        from lie_codegen.steering.ocp.sensitivity import sensitivity

        return sensitivity(self, name)

    def state_sensitivity(self) -> Array:
        """du*/dx_0, (N, m, nx), in local coordinates of the first state."""
        from lie_codegen.steering.ocp.sensitivity import state_sensitivity

        return state_sensitivity(self)

    def predict(self, **changes: ArrayLike) -> StageControls:
        """Controls for other values of parameters, to first order: u + sum du*/dp (p' - p), within the bounds."""
        from lie_codegen.steering.ocp.sensitivity import predict

        return StageControls(predict(self, changes), self.duration)

    @property
    def weakly_active(self) -> tuple[tuple[str, int], ...]:
        """Controls and conditions that neither press nor leave a gap: there derivatives are one-sided. (name, stage)."""
        from lie_codegen.steering.ocp.sensitivity import weakly_active

        return weakly_active(self)
