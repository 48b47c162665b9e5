"""A controller as a C package: {path: text}, the same bytes for the same controller and plan."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.codegen.opcodes import REALS
from lie_codegen.codegen.templates import render
from lie_codegen.codegen.write import GENERATOR
from lie_codegen.errors import CodegenError
from lie_codegen.on_demand import scipy
from lie_codegen.steering.ocp.budget import Budget, budget_of
from lie_codegen.steering.ocp.elements import pack_element, unpack_elements
from lie_codegen.steering.ocp.interpreted import InterpretedMachine
from lie_codegen.steering.ocp.interpreted_merit import Run
from lie_codegen.steering.ocp.machine_base import HELD
from lie_codegen.steering.ocp.plan import OptimalPlan
from lie_codegen.steering.ocp.source import CORE, SolverView, render_solver, solver_view
from lie_codegen.steering.ocp.stage_controls import StageControls

_SAMPLES = 6
_NOISE = 0.005
#: Relative disturbance that stands for the roundings of single precision along a horizon, its draws, and seeds of the noise that are tried.
_ROUNDINGS, _DRAWS, _SEEDS = 5e-5, 2, 8
#: What the example allows, relative to max(1, |control|): one sweep multiplies the rounding of a stage along the horizon.
_TOLERANCES = {"double": 1e-8, "float": 5e-3}


@dataclass(frozen=True)
class SampleVector:
    """One sample: the measured state, the control, and whether no trial did better ("held")."""

    X: tuple[float, ...]
    z: tuple[float, ...]
    u: tuple[float, ...]
    held: bool


def render_mpc_package(
    plan: OptimalPlan, *, iterations: int, penalty: float, sample: float, real: str = "double"
) -> dict[str, str]:
    """The package of a loop that starts from `plan`.

    Raises:
        CodegenError: no such real type, or a constant beyond float's range.
    """
    if real not in REALS:
        raise CodegenError(f"real is one of {', '.join(REALS)}, given {real!r}")
    data = plan.problem
    view, model = solver_view(data, second_order=data.free_duration is not None, real=real)
    loop = (InterpretedMachine(data, model), iterations, penalty, sample)
    vectors = make_vectors(plan, *loop) if real == "double" else steady_vectors(plan, *loop)
    sources = render_solver(view)
    budget = budget_of(view, iterations)
    literal = REALS[real].literal
    shown = [
        {"held": each.held, **{key: [literal(x) for x in getattr(each, key)] for key in ("X", "z", "u")}}
        for each in vectors
    ]
    context = {
        "view": view,
        "vectors": shown,
        "rows": [[literal(x) for x in row] for row in plan.parameters],
        "first": [literal(x) for x in np.concatenate([pack_element(data, plan.X[0]), plan.z[0]])],
        "controls": [[literal(x) for x in row] for row in np.asarray(plan.u)],
        "multipliers": [[literal(x) for x in row] for row in plan.multipliers],
        "end_multipliers": [literal(x) for x in plan.end_multipliers],
        "penalty": literal(penalty),
        "sample": literal(sample),
        "iterations": iterations,
        "tolerance": repr(_TOLERANCES[real]),
        "zero": literal(0.0),
        "budget": budget,
    }
    tree = {
        f"include/{view.prefix}.h": sources[f"{view.prefix}.h"],
        f"src/{view.prefix}.c": sources[f"{view.prefix}.c"],
        f"src/{CORE}": sources[CORE],
        "CMakeLists.txt": render("ocp_CMakeLists.txt.jinja", **context),
        "example.c": render("ocp_example.c.jinja", **context),
        "test_vectors.csv": render("ocp_vectors.csv.jinja", vectors=[asdict(vector) for vector in vectors]),
        "README.md": render("ocp_README.md.jinja", **context),
    }
    return {**tree, "manifest.json": _manifest(view, budget, tree)}


def steady_vectors(
    plan: OptimalPlan, machine: InterpretedMachine, iterations: int, penalty: float, sample: float
) -> tuple[SampleVector, ...]:
    """Samples that single precision computes too: rounding may decide whether a trial is as good as the plan, and one decision changes
    all that follows. Of several seeds the longest run of samples that plans disturbed by some roundings repeat."""
    disturbed = [_disturbed(plan, np.random.default_rng(draw)) for draw in range(_DRAWS)]
    best: tuple[SampleVector, ...] = ()
    for seed in range(_SEEDS):
        first, *others = [make_vectors(each, machine, iterations, penalty, sample, seed) for each in (plan, *disturbed)]
        steady = [all(_repeats(one, each) for each in same) for one, *same in zip(first, *others, strict=True)]
        count = steady.index(False) if False in steady else len(steady)
        best = max(best, first[: max(count, 1)], key=len)
        if count == len(steady):
            break
    return best


def _disturbed(plan: OptimalPlan, rng: np.random.Generator) -> OptimalPlan:
    """The plan with the numbers that a loop starts from some roundings off."""

    def off(values: Array) -> Array:
        return np.asarray(values) * (1 + _ROUNDINGS * rng.normal(size=np.shape(values)))

    u = StageControls(off(plan.u), plan.duration)
    return replace(plan, u=u, multipliers=off(plan.multipliers), end_multipliers=off(plan.end_multipliers))


def _repeats(one: SampleVector, other: SampleVector) -> bool:
    """Whether two samples decide alike, with controls within half of what the example allows."""
    allowed = _TOLERANCES["float"] / 2 * np.maximum(1, np.abs(one.u))
    return one.held == other.held and bool(np.all(np.abs(np.subtract(one.u, other.u)) <= allowed))


def make_vectors(
    plan: OptimalPlan, machine: InterpretedMachine, iterations: int, penalty: float, sample: float, seed: int = 0
) -> tuple[SampleVector, ...]:
    """Samples along the plan with a little noise, seeded, and the controls by the numpy solver."""
    data, rng = plan.problem, np.random.default_rng(seed)
    space = machine.workspace()
    rows, h = np.ascontiguousarray(plan.parameters), data.duration / data.intervals
    space["x"][0, 0] = np.concatenate([pack_element(data, plan.X[0]), plan.z[0]])
    space["u"][0], space["rho"], space["fresh"], space["sample"] = plan.u, penalty, 1, sample
    space["lambda"][0], space["lambda_end"][0] = plan.multipliers, plan.end_multipliers
    run = Run(space[0], rows, 0.0)
    for k in range(data.intervals):
        last = (space["x"][0, k], space["u"][0, k], run.row(k), k * h)
        space["x"][0, k + 1] = machine.model.step(*last, h)
    free = data.free_duration is not None
    x, vectors = np.array(space["x"][0, 0]), []
    if free:
        x[-1] = 1.0  # the plant's own time is counted in seconds
    for k in range(min(_SAMPLES, data.intervals)):
        X, z = unpack_elements(data, x[None])
        element = X[0] @ scipy.linalg.expm(data.group.hat(_NOISE * rng.normal(size=data.group.dim)))
        states = z[0] + _NOISE * rng.normal(size=len(z[0]))
        u = np.zeros(data.inputs.size)
        time = 0.0 if free else k * h
        status = machine.step(space, element, states, rows, time, iterations, u)
        flat = element.astype(complex).ravel().view(float) if data.group.is_complex else element.ravel()
        numbers = {"X": flat, "z": states, "u": u}
        listed = {name: tuple(map(float, values)) for name, values in numbers.items()}
        vectors.append(SampleVector(**listed, held=status == HELD))
        x = machine.advance(x, u, run.row(k), time, sample, 1)
    return tuple(vectors)


def _manifest(view: SolverView, budget: Budget, tree: Mapping[str, str]) -> str:
    data: dict[str, Any] = {
        "generator": GENERATOR,
        "format": 1,
        "namespace": view.prefix,
        "real": view.real,
        "problem": list(view.summary),
        "intervals": view.intervals,
        "workspace_bytes": view.bytes,
        "stack_bytes": budget.stack,
        "operations_usual": budget.usual,
        "operations_worst": budget.worst,
        "sweeps_worst": budget.sweeps,
        "rollouts_worst": budget.rollouts,
        "files": {path: hashlib.sha256(text.encode()).hexdigest() for path, text in sorted(tree.items())},
    }
    return json.dumps(data, indent=2, ensure_ascii=False) + "\n"
