"""The same steering tasks by our solvers and by what a user would pick instead, interleaved in one process.

    python -m lie_codegen.benchmarks.steering so3 20
    python -m lie_codegen.benchmarks.steering so3-cone 25 --json

Tasks: h3, se2, so3, se3 (minimum energy in unit time); so3-cone, se2-disc (something in the way), so3-time (as fast as
|u| <= 2 allows). N = 50 intervals for everybody. A peer that is not installed has a row that says so. Costs are compared with the
best of all solvers, target by target; those of piecewise constant controls are 1e-4 to 1e-2 above the continuum's.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.benchmarks.steering_cases import Case, Problem, Solver, cases, problem
from lie_codegen.benchmarks.steering_crocoddyl import crocoddyl_row
from lie_codegen.benchmarks.steering_opti import expert_opti_row, plain_opti_row
from lie_codegen.benchmarks.steering_ours import shooting_row, transcription_row
from lie_codegen.benchmarks.steering_rockit import rockit_row
from lie_codegen.benchmarks.steering_scipy import slsqp_row

_EVERYBODY: dict[str, Callable[[Problem], Solver]] = {
    "shooting in C": shooting_row,
    "transcription": transcription_row,
    "Opti + ipopt, plain": plain_opti_row,
    "Opti + ipopt, expert": expert_opti_row,
    "rockit + ipopt": rockit_row,
    "crocoddyl FDDP, Python model": crocoddyl_row,
    "scipy SLSQP, CasADi gradients": slsqp_row,
}
_CONSTRAINED = ("transcription", "Opti + ipopt, plain", "Opti + ipopt, expert")
_NO_PACKAGE = {"acados": "no package to install by pip: built from source only, not measured"}
_SLACK = 1.01


@dataclass(frozen=True)
class Row:
    """One solver over all targets.

    Attributes:
        solver: its name.
        median_ms, least_ms, cpu_ms: wall time, median and smallest, and median processor time, over all targets.
        solved: share of targets reached.
        cost_over_best: median ratio to the best cost of all solvers, over the targets it solved.
        global_share: share of targets within 1 % of the best of all solvers.
        over_shooting, over_transcription: its median wall time over ours, NaN where ours has no row.
        note: why there are no numbers.
    """

    solver: str
    median_ms: float = float("nan")
    least_ms: float = float("nan")
    cpu_ms: float = float("nan")
    solved: float = float("nan")
    cost_over_best: float = float("nan")
    global_share: float = float("nan")
    over_shooting: float = float("nan")
    over_transcription: float = float("nan")
    note: str = ""


@dataclass(frozen=True)
class _Runs:
    """Seconds, processor seconds and costs, one a target."""

    seconds: list[float]
    cpu: list[float]
    costs: list[float]


def bench_steering(name: str, targets: int = 20, seed: int = 0) -> list[Row]:
    """One row a solver, ours first; a row with a note where a peer is missing."""
    asked = problem(name)
    solvers, missing = _installed(asked)
    todo = cases(asked, targets, seed)
    for solve in solvers.values():
        solve(todo[0])
    runs = {solver: _Runs([], [], []) for solver in solvers}
    for case in todo:
        for solver, solve in solvers.items():
            _timed(runs[solver], solve, case)
    best = np.nanmin([run.costs for run in runs.values()], axis=0)
    medians = {solver: float(np.median(run.seconds)) for solver, run in runs.items()}
    return [_row(solver, run, best, medians) for solver, run in runs.items()] + missing


def _installed(asked: Problem) -> tuple[dict[str, Solver], list[Row]]:
    solvers: dict[str, Solver] = {}
    missing: list[Row] = []
    for name, make in _EVERYBODY.items():
        if asked.what != "energy" and name not in _CONSTRAINED:
            continue
        try:
            solvers[name] = make(asked)
        except ImportError as error:
            missing.append(Row(name, note=f"not installed: {error.name}"))
    if asked.what == "energy":
        missing += [Row(name, note=note) for name, note in _NO_PACKAGE.items()]
    return solvers, missing


def _timed(run: _Runs, solve: Solver, case: Case) -> None:
    wall, cpu = time.perf_counter(), time.process_time()
    run.costs.append(solve(case))
    run.seconds.append(time.perf_counter() - wall)
    run.cpu.append(time.process_time() - cpu)


def _row(solver: str, run: _Runs, best: Array, medians: dict[str, float]) -> Row:
    costs = np.array(run.costs)
    good = np.isfinite(costs)
    return Row(
        solver,
        median_ms=1e3 * medians[solver],
        least_ms=1e3 * min(run.seconds),
        cpu_ms=1e3 * float(np.median(run.cpu)),
        solved=float(np.mean(good)),
        cost_over_best=float(np.median(costs[good] / best[good])) if np.any(good) else float("nan"),
        global_share=float(np.mean(np.where(good, costs, np.inf) <= _SLACK * best)),
        over_shooting=medians[solver] / medians.get("shooting in C", float("nan")),
        over_transcription=medians[solver] / medians["transcription"],
    )


def main(arguments: Sequence[str]) -> None:
    """Prints a table, or with --json one JSON object a row."""
    words = [word for word in arguments if not word.startswith("-")]
    rows = bench_steering(words[0] if words else "so3", int(words[1]) if len(words) > 1 else 20)
    if "--json" in arguments:
        for row in rows:
            sys.stdout.write(json.dumps({k: v for k, v in asdict(row).items() if v == v}) + "\n")
        return
    titles = ("median", "least", "cpu ms", "solved", "cost/best", "global", "/shoot", "/transcr")
    sys.stdout.write(f"{'':32}" + "".join(f"{title:>11}" for title in titles) + "\n")
    for row in rows:
        *numbers, note = list(asdict(row).values())[1:]
        cells = "  " + note if note else "".join("" if v != v else f"{v:11.4g}" for v in numbers)
        sys.stdout.write(f"{row.solver:32}{cells}\n")


if __name__ == "__main__":
    main(sys.argv[1:])
