"""`lc.simulate` of a plan of `lc.ocp`: the system of its problem under its controls, by steps as short as it takes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError
from lie_codegen.flow.trajectory import Trajectory
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.signals.sampled_input import SampledInput
from lie_codegen.steering.ocp.elements import pack_element, unpack_elements
from lie_codegen.steering.ocp.machine import loop_machine
from lie_codegen.steering.ocp.plan import OptimalPlan
from lie_codegen.steering.ocp.problem_data import ORDERS, Affine, SecondOrder
from lie_codegen.steering.plan_path import Replay, along, replay_times, replay_tolerance, starts_of

#: Steps of one interval, at most.
_MOST_PARTS = 2**16


def simulated(
    plan: OptimalPlan,
    group: MatrixGroup | None = None,
    *,
    t: ArrayLike | None = None,
    eps: ArrayLike = 1.0,
    X0: ArrayLike | None = None,
    **options: Any,
) -> Trajectory:
    """The controls, constant on each interval, through the problem's own system: from where the plan is at t[0], or from X0 there.

    Velocities B u + drift go the way of every other input; forces, velocities and rates of states written by the user step by step.

    Raises:
        InputError: another group than the plan's, a time outside [0, duration], eps, or an option that the system does not know.
        ComputationError: the tolerance is not met.
    """
    data, where = plan.problem, f"simulate({plan.problem.name})"
    times = replay_times(plan, plan.group, group, t, eps)
    law = data.velocity
    if isinstance(law, Affine):
        velocities = np.asarray(plan.u) @ np.array(law.columns).T + np.array(law.drift)
        return along(plan.group, SampledInput(plan.t, velocities), plan.X[0], times, X0, options)
    rtol = replay_tolerance(where, options, "a problem whose velocity is no input")
    starts, joined = starts_of(plan.group, X0)
    flights = [_refined(plan, times, start, rtol, where) for start in starts]
    paths = [unpack_elements(data, states) for states, _, _ in flights]
    xi = [data.states.split(z)["xi"] if isinstance(law, SecondOrder) else None for _, z in paths]
    return Replay(
        plan.group, times, joined([X for X, _ in paths]), max(steps for _, steps, _ in flights), max(off for _, _, off in flights),
        data.integrator, 0, 0.0, (), None, rtol, 0, plan=plan, xi=None if xi[0] is None else joined(xi),  # type: ignore[arg-type]
    )  # fmt: skip


def _refined(plan: OptimalPlan, times: Array, start: Array | None, rtol: float, where: str) -> tuple[Array, int, float]:
    """States at the times, steps and the estimated error: the steps of every interval are halved until two runs agree."""
    order = ORDERS[plan.problem.integrator]
    parts, before = 1, None
    while parts <= _MOST_PARTS:
        states, steps = _stepped(plan, times, start, parts)
        if before is not None and np.all(np.isfinite(states)):
            error = float(np.max(np.abs(states - before))) / (2**order - 1)
            if error <= rtol * max(1.0, float(np.max(np.abs(states)))):
                return states, steps, error
        parts, before = 2 * parts, states
    raise ComputationError(
        f"{where}: {_MOST_PARTS} steps an interval do not bring the error below {rtol:g}; give a larger rtol"
    )


def _stepped(plan: OptimalPlan, times: Array, start: Array | None, parts: int) -> tuple[Array, int]:
    """Packed states at the times, from the plan's first one; at times[0] the element becomes `start`, the other states go on."""
    data, machine = plan.problem, loop_machine(plan.problem)
    # A free duration is a state T, and the problem's own time runs from 0 to 1.
    scale = 1.0 if data.free_duration is None else plan.duration
    controls, rows = np.ascontiguousarray(plan.u, dtype=float), np.ascontiguousarray(plan.parameters, dtype=float)
    moments = np.unique(np.concatenate([plan.t[plan.t < times[-1]], times]))
    x = np.concatenate([pack_element(data, plan.X[0]), plan.z[0]])
    found, steps = [], 0
    for i, moment in enumerate(moments):
        if moment == times[0] and start is not None:
            x = np.concatenate([pack_element(data, start), x[len(x) - plan.z.shape[1] :]])
        if moment >= times[0]:
            found.append(x)
        if i + 1 < len(moments):
            k = min(int(np.searchsorted(plan.t, moment, side="right")) - 1, len(controls) - 1)
            length = (moments[i + 1] - moment) / scale
            x = machine.advance(x, controls[k], rows[k if len(rows) > 1 else 0], moment / scale, length, parts)
            steps += parts
    asked = np.searchsorted(moments[moments >= times[0]], times)
    return np.array(found)[asked], steps
