"""spread=: controls under which several systems, that differ in drift and gain, all end as near to the goal as they can.

The systems are lanes that share their controls. No equation holds exactly, so that nothing is reached and descended: the sum of the
squared residuals of all systems, and a small multiple of the energy, is minimised by Levenberg and Marquardt's steps, projected on
the bounds, with normal matrices of the stacked residuals (systems x n), from many starts.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import NotFiniteError, ShapeError, SteeringInputError
from lie_codegen.steering.direct.assemble import Manoeuvre, constant_pieces
from lie_codegen.steering.direct.compiled import machine
from lie_codegen.steering.direct.inputs import Drive, Inputs
from lie_codegen.steering.direct.magnus_flow import end_reached
from lie_codegen.steering.direct.polish import Flown, as_inputs
from lie_codegen.steering.direct.programme import Goal, Machine, Programme
from lie_codegen.steering.direct.report import error_at, fidelity, plan_of
from lie_codegen.steering.direct.starts import starts as first_controls
from lie_codegen.steering.direct.starts import with_free_slots
from lie_codegen.steering.direct.system import Velocity, velocity
from lie_codegen.steering.plan import Plan, Status

#: The energy's share: its mean square counts as much as that share of a squared residual.
_ENERGY = 1e-5
_STILL = 1e-7


@dataclass(frozen=True, eq=False)
class _Copies:
    """The systems of a spread, as tasks, and one programme in which each is a row of the table."""

    tasks: tuple[Manoeuvre, ...]
    programme: Programme
    solver: Machine
    goal: Goal

    @property
    def own(self) -> slice:
        """The slots of the controls; the others are motions that the goal leaves free."""
        before, after = self.tasks[0].free_slots
        return slice(before, len(self.programme.low) - after)

    @property
    def free(self) -> int:
        """How many free motions' numbers each system has."""
        return sum(self.tasks[0].free_slots) * self.tasks[0].controls

    def lanes(self, u: Array) -> Array:
        """Unknowns (L, C) from controls with slots for free motions (L, S, m): the controls, then the free motions of each system."""
        motions = np.delete(u, np.arange(u.shape[1])[self.own], axis=1).reshape(len(u), -1)
        return np.concatenate([u[:, self.own].reshape(len(u), -1), np.tile(motions, (1, len(self.tasks)))], axis=1)

    def each(self, x: Array) -> Array:
        """(L, systems, S, m) what each system's programme takes, of unknowns (L, C)."""
        lanes, copies, m = len(x), len(self.tasks), self.programme.low.shape[1]
        width = x.shape[1] - copies * self.free
        shared = np.repeat(x[:, None, :width], copies, axis=1).reshape(lanes, copies, -1, m)
        motions = x[:, width:].reshape(lanes, copies, -1, m)
        before = self.own.start
        return np.concatenate([motions[:, :, :before], shared, motions[:, :, before:]], axis=2)

    def side(self, rows: Array, beyond: float) -> Array:
        """(C,) limits or weights of the unknowns from those of the slots (S, m), and of free motions."""
        return np.concatenate([rows[self.own].ravel(), np.full(len(self.tasks) * self.free, beyond)])

    def linearised(self, x: Array) -> tuple[Array, Array, Array]:
        """Sum of squared residuals (L,), stacked reduced residuals (L, systems n) and derivatives (L, systems n, C) of x (L, C)."""
        lanes, copies = len(x), len(self.tasks)
        programme = replace(self.programme, entry=np.tile(self.programme.entry, (lanes, 1)))
        goal = replace(self.goal, value=np.repeat(self.goal.value, lanes * copies, axis=0))
        u = self.each(x)
        size, r, J = self.solver.linearise(programme, goal, u.reshape(lanes * copies, *u.shape[2:]))
        n = r.shape[1]
        slopes = J.reshape(lanes, copies, n, *u.shape[2:])
        shared = slopes[..., self.own, :].reshape(lanes, copies * n, -1)
        motions = np.delete(slopes, np.arange(u.shape[2])[self.own], axis=3).reshape(lanes, copies, n, -1)
        alone = np.einsum("lcnf,cd->lcndf", motions, np.eye(copies)).reshape(lanes, copies * n, -1)
        return (
            np.sum(size.reshape(lanes, copies) ** 2, axis=1),
            r.reshape(lanes, copies * n),
            np.concatenate([shared, alone], axis=2),
        )


def robust(
    task: Manoeuvre,
    target: Any,
    tolerance: float,
    spread: Sequence[Any],
    starts: int,
    pieces: int,
    iterations: int,
    seed: int,
    guesses: Array | None,
    say: Callable[[str], None],
) -> Plan:
    """The plan whose worst system ends nearest to the goal; its X_final and error are those of the system as given.

    Raises:
        SteeringInputError, ShapeError, NotFiniteError: about the spread.
    """
    began = time.perf_counter()
    tasks = tuple(_varied(task, each, number) for number, each in enumerate(spread, start=1))
    if not tasks:
        raise SteeringInputError(
            f"steer({task.system.group.name}): spread is empty; give at least one {{'drift': ..., 'gain': ...}}"
        )
    solver = machine(task.system.group, task.controls)
    found: list[tuple[float, Array, int]] = []
    spreads: list[_Copies] = []
    each = max(1, starts // len(task.end.values))
    for variant in range(len(task.end.values)):
        u = first_controls(task, pieces, each, seed, variant)
        if guesses is not None:
            u = np.concatenate([guesses, u])
        copies = _copies(tasks, solver, pieces, variant)
        spreads.append(copies)
        lanes, total = _minimised(copies, copies.lanes(with_free_slots(task, u, seed)), iterations)
        best = int(np.argmin(total))
        say(f"variant {variant + 1}: sum of squared residuals {total[best]:.3g}, the best of {len(u)} starts")
        found.append((float(total[best]), lanes[best], variant))
    total_best, x, variant = min(found, key=lambda item: item[0])
    systems = spreads[variant].each(x[None])[0]
    inputs = as_inputs(task, systems[0], False)
    flights = [_flown(one, inputs, u, variant) for one, u in zip(tasks, systems, strict=True)]
    errors = np.array([error_at(one, flight, variant) for one, flight in zip(tasks, flights, strict=True)])
    # the system as given has no free motion of its own: that of the systems which suits it best
    nominal = min((_flown(task, inputs, u, variant) for u in systems), key=lambda flight: flight.miss)
    fidelities = [fidelity(one, flight.X, variant) for one, flight in zip(tasks, flights, strict=True)]
    details: dict[str, Any] = {
        "winner": "direct, a spread of systems under the same controls",
        "objective": "spread",
        "starts": each * len(task.end.values),
        "seed": seed,
        "spread_errors": errors,
        "worst_error": float(np.max(errors)),
        "squared_residuals": total_best,
        "pieces": inputs,
        "discretisation": f"{pieces} constant pieces",
        "compiled": solver.compiled,
        "optimality": "a local minimum of the sum of squared residuals, the best of the starts tried",
    }
    if fidelities[0] is not None:
        infidelities = 1 - np.array(fidelities, dtype=float)
        details |= {
            "infidelities": infidelities,
            "worst_infidelity": float(np.max(infidelities)),
            "mean_infidelity": float(np.mean(infidelities)),
        }
    if task.end.phases:
        details["phase"] = task.end.phases[variant]
    status = Status.LOCAL if np.max(errors) <= tolerance else Status.APPROXIMATE
    return plan_of(
        task, target, nominal, variant, tolerance, "energy", details, {"solve": time.perf_counter() - began}, status
    )


def _varied(task: Manoeuvre, change: Any, number: int) -> Manoeuvre:
    """The task of one system of the spread: its drift is added to the common one, its gain multiplies the controls."""
    system, where = task.system, f"steer({task.system.group.name}): spread {number}"
    if not isinstance(change, Mapping) or not set(change) <= {"drift", "gain"}:
        raise SteeringInputError(f"{where}: give {{'drift': (n,), 'gain': number or (m,)}}, got {change!r:.80}")
    m, n = task.controls, system.group.dim
    gain = np.asarray(change.get("gain", 1.0), dtype=float)
    if gain.shape not in ((), (m,)):
        raise ShapeError(f"{where}: gain has shape {gain.shape}; give a number or ({m},)")
    if not np.all(np.isfinite(gain)):
        raise NotFiniteError(f"{where}: gain holds NaN or infinity")
    more = velocity(system.group, change.get("drift", np.zeros(n)), f"{where}: drift")
    drift = _sum(system.drift, more)
    directions = tuple(
        _scaled(b, float(g)) for b, g in zip(system.directions, np.broadcast_to(gain, (m,)), strict=True)
    )
    return replace(task, system=replace(system, drift=drift, directions=directions))


@dataclass(frozen=True, eq=False)
class _Added:
    """The sum of two velocities, or a multiple of one, at a time."""

    one: Velocity
    two: Velocity | None
    factor: float = 1.0

    def __call__(self, t: float) -> Array:
        total = self.factor * self.one.at(np.array([t]))[0]
        return np.asarray(total if self.two is None else total + self.two.at(np.array([t]))[0])


def _sum(one: Velocity, two: Velocity) -> Velocity:
    if one.constant is not None and two.constant is not None:
        return Velocity(one.dim, constant=one.constant + two.constant)
    return Velocity(one.dim, function=_Added(one, two))


def _scaled(one: Velocity, factor: float) -> Velocity:
    if one.constant is not None:
        return Velocity(one.dim, constant=factor * one.constant)
    return Velocity(one.dim, function=_Added(one, None, factor))


def _copies(tasks: tuple[Manoeuvre, ...], solver: Machine, pieces: int, variant: int) -> _Copies:
    programmes = [constant_pieces(one, pieces) for one in tasks]
    first = programmes[0]
    rows = np.cumsum([0, *(len(one.drifts) for one in programmes[:-1])])
    whole = replace(
        first,
        drifts=np.concatenate([one.drifts for one in programmes]),
        directions=np.concatenate([one.directions for one in programmes]),
        entry=np.concatenate([one.entry + row for one, row in zip(programmes, rows, strict=True)]),
    )
    return _Copies(tasks, whole, solver, tasks[0].goal(np.array([variant])))


def _minimised(copies: _Copies, x: Array, iterations: int) -> tuple[Array, Array]:
    """Unknowns (L, C) of least squared residuals and energy together, and the sum of squared residuals, lane by lane."""
    lanes = len(x)
    programme = copies.programme
    low, high = copies.side(programme.low, -np.inf), copies.side(programme.high, np.inf)
    energy = _ENERGY * len(copies.tasks) / low.size * copies.side(programme.weight, 0.0)
    damped = np.full(lanes, 1e-2)
    total, r, J = copies.linearised(x)
    value = total + x**2 @ energy
    quiet = np.zeros(lanes, int)
    for _ in range(iterations):
        act = np.flatnonzero((damped < 1e8) & (quiet < 3))
        if not len(act):
            break
        trial = np.clip(x[act] + _step(x[act], r[act], J[act], energy, damped[act], low, high), low, high)
        new_total, new_r, new_J = copies.linearised(trial)
        new = new_total + trial**2 @ energy
        better = new < value[act]
        small = better & (value[act] - new <= _STILL * value[act])
        quiet[act] = np.where(small, quiet[act] + 1, np.where(better, 0, quiet[act]))
        damped[act] = np.where(better, np.maximum(damped[act] / 4, 1e-12), damped[act] * 5)
        rows = act[better]
        x[rows], total[rows], r[rows], J[rows], value[rows] = (
            trial[better],
            new_total[better],
            new_r[better],
            new_J[better],
            new[better],
        )
    return x, total


def _step(x: Array, r: Array, J: Array, energy: Array, damped: Array, low: Array, high: Array) -> Array:
    """-(J'J + diag(energy + damping))^-1 (J'r + energy x) on the free controls, by the q x q matrix of the dual form."""
    pull = np.einsum("lqc,lq->lc", J, r) + energy * x
    free = ~(((x <= low) & (pull > 0)) | ((x >= high) & (pull < 0)))
    q = J.shape[1]
    scale = np.einsum("lqc,lqc->l", J, J) / q
    weight = free / (energy + (damped * scale)[:, None] + 1e-300)
    scaled = J * weight[:, None, :]
    K = scaled @ np.swapaxes(J, 1, 2) + np.eye(q)
    first = weight * pull
    y = np.linalg.solve(K, np.einsum("lqc,lc->lq", J, first)[..., None])[..., 0]
    return np.asarray(-(first - np.einsum("lqc,lq->lc", scaled, y)))


def _flown(task: Manoeuvre, inputs: Inputs, u: Array, variant: int) -> Flown:
    X = end_reached(Drive(task.system, inputs))
    left, right = task.free_motions(u)
    miss = task.end.left @ left @ X @ right @ task.end.right - task.end.values[variant]
    return Flown(inputs, X, float(np.linalg.norm(miss)), (left, right))
