"""method="symmetric_product": torques alone, from rest to rest, without a nonlinear program."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import SteeringError, SteeringInputError
from lie_codegen.flow.elements import group_element
from lie_codegen.flow.logarithm import distance, matrix_log
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.mechanics.driven import simulate_driven
from lie_codegen.mechanics.virtual_actuation import VirtualActuation, virtual_actuation
from lie_codegen.steering.methods import OPEN_LOOP
from lie_codegen.steering.plan import Controls, Facts, Plan, Status
from lie_codegen.steering.simulated_plan import energy
from lie_codegen.steering.symmetric_product.oscillation import Oscillation, balanced
from lie_codegen.steering.symmetric_product.primitives import Primitives, primitives
from lie_codegen.steering.symmetric_product.retune import Retuned, retune
from lie_codegen.steering.task import check_duration, make_task
from lie_codegen.values import Value

#: Where the continuation in cycles begins, and its stations on the way down.
_FIRST, _STATIONS = 4.0, (3.0, 2.5, 2.0, 1.75, 1.5, 1.25, 1.0)
_NAME = "symmetric_product"
OPTIONS = ("inertia", "forces", "damping", "cycles", "form", "compare", "progress", "drift", "dynamics")


@dataclass(frozen=True, eq=False, repr=False)
class Inputs(Value):
    """u^a(t): (m,) at a time, (k, m) at (k,) times."""

    law: Oscillation | Primitives

    def __call__(self, t: ArrayLike) -> Array:
        """The strengths of the forces."""
        times = np.atleast_1d(np.asarray(t, dtype=float))
        if isinstance(self.law, Primitives):
            values = self.law.inputs(times)
        else:
            v, _, rate = self.law.parts(times)
            values = v + rate
        # back to the forces that were given
        values = values @ self.law.body.mixing
        return values[0] if np.ndim(t) == 0 else values


def symmetric_product_plan(
    group: MatrixGroup,
    target: Any,
    controls: Sequence[Any] | None,
    duration: float,
    tolerance: float,
    options: dict[str, Any],
) -> Plan:
    """See `lc.steer`.

    Raises:
        UncontrollableError: a missing direction, or a bad product, in words.
        SteeringInputError: an option that it does not have, a drift, a target without logarithm.
        SteeringError: Newton does not reach the target.
    """
    where = f"steer({group.name}, method={_NAME!r})"
    _check(where, options)
    check_duration(duration, where)
    element = group_element(group, target, f"{where}: target")
    body = virtual_actuation(
        group,
        options.get("inertia"),
        controls=controls,
        forces=options.get("forces"),
        damping=options.get("damping"),
        where=where,
    )
    started = time.perf_counter()
    if options.get("form") == "primitives":
        return _by_primitives(body, element, duration, tolerance, where, options, started)
    body.require(where)
    log, off = matrix_log(group, element)
    if not (np.all(np.isfinite(log)) and off < 1e-8):
        raise SteeringInputError(f"{where}: the target has no logarithm near the identity: cut the manoeuvre in two")
    found = _retuned(body, element, log, duration, tolerance, options.get("cycles"))
    if found is None:
        raise SteeringError(
            f"{where}: Newton did not reach the target with {options.get('cycles') or _FIRST:g} cycles, nor from more of them; nothing is proved: "
            "try other cycles, two parts, or method='transcription'"
        )
    details = {
        "first_error": found.first_error,
        "cycles": float(found.oscillation.cycles),
        "iterations": found.iterations,
        "multiples": found.oscillation.multiples.tolist(),
        "retuned_error": found.error,
    }
    return _plan(body, element, duration, tolerance, found.oscillation, details, options, started, ())


def _check(where: str, options: dict[str, Any]) -> None:
    unknown = sorted(set(options) - set(OPTIONS))
    if unknown:
        raise SteeringInputError(
            f"{where} has no option {', '.join(unknown)}; it has {', '.join(sorted(OPTIONS[:-2]))}"
        )
    drift = options.get("drift")
    if drift is not None and np.any(np.asarray(drift)):
        raise SteeringInputError(
            f"{where}: a constant force or drift cannot be held: the oscillation vanishes at both ends, where a body rests; use method='transcription'"
        )
    if options.get("dynamics", "second_order") != "second_order":
        raise SteeringInputError(f"{where} steers by torques: dynamics='second_order', which need not be said")
    if options.get("form", "oscillation") not in ("oscillation", "primitives"):
        raise SteeringInputError(f"{where}: form is 'oscillation' or 'primitives', got {options['form']!r}")
    cycles = options.get("cycles")
    if cycles is not None and not (
        isinstance(cycles, int | float | np.number) and not isinstance(cycles, bool) and 0.25 <= cycles <= 1000
    ):
        raise SteeringInputError(
            f"{where}: cycles is a number between 0.25 and 1000, not necessarily whole, got {cycles!r}"
        )


def _retuned(
    body: VirtualActuation, target: Array, log: Array, duration: float, tolerance: float, cycles: float | None
) -> Retuned | None:
    numbers = np.concatenate([log, np.zeros(body.group.dim)])
    balance = balanced(body, numbers, duration)

    def at(N: float, start: Array) -> Retuned | None:
        return retune(Oscillation(body, float(duration), float(N), balance, start), target, tolerance)

    if cycles is not None:
        found = at(cycles, numbers)
        if found is not None:
            return found
        # from cold few cycles are too far from an average: come down from more of them
        for N in _down(max(_FIRST, 2 * float(cycles)), float(cycles)):
            found = at(N, numbers if found is None else found.oscillation.numbers)
            if found is None:
                return None
        return found
    first = next((r for r in (at(N, numbers) for N in (_FIRST, 2 * _FIRST, 4 * _FIRST)) if r is not None), None)
    if first is None:
        return None
    best, cost = first, energy(Controls(first.oscillation), duration)
    for N in _STATIONS:
        following = at(N, best.oscillation.numbers)
        if following is None:
            break
        price = energy(Controls(following.oscillation), duration)
        if price >= cost:
            break
        # what the others began with is told of the plan that is kept
        best, cost = replace(following, first_error=following.first_error), price
    return best


def _down(first: float, last: float) -> Iterator[float]:
    count = max(2, int(np.ceil(np.log(first / last) / np.log(1.3))) + 1)
    yield from np.geomspace(first, last, count).tolist()


def _by_primitives(
    body: VirtualActuation,
    target: Array,
    duration: float,
    tolerance: float,
    where: str,
    options: dict[str, Any],
    started: float,
) -> Plan:
    if np.any(body.damping):
        raise SteeringInputError(
            f"{where}: primitives are followed exactly without damping alone; form='oscillation' takes it"
        )
    if not body.decoupling:
        raise SteeringInputError(
            f"{where}: no force is decoupling: every <Y:Y> leaves the span of the forces; use form='oscillation' or method='transcription'"
        )
    law, cost = primitives(body, target, duration)
    details = {
        "form": "primitives",
        "word": tuple(body.names[a] for a in law.word),
        "amounts": law.amounts,
        "ends": law.ends,
        "predicted_cost": cost,
    }
    return _plan(body, target, duration, tolerance, law, details, options, started, law.ends[1:-1])


def _plan(
    body: VirtualActuation,
    target: Array,
    duration: float,
    tolerance: float,
    law: Oscillation | Primitives,
    details: dict[str, Any],
    options: dict[str, Any],
    started: float,
    breakpoints: Any,
) -> Plan:
    group = body.group
    u = Controls(law, breakpoints=breakpoints, duration=float(duration))
    made = time.perf_counter()
    end, velocity = _flown(body, u, duration)
    error, speed = distance(group, target, end), float(duration * np.linalg.norm(velocity))
    touched = np.abs(body.forces).max(axis=0) > 0
    facts: dict[str, Any] = {
        **details,
        "dynamics": "second_order",
        "inertia": body.inertia,
        **({"damping": body.damping} if np.any(body.damping) else {}),
        "end_velocity_error": speed / duration,
        "decoupling": tuple(body.names[a] for a in body.decoupling),
        "inputs": Inputs(law),
        "advice": "not cheap: the cost grows like the square of the cycles; method='transcription', dynamics='second_order', guess=plan descends from here",
    }
    if options.get("compare"):
        facts["transcription_cost"] = _compared(body, target, duration)
    seconds = {"solve": made - started, "simulate": time.perf_counter() - made}
    status = Status.SOLVED if max(error, speed) <= tolerance else Status.NOT_CONVERGED
    labels = tuple(label for label, flag in zip(group.labels, touched, strict=True) if flag)
    cost = energy(u, duration)
    return Plan(group, target, labels, float(duration), _NAME, u, cost, Facts(end, error, status, facts, seconds))


def _flown(body: VirtualActuation, u: Controls, duration: float) -> tuple[Array, Array]:
    """Where the torques really lead, by an integrator that knows nothing of averages: the drag of the body is a force too."""
    run = simulate_driven(body.group, u, body.inertia, t=[0.0, duration], tolerance=1e-10, damping=body.damping)
    return run.X[-1], run.xi[-1]


def _compared(body: VirtualActuation, target: Array, duration: float) -> float:
    """What the least torques cost; NaN where the forces are no components of the basis, or the program finds nothing."""
    unit = np.abs(body.forces) > 0
    if not np.all(unit.sum(axis=1) == 1) or np.any(body.damping):
        return float("nan")
    labels = [body.group.labels[int(np.argmax(row))] for row in unit]
    try:
        task = make_task(body.group, target, labels, duration, 1e-6, torques=True)
        return OPEN_LOOP["transcription"](task, dynamics="second_order", inertia=body.inertia).cost
    except SteeringError:
        return float("nan")
