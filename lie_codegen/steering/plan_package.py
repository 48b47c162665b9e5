"""A plan as C: its controls as a function of t, and a program that flies them against test vectors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.codegen.opcodes import REALS
from lie_codegen.codegen.parts import PackageParts
from lie_codegen.codegen.templates import render
from lie_codegen.errors import CodegenError, ComputationError
from lie_codegen.groups.build import build
from lie_codegen.groups.maps.rkmk import rkmk4_step
from lie_codegen.identifiers import check_identifier
from lie_codegen.steering.plan import Plan
from lie_codegen.steering.plan_table import PlanTable, plan_table

#: What the replay allows, relative to max(1, |expected|); and the path's own error, to which its steps are halved.
_TOLERANCES = {"double": 1e-8, "float": 1e-3}
_FLOWN = {"double": 1e-9, "float": 1e-6}
_SAMPLES, _MARKS, _MOST_STEPS = 17, 9, 2**18
_FIRST_STEP = 1 / 4  # |h u|: RKMK4's Taylor exponential is exact to rounding up to there


@dataclass(frozen=True)
class PlanView:
    """What the templates see: texts, and numbers as C literals."""

    prefix: str
    package: str
    group: str
    method: str
    components: tuple[str, ...]
    form: str
    error: str
    real: str
    suffix: str
    zero: str
    two: str
    rate: str
    tolerance: str
    duration: str
    size: int
    entries: int
    is_fourier: bool
    pieces: int
    terms: int
    places: tuple[int, ...]
    edges: tuple[tuple[str, ...], ...]
    coefficients: tuple[tuple[tuple[str, ...], ...], ...]
    equation: str
    flown: bool
    drift_row: tuple[str, ...]
    start: tuple[str, ...]
    samples: tuple[tuple[str, ...], ...]
    flights: tuple[tuple[str, ...], ...]
    marks: tuple[tuple[str, ...], ...]


def plan_parts(plan: Plan, name: str | None, real: str, form: str = "auto") -> PackageParts:
    """The step that flies the plan, and the files of its controls.

    Raises:
        CodegenError: no such real type.
        InputError, ComputationError: as `plan_table`; the replay does not meet the plan's own path.

    The replay flies X' = X hat(u + drift) with a constant drift. Of plans of other systems (torques, a drift that depends on time, a velocity
    that acts from the left of X) it compares the controls alone; the header says what the system is.
    """
    if real not in REALS:
        raise CodegenError(f"real is one of {', '.join(REALS)}, given {real!r}")
    package = check_identifier(name or plan.group.name, "name")
    step = rkmk4_step(plan.group)
    view = _view(plan, plan_table(plan, form), package, real)
    files = {
        f"include/{view.prefix}.h": render("plan_header.h.jinja", plan=view),
        f"src/{view.prefix}.c": render("plan_source.c.jinja", plan=view),
        f"{view.prefix}_replay.c": render("plan_replay.c.jinja", plan=view),
    }
    return PackageParts(package, (step,), files, has_forms=True)


def _view(plan: Plan, table: PlanTable, package: str, real: str) -> PlanView:
    literal = REALS[real].literal

    def row(values: Any) -> tuple[str, ...]:
        return tuple(literal(float(x)) for x in values)

    group = plan.group
    drift = plan.details.get("drift")
    velocity = np.zeros(group.dim) if drift is None else np.asarray(drift, dtype=float)
    times = plan.duration * np.linspace(0.01, 0.99, _SAMPLES)
    start = plan.X(0.0)
    equation, flown = _system(plan)
    flights, marks = _flights(plan, table, velocity, _FLOWN[real]) if flown else ([], [])
    edges = row(table.edges)
    units = [f"u[{i}]: {label}" + (f" [{unit}/s]" if unit else "") for i, (label, unit) in _numbered(plan)]
    shape = "a Fourier series" if table.is_fourier else f"polynomials of degree {table.coefficients.shape[2] - 1}"
    return PlanView(
        prefix=f"{package}_plan",
        package=package,
        group=group.name,
        method=plan.method,
        components=tuple(units),
        form=shape if table.is_fourier else f"{shape} in {len(table.edges) - 1} pieces",
        error=f"{max(table.error, 1e-16):.1e}",
        real=real,
        suffix="f" if real == "float" else "",
        zero=literal(0.0),
        two=literal(2.0),
        rate=literal(2 * np.pi / plan.duration),
        tolerance=repr(_TOLERANCES[real]),
        duration=literal(plan.duration),
        size=group.dim,
        entries=len(_flat(start)),
        is_fourier=table.is_fourier,
        pieces=len(table.edges) - 1,
        terms=table.coefficients.shape[2],
        places=table.places,
        edges=tuple(edges[i : i + 8] for i in range(0, len(edges), 8)),
        coefficients=tuple(tuple(row(each) for each in piece) for piece in table.coefficients),
        equation=equation,
        flown=flown,
        drift_row=row(velocity),
        start=row(_flat(start)),
        samples=tuple(row([t, *values]) for t, values in zip(times, plan.u(times), strict=True)),
        flights=tuple(
            (literal(a), literal(b), str(piece), str(steps), str(mark)) for a, b, piece, steps, mark in flights
        ),
        marks=tuple(row(_flat(X)) for X in marks),
    )


def _system(plan: Plan) -> tuple[str, bool]:
    """The equation that u is the input of, and whether a replay by steps of X' = X hat(u + drift) follows it."""
    details = plan.details
    if details.get("inertia") is not None:
        return "I xi' = ad*_xi I xi + u(t), X' = X hat(xi)", False
    system = details.get("system")
    drift = details.get("drift") if system is None else system.drift.constant
    steady = system is None or drift is not None
    velocity = "u(t) + drift(t)" if not steady else "u(t) + drift" if drift is not None and np.any(drift) else "u(t)"
    if system is not None and system.right:
        return f"X' = hat({velocity}) X", False
    return f"X' = X hat({velocity})", steady


def _numbered(plan: Plan) -> Any:
    return enumerate(zip(plan.group.labels, plan.group.units, strict=True))


def _flat(X: Array) -> Array:
    return np.ascontiguousarray(X).ravel().view(float)


def _flights(
    plan: Plan, table: PlanTable, drift: Array, tolerance: float
) -> tuple[list[tuple[float, float, int, int, int]], list[Array]]:
    """(from, to, piece, steps, mark) with steps halved until the path is the plan's, and X at the marks."""
    marks = plan.duration * np.linspace(0, 1, _MARKS + 1)[1:]
    marks[-1] = table.edges[-1]
    knots = np.unique(np.concatenate([table.edges, marks]))
    place = np.clip(np.searchsorted(table.edges, knots[:-1], side="right") - 1, 0, len(table.edges) - 2)
    wanted = plan.X(marks)
    step = build(rkmk4_step(plan.group)).rkmk4_step
    every = 1
    while True:
        flown, flights, seen = plan.X(0.0), [], []
        for a, b, piece in zip(knots[:-1], knots[1:], place, strict=True):
            steps = every * max(1, int(np.ceil(_speed(table, piece, a, b, drift) * (b - a) / _FIRST_STEP)))
            t = np.linspace(a, b, 2 * steps + 1)
            u = np.zeros((len(t), plan.group.dim))
            u[:, list(table.places)] = table.piece(int(piece), t)
            u += drift
            run = step.scan(flown, u[:-1:2], u[1::2], u[2::2], (b - a) / steps, n=steps, every=steps)
            flown = np.ascontiguousarray(run[-1])
            hit = np.flatnonzero(marks == b)
            flights.append((float(a), float(b), int(piece), steps, int(hit[0]) if hit.size else -1))
            if hit.size:
                seen.append(flown)
        error = float(np.max(np.abs(np.array(seen) - wanted)))
        if error <= tolerance * max(1.0, float(np.max(np.abs(wanted)))):
            return flights, list(wanted)
        every *= 2
        if sum(flight[3] for flight in flights) * 2 > _MOST_STEPS:
            raise ComputationError(f"the replay of the plan misses its path by {error:.2g} with {_MOST_STEPS} steps")


def _speed(table: PlanTable, piece: int, a: float, b: float, drift: Array) -> float:
    u = np.zeros((5, len(drift)))
    u[:, list(table.places)] = table.piece(piece, np.linspace(a, b, 5))
    return float(np.max(np.linalg.norm(u + drift, axis=1)))
