"""lie-codegen bench control: a quadrotor among cylinders, the same discretisation and cost, by lc.ocp and by CasADi's solvers.

Everybody minimises sum_k h |r(x_k, u_k)|^2 / 2 + |r_N(x_N)|^2 / 2 over 30 intervals of RKMK4 on SE(3) from hovering controls; the peers'
states are matrix entries, their functions scalar expressions (SX), interpreted, or written as C and compiled beforehand. Processor time of the
solver alone, cold, one thread, task by task in turn; a solution counts where its conditions hold to 1e-4 and its cost is not more than 1 % above the best of all.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.benchmarks.open_claims import (
    BOX_FDDP,
    FATROP,
    FATROP_COMPILED,
    ITERATION,
    OURS,
    ROTORS,
    SAMPLE,
    ControlRow,
    disagreement,
    missed,
)
from lie_codegen.benchmarks.open_crocoddyl import HOVER as ROTOR_HOVER
from lie_codegen.benchmarks.open_crocoddyl import crocoddyl_solver, rotors, survives
from lie_codegen.benchmarks.open_quadrotor import HOVER, INTERVALS, Tasks, program, quadrotor, tasks
from lie_codegen.errors import CompileError
from lie_codegen.runtime.compiler import compile_library, find_compilers
from lie_codegen.steering.ocp.mpc import mpc
from lie_codegen.steering.plan import Status

_NEAR = 1e-4
_GOOD = 1.01
#: Solutions of the body on rotors, of which the quickest counts; the first is not.
_TIMES = 21
#: A peer's solution: controls are not compared, cost and violation are.
Outcome = tuple[float, float, float]


def bench_control(
    count: int = 20, seed: int = 0, say: Callable[[str], None] = lambda line: None
) -> tuple[list[ControlRow], list[str]]:
    """A row for each solver, ours first, then ours in the loop, then the body on rotors: ours and crocoddyl's; and what of that which is
    stated was missed. Nothing is timed before our solution is a point of the peers' program with our cost."""
    given = tasks(count, seed)
    nlp, _, _, limits, _ = program()
    first = quadrotor().solve(target=given[0][:3], cyl=given[0][3:], threads=1)
    if said := disagreement(first, given[0], nlp, limits):
        return [], [said]
    outcomes: dict[str, list[Outcome]] = {}
    notes: dict[str, str] = {}
    iterations: dict[str, list[float]] = {}
    solvers: dict[str, Callable[[], Callable[[Array], tuple[Outcome, float]]]] = {
        OURS: _ours,
        FATROP: lambda: _peer("fatrop", compiled=False),
        FATROP_COMPILED: lambda: _peer("fatrop", compiled=True),
        "ipopt, interpreted": lambda: _peer("ipopt", compiled=False),
    }
    made: dict[str, Callable[[Array], tuple[Outcome, float]]] = {}
    for name, make in solvers.items():
        say(name)
        try:
            made[name] = make()
        except (RuntimeError, CompileError) as error:
            notes[name] = str(error).splitlines()[0]
            continue
        made[name](given[0])  # compiled, cached, warmed up
    for task in given:
        for name, solve in made.items():
            outcome, steps = solve(task)
            outcomes.setdefault(name, []).append(outcome)
            iterations.setdefault(name, []).append(steps)
    best = np.min([[cost if off <= _NEAR else np.inf for cost, off, _ in each] for each in outcomes.values()], axis=0)
    ours = np.array([ms for _, _, ms in outcomes[OURS]])
    rows = [_row(name, outcomes[name], iterations[name], best, ours) for name in outcomes]
    rows += [ControlRow(name, note=note) for name, note in notes.items()]
    rows = [*rows, _loop_row(given), *_rotor_rows(say)]
    return rows, missed(rows)


def _row(name: str, found: list[Outcome], steps: list[float], best: Array, ours: Array) -> ControlRow:
    times = np.array([ms for _, _, ms in found])
    met = np.array([off <= _NEAR for _, off, _ in found])
    cheap = met & (np.array([cost for cost, _, _ in found]) <= _GOOD * best)
    return ControlRow(
        name, int(np.sum(met)), int(np.sum(cheap)), len(found), float(np.median(times)), float(np.percentile(times, 95)),
        float(np.median(times / ours)), float(np.median(steps)), found[-1][0],
    )  # fmt: skip


def _ours() -> Callable[[Array], tuple[Outcome, float]]:
    problem = quadrotor()

    def solve(task: Array) -> tuple[Outcome, float]:
        began = time.process_time()
        plan = problem.solve(target=task[:3], cyl=task[3:], threads=1)
        ms = 1e3 * (time.process_time() - began)
        return (plan.cost, plan.violation, ms), float(plan.iterations)

    return solve


def _peer(solver: str, *, compiled: bool) -> Callable[[Array], tuple[Outcome, float]]:
    """CasADi's solver of the same program.

    Raises:
        RuntimeError: CasADi was built without it.
        CompileError: its C text does not compile.
    """
    nlp, lower, upper, limits, equalities = program()
    options: dict[str, Any] = {"print_time": False, "expand": True}
    if solver == "fatrop":
        options |= {"structure_detection": "auto", "equality": equalities, "fatrop": {"print_level": 0, "tol": 1e-8}}
    else:
        options |= {"ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-8}}
    made = ca.nlpsol("peer", solver, nlp, options)
    if compiled:
        folder = Path(tempfile.mkdtemp(prefix="lie_codegen-bench-"))
        generator = ca.CodeGenerator("model.c")
        generator.add(ca.Function("nlp", [nlp["x"], nlp["p"]], [nlp["f"], nlp["g"]], ["x", "p"], ["f", "g"]))
        for name in made.get_function():
            generator.add(made.get_function(name))
        (folder / "model.c").write_text(generator.dump())
        compilers = find_compilers()
        if not compilers:
            raise CompileError("no C compiler")
        compile_library(compilers[0], folder, "model.c", "model.so", ("-O2", "-march=native", "-fPIC", "-shared"))
        options.pop("expand")
        made = ca.nlpsol("peer", solver, str(folder / "model.so"), options)
    guess = first_guess()

    def solve(task: Array) -> tuple[Outcome, float]:
        began = time.process_time()
        found = made(x0=guess, p=task, lbx=lower, ubx=upper, lbg=limits[0], ubg=limits[1])
        ms = 1e3 * (time.process_time() - began)
        g = np.array(found["g"]).ravel()
        off = float(np.max(np.maximum(limits[0] - g, g - limits[1]), initial=0.0))
        return (float(found["f"]), off, ms), float(made.stats().get("iter_count", -1))

    return solve


def first_guess() -> Array:
    """Hovering where it is: states of rest, controls of hover, stage by stage."""
    state = np.concatenate([np.eye(3).ravel(), np.zeros(6)])
    return np.concatenate([np.tile(np.concatenate([state, HOVER]), INTERVALS), state])


def _loop_row(given: Tasks) -> ControlRow:
    """Warm samples: the loop around its own model, from Python."""
    problem = quadrotor()
    seconds: list[float] = []
    for task in given[:5]:
        plan = problem.solve(target=task[:3], cyl=task[3:], threads=1)
        if plan.status is not Status.SOLVED:
            continue
        controller = mpc(problem)
        controller.reset(plan)
        seconds += list(controller.simulate(steps=60, noise=0.002).seconds)
    ms = 1e3 * np.array(seconds)
    return ControlRow(
        SAMPLE, len(ms), len(ms), len(ms), float(np.median(ms)),
        float(np.percentile(ms, 95)), float("nan"), 1.0,
    )  # fmt: skip


def _rotor_rows(say: Callable[[str], None]) -> list[ControlRow]:
    """The body on rotors: a solution of ours, an iteration of ours, and crocoddyl's of both, minima of processor time in turn."""
    names = (ROTORS, BOX_FDDP)
    say(names[1])
    problem = rotors()

    def ours() -> tuple[float, int]:
        plan = problem.solve(guess=np.full(4, ROTOR_HOVER), threads=1, curvature=False)
        return plan.cost, plan.iterations

    try:
        peer = crocoddyl_solver()
        survives()
    except (ImportError, RuntimeError) as error:
        return [_least(names[0], [_timed(ours) for _ in range(_TIMES)]), ControlRow(names[1], note=str(error))]

    def theirs() -> tuple[float, int]:
        solver = peer()
        return float(solver.cost), int(solver.iter) + 1

    pairs = [(_timed(ours), _timed(theirs)) for _ in range(_TIMES)]
    rows = [_least(names[i], [pair[i] for pair in pairs]) for i in (0, 1)]
    first = rows[0].median_ms
    rows = [replace(row, over_ours=row.median_ms / first) for row in rows]
    own, peers = (row.median_ms / row.iterations for row in rows)
    return [*rows, ControlRow(ITERATION, 1, 1, 1, peers, peers, peers / own, 1.0)]


def _timed(solve: Callable[[], tuple[float, int]]) -> tuple[float, int, float]:
    """Cost, iterations, milliseconds of processor time."""
    began = time.process_time()
    cost, iterations = solve()
    return cost, iterations, 1e3 * (time.process_time() - began)


def _least(name: str, found: Sequence[tuple[float, int, float]]) -> ControlRow:
    ms = np.array([each[2] for each in found[1:]])
    cost, steps, _ = found[0]
    return ControlRow(name, 1, 1, 1, float(np.min(ms)), float(np.percentile(ms, 95)), float("nan"), float(steps), cost)
