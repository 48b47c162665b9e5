"""Derivatives of a solution by the first state and by parameters, from one clean sweep with exact curvature.

A parameter is a state that does not move: the same sweep, on the problem with it among the states, gives du_k/d(d_k, p), and
the chain from stage to stage gives du_k/dp. Controls at a bound do not move; conditions that are active stay so.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.door import warn_caller
from lie_codegen.errors import AssumptionWarning, InputError
from lie_codegen.groups.maps.packed_arrays import packed_elements
from lie_codegen.recent import Recent
from lie_codegen.steering.ocp.interpreted import InterpretedMachine
from lie_codegen.steering.ocp.interpreted_merit import Run
from lie_codegen.steering.ocp.interpreted_model import InterpretedModel
from lie_codegen.steering.ocp.layout import Layout
from lie_codegen.steering.ocp.machine import machine_of
from lie_codegen.steering.ocp.machine_base import EXACT_AT_ONCE
from lie_codegen.steering.ocp.model import ModelBuilder
from lie_codegen.steering.ocp.problem_data import ProblemData
from lie_codegen.steering.ocp.solution import Solution

#: Relative to the largest multiplier, and to the size of what is bounded.
_WEAK = 1e-6


def state_sensitivity(plan: Solution) -> Array:
    """(N, m, nx) du*/dx_0."""
    data = plan.problem
    nx = data.group.dim + data.states.size
    first = np.eye(nx)
    if data.free_duration is not None:
        first[-1] = -plan.value_hessian[-1] / plan.value_hessian[-1, -1] if _is_inside(plan) else 0.0
        first[-1, -1] = 0.0  # the duration is no state to be displaced: it follows
    return _forward(data, plan, plan.gain, first, np.zeros((0, nx)))


def _is_inside(plan: Solution) -> bool:
    """Whether a free duration lies between its bounds."""
    low, high = plan.problem.free_duration or (0.0, 0.0)
    return bool(low < plan.z[0, -1] < high)


def sensitivity(plan: Solution, name: str) -> Array:
    """(N, m, *shape) du*/dp of the parameter `name`.

    Raises:
        InputError: there is no such parameter.

    Warns:
        AssumptionWarning: where a bound or a condition neither presses nor leaves a gap, the derivative is one-sided.
    """
    data = plan.problem
    if name not in data.parameters.names:
        known = ", ".join(data.parameters.names) or "none"
        raise InputError(f"{data.name}.sensitivity: no parameter {name!r}; the parameters are {known}")
    weak = weakly_active(plan)
    if weak:
        what, stage = weak[0]
        warn_caller(
            f"{data.name}.sensitivity({name}): {what} at stage {stage} is active without pressing"
            f"{f', and {len(weak) - 1} more' if len(weak) > 1 else ''}: there the derivative is one-sided",
            AssumptionWarning,
        )
    shape = dict(data.parameters.shapes)[name]
    extended = _extended(data, name)
    machine = machine_of(extended, second_order=True)
    space = machine.workspace()
    place = data.parameters.slices()[name][0]
    rows = np.broadcast_to(plan.parameters, (data.intervals + 1, plan.parameters.shape[1]))
    model = InterpretedModel(data, ModelBuilder(data).build(second_order=False))
    states = np.array([model.packed(X, z) for X, z in zip(plan.X, plan.z, strict=True)])
    space["x"][0] = np.hstack([states, rows[:, place]])
    space["u"][0], space["lambda"][0], space["lambda_end"][0] = plan.u, plan.multipliers, plan.end_multipliers
    space["rho"], space["curvature"] = plan.penalty, 1
    others = np.delete(plan.parameters, np.r_[place], axis=1)
    machine.gains(space, np.ascontiguousarray(others), 0.0)
    gain = space["K"][0]
    nx, size = plan.gain.shape[2], prod(shape)
    first = np.zeros((nx, size))
    if data.free_duration is not None and _is_inside(plan):
        P = space["P"][0]
        first[-1] = -P[nx - 1, nx:] / P[nx - 1, nx - 1]  # the duration follows, so that dV/dT stays 0
    return _forward(data, plan, gain, first, np.eye(size), extended).reshape(*plan.u.shape, *shape)


def predict(plan: Solution, changes: Mapping[str, ArrayLike]) -> Array:
    """(N, m) the controls for other values of parameters, by one step of Newton's method within the bounds.

    The quadratic program of each stage is solved with its bounds, so that the error is of second order in the change also
    where controls reach or leave their bounds.

    Raises:
        InputError, ShapeError, NotFiniteError: about the changes.
    """
    data = plan.problem
    values: dict[str, Any] = dict(data.parameters.split(plan.parameters))
    if len(plan.parameters) == 1:
        values = {name: value[0] for name, value in values.items()}
    rows = data.parameters.rows({**values, **changes}, data.intervals + 1, f"{data.name}.predict")
    machine = machine_of(data, second_order=True)
    space = machine.workspace()
    space["x"][0, 0], space["u"][0] = _stored(plan, 0), plan.u
    space["lambda"][0], space["lambda_end"][0], space["rho"] = plan.multipliers, plan.end_multipliers, plan.penalty
    space["curvature"] = EXACT_AT_ONCE
    machine.solve(space, rows, 0.0, 0.0, 0.0, 1, 1)
    return np.array(space["u"][0])


def _stored(plan: Solution, k: int) -> Array:
    """A state as the solver keeps it."""
    return np.concatenate([packed_elements(plan.problem.group, plan.X[k]), plan.z[k]])


def weakly_active(plan: Solution) -> tuple[tuple[str, int], ...]:
    """(control or condition, stage) where multiplier and slack both vanish."""
    data = plan.problem
    model = ModelBuilder(data).build(second_order=False)
    machine = InterpretedMachine(data, model)
    space = machine.workspace()
    inner = machine.model
    space["x"][0] = [inner.packed(X, z) for X, z in zip(plan.X, plan.z, strict=True)]
    space["u"][0], space["lambda"][0], space["lambda_end"][0] = plan.u, plan.multipliers, plan.end_multipliers
    space["rho"] = plan.penalty
    run = Run(space[0], plan.parameters, 0.0)
    nx, N = plan.gain.shape[2], data.intervals
    _, v, _ = machine.end_model(run)
    slopes = np.zeros(plan.u.shape)
    for k in range(N - 1, -1, -1):
        _, _, q = machine.stage_model(run, k, np.zeros((nx, nx)), v)
        v, slopes[k] = q[:nx], q[nx:]
    low, high, u = np.array(data.lower), np.array(data.upper), np.asarray(plan.u)
    at_bound = (u <= low) | (u >= high)
    weak = at_bound & (np.abs(slopes) <= _WEAK * max(1.0, float(np.max(np.abs(slopes), initial=0.0))))
    names = data.inputs.entry_names()
    found = [(names[i], int(k)) for k, i in np.argwhere(weak)]
    scale = max(1.0, float(np.max(plan.multipliers, initial=0.0)))
    for k in range(N):
        g = inner.path(space["x"][0, k], u[k], run.row(k), k * data.duration / N)
        idle = (np.abs(g) <= _WEAK) & (plan.multipliers[k][: len(g)] <= _WEAK * scale) & ~inner.given(k)
        found += [(model.row_names[i], k) for i in np.flatnonzero(idle)]
    return tuple(found)


def _extended(data: ProblemData, name: str) -> ProblemData:
    """The problem with a parameter among the states, where it does not move."""
    key = (id(data), name)
    kept = _EXTENDED.get(key)
    if kept is not None and kept[0] is data:
        return kept[1]
    shape = dict(data.parameters.shapes)[name]
    extended = replace(
        data,
        name=f"{data.name}_by_{name}",
        states=Layout("state", (*data.states.shapes, (name, shape))),
        parameters=Layout("parameter", tuple(each for each in data.parameters.shapes if each[0] != name)),
        rates=(*data.rates, (name, ("0",) * prod(shape))),
    )
    _EXTENDED.keep(key, (data, extended))
    return extended


_EXTENDED: Recent[tuple[ProblemData, ProblemData]] = Recent(32)


def _forward(
    data: ProblemData, plan: Solution, gain: Array, first: Array, parameter: Array, extended: ProblemData | None = None
) -> Array:
    """(N, m, columns) du_k along the linearised motion from dx_0 = first and dp = parameter."""
    moved = data if extended is None else extended
    model = InterpretedModel(moved, ModelBuilder(moved).build(second_order=False))
    nx = plan.gain.shape[2]
    rows = np.broadcast_to(plan.parameters, (data.intervals + 1, plan.parameters.shape[1]))
    kept = np.ones(rows.shape[1], dtype=bool)
    if extended is not None:
        kept = np.isin(np.arange(len(kept)), _places(data, extended), invert=True)
    d = np.vstack([first, parameter])
    size = len(d)
    changes = []
    for k in range(data.intervals):
        x = np.concatenate([model.packed(plan.X[k], plan.z[k]), rows[k, ~kept]])
        du = gain[k] @ d
        changes.append(du)
        u, h = np.asarray(plan.u[k]), data.duration / data.intervals
        _, J, _ = model.reached(x, model.linear_stages(x, u, rows[k, kept], k * h, h), h, model.b)
        d = J[:size, :size] @ d + J[:size, size:] @ du
        d[nx:] = parameter
    return np.array(changes)


def _places(data: ProblemData, extended: ProblemData) -> Array:
    """Columns of the parameters that became states."""
    gone = set(data.parameters.names) - set(extended.parameters.names)
    return np.concatenate([np.r_[data.parameters.slices()[name][0]] for name in gone])
