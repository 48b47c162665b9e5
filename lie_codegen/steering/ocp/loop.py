"""The closed loop of a controller around a plant of one's own, with noise, delay and wrong parameters."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.door import guard_methods
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.counts import count_between, seeded
from lie_codegen.flow.elements import group_element
from lie_codegen.steering.ocp.elements import pack_element, unpack_elements
from lie_codegen.steering.ocp.machine import loop_machine
from lie_codegen.steering.ocp.problem import OptimalControlProblem

#: plant(X, states, u, t, h, rng) -> (X, states) an interval later.
Plant = Callable[..., tuple[ArrayLike, Mapping[str, ArrayLike]]]


@guard_methods
@dataclass(frozen=True, eq=False)
class LoopRun:
    """A closed loop that was run.

    Attributes:
        t: (k + 1,) times.
        X: (k + 1, d, d) true elements.
        z: (k + 1, q) true other states; `states` has them by name; T of a free duration is what the plan leaves of it.
        u: (k, m) controls that acted.
        status: (k,) what the controller said at each sample.
        violation: (k,) of the controller's plan.
        cost: of the true motion, by the trapezoidal rule (the left one where the problem says so), without the end's.
        seconds: (k,) wall time of each step.
        names: of the states, with their shapes.
    """

    t: Array = field(repr=False)
    X: Array = field(repr=False)
    z: Array = field(repr=False)
    u: Array = field(repr=False)
    status: tuple[str, ...] = field(repr=False)
    violation: Array = field(repr=False)
    cost: float
    seconds: Array = field(repr=False)
    names: Any = field(repr=False)

    @property
    def states(self) -> dict[str, Array]:
        """The states beside X by name."""
        parts: dict[str, Array] = self.names.split(self.z)
        return parts

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, LoopRun):
            return NotImplemented
        names = [name for name in self.__dataclass_fields__ if name != "seconds"]
        return all(np.array_equal(getattr(self, name), getattr(other, name)) for name in names)

    __hash__ = None  # type: ignore[assignment]


def run_loop(
    controller: Any,
    X0: ArrayLike | None,
    *,
    steps: int,
    values: Mapping[str, Any],
    plant: OptimalControlProblem | Plant | None,
    plant_values: Mapping[str, Any],
    noise: float | Mapping[str, float] | Callable[..., Any],
    delay: int,
    compensate: bool,
    substeps: int,
    seed: int,
) -> LoopRun:
    """Runs the controller, which must have been reset, for `steps` samples.

    Args:
        controller: of `lc.mpc`.
        X0: first true element; the identity if not given.
        steps: samples.
        values: first states (zero if not given), and what the controller is told: parameters, or (k -> parameter) functions.
        plant: the true system: None for the model; another problem of the same states and inputs; or a function
            plant(X, states, u, t, h, rng) -> (X, states).
        plant_values: parameters of the plant where they differ: numbers, or functions (k, rng) -> numbers.
        noise: of measurements: standard deviation in local coordinates, of all or by name ("X" for the element), or a
            function noise(X, states, rng) -> (X, states).
        delay: whole samples between a measurement and the control made of it.
        compensate: the controller is given the state that the model predicts for when its control will act.
        substeps: integration steps of the plant an interval.
        seed: of noise and of everything random in the plant.

    Raises:
        InputError, ShapeError, NotFiniteError, NotOnGroupError: naming the culprit.
    """
    data = controller.problem.data
    where = f"closed loop of {data.name}"
    count_between(steps, 1, 100_000_000, f"{where}: steps")
    count_between(delay, 0, 100_000, f"{where}: delay")
    count_between(substeps, 1, 1_000_000, f"{where}: substeps")
    rng = seeded(seed, where)
    machine, h, free = loop_machine(data), controller.sample, data.free_duration is not None
    told = {name: value for name, value in values.items() if name in data.parameters.names}
    first = {name: values.get(name, np.zeros(shape)) for name, shape in data.states.shapes}
    unknown = [name for name in values if name not in told and name not in first]
    if unknown:
        raise InputError(f"{where}: no state or parameter {', '.join(unknown)}")
    X = group_element(data.group, np.eye(data.group.degree) if X0 is None else X0, f"{where}: X0")
    if free:
        first["T"] = 1.0  # the plant's own time is counted in seconds
    x = np.concatenate([pack_element(data, X), data.states.rows(first, 1, where)[0]])
    move = _plant(data, plant, plant_values, told, controller, substeps, rng, where)
    disturb = _noise(data, noise, rng, where)
    pending = [np.array(row) for row in controller.plan.u[:delay]]
    believed = _row(data, controller, {})
    record: dict[str, list[Any]] = {name: [] for name in ("x", "u", "status", "violation", "seconds", "cost")}
    for k in range(steps):
        now = {name: value(k) if callable(value) else value for name, value in told.items()}
        believed = _row(data, controller, now)
        measured = disturb(x)
        for i, u in enumerate(pending if compensate else ()):
            measured = machine.advance(measured, u, believed, 0.0 if free else (k + i) * h, h, 1)
        element, z = unpack_elements(data, measured[None])
        began = time.perf_counter()
        states = {name: value for name, value in data.states.split(z[0]).items() if name != "T" or not free}
        u = controller.step(element[0], t=(k + len(pending)) * h, **states, **now)
        record["seconds"].append(time.perf_counter() - began)
        pending.append(u)
        acting = pending.pop(0)
        record["x"].append(np.append(x[:-1], controller.duration) if free else x)
        record["u"].append(acting)
        record["status"].append(controller.status)
        record["violation"].append(controller.violation)
        before = machine.running_cost(x, acting, believed, k * h)
        x = move(k, x, acting)
        after = machine.running_cost(x, acting, believed, (k + 1) * h)
        record["cost"].append(h * before if data.quadrature == "left" else h * (before + after) / 2)
    last = np.append(x[:-1], controller.duration) if free else x
    elements, rest = unpack_elements(data, np.array([*record["x"], last]))
    return LoopRun(
        t=h * np.arange(len(elements)),
        X=elements,
        z=rest,
        u=np.array(record["u"]),
        status=tuple(record["status"]),
        violation=np.array(record["violation"]),
        cost=float(np.sum(record["cost"])),
        seconds=np.array(record["seconds"]),
        names=data.states,
    )


def _row(data: Any, controller: Any, now: Mapping[str, Any]) -> Array:
    """What the controller believes of the parameters now."""
    row: Array = controller.parameters_now()
    for name, value in now.items():
        place, shape = data.parameters.slices()[name]
        array = np.asarray(value)
        own = array if array.shape == shape[:2] else array[0]
        row[place] = np.ascontiguousarray(own).astype(complex).view(float).ravel() if len(shape) == 3 else own.ravel()
    return row


def _plant(
    data: Any,
    plant: Any,
    plant_values: Mapping[str, Any],
    told: Mapping[str, Any],
    controller: Any,
    substeps: int,
    rng: np.random.Generator,
    where: str,
) -> Callable[[int, Array, Array], Array]:
    h, free = controller.sample, data.free_duration is not None
    if plant is None or isinstance(plant, OptimalControlProblem):
        true = controller.problem.data if plant is None else plant.data
        same = (true.group, true.states, true.inputs) == (data.group, data.states, data.inputs)
        same = same and (true.free_duration is None) == (data.free_duration is None)
        if not same:
            raise InputError(
                f"{where}: the plant {true.name} has another group, other states or inputs, or another kind of duration"
            )
        machine = loop_machine(true)
        known = dict(true.parameters.shapes)
        start = data.parameters.split(controller.parameters_now())
        constant = {name: value for name, value in {**start, **told, **plant_values}.items() if name in known}

        def move(k: int, x: Array, u: Array) -> Array:
            now = {name: _at(value, k, rng, name in plant_values) for name, value in constant.items()}
            row = true.parameters.rows(now, 1, where)[0]
            return machine.advance(x, u, row, 0.0 if free else k * h, h, substeps)

        return move
    if not callable(plant):
        raise InputError(f"{where}: a plant is a problem of lc.ocp or a function, got {plant!r:.60}")

    def by_hand(k: int, x: Array, u: Array) -> Array:
        X, z = unpack_elements(data, x[None])
        answer = plant(X[0], data.states.split(z[0]), u, k * h, h, rng)
        if not (isinstance(answer, tuple | list) and len(answer) == 2 and isinstance(answer[1], Mapping)):
            raise InputError(f"{where}: the plant returns (X, {{state: value}}) an interval later, got {answer!r:.60}")
        moved, states = answer
        element = np.asarray(moved)
        if element.shape != X[0].shape:
            raise ShapeError(f"{where}: the plant gave X of shape {element.shape}; it is {X[0].shape}")
        return np.concatenate([pack_element(data, element), data.states.rows(dict(states), 1, where)[0]])

    return by_hand


def _at(value: Any, k: int, rng: np.random.Generator, of_plant: bool) -> Any:
    if callable(value):
        return value(k, rng) if of_plant else value(k)
    return value


def _noise(data: Any, noise: Any, rng: np.random.Generator, where: str) -> Callable[[Array], Array]:
    """A measurement of a stored state."""
    from scipy.linalg import expm

    if callable(noise):

        def by_hand(x: Array) -> Array:
            X, z = unpack_elements(data, x[None])
            element, states = noise(X[0], data.states.split(z[0]), rng)
            return np.concatenate(
                [pack_element(data, np.asarray(element)), data.states.rows(dict(states), 1, where)[0]]
            )

        return by_hand
    sizes = dict(noise) if isinstance(noise, Mapping) else dict.fromkeys(("X", *data.states.names), float(noise))
    unknown = [name for name in sizes if name != "X" and name not in data.states.names]
    if unknown or any(not np.isfinite(value) or value < 0 for value in sizes.values()):
        raise InputError(f"{where}: noise of {', '.join(unknown) or 'a state'} that is none, or is no size")
    deviations = np.zeros(data.states.size)
    for name, (place, _) in data.states.slices().items():
        deviations[place] = sizes.get(name, 0.0)

    def measured(x: Array) -> Array:
        X, z = unpack_elements(data, x[None])
        moved = X[0]
        if sizes.get("X", 0.0):
            moved = moved @ expm(data.group.hat(sizes["X"] * rng.normal(size=data.group.dim)))
        return np.concatenate([pack_element(data, moved), z[0] + deviations * rng.normal(size=len(deviations))])

    return measured
