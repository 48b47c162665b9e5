"""lie-codegen bench steering: the same bounded tasks by the direct method and by what a user would pick instead, in one run.

Success is judged alike for everybody: the controls found are played by exponentials, and must end within 1e-4 of the target (its
nearest phase where the phase is free); ipopt's are exact to its integration alone, which is why the bar is not lower. Time runs until
the first start that succeeds, or until all have failed. A peer that took a hundred times our time on each of the first three targets is
asked no more: its row counts these three. GRAPE only reaches, as our second row does. Least time of cars stands beside
closed forms, which tell whether ours is the shortest and are no rivals in speed.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.benchmarks.bounded_cases import BoundedCase, bounded_cases
from lie_codegen.benchmarks.bounded_peers import PEERS, Start
from lie_codegen.benchmarks.bounded_time import CARS, least_times
from lie_codegen.errors import ComputationError, SteeringError
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.steering.direct.method import direct
from lie_codegen.steering.goals import UpToPhase

_STARTS = 6
_PATIENCE = 60.0  # seconds on one target after which a peer gets no further start
_NEAR = 1e-4
#: After so many targets a peer that took so many times our time on each of them is asked no more.
_FEW, _OUTRUN = 3, 100.0
#: Times that the quickest solver that succeeds as often should take ours.
_GOAL = 5.0
_OURS = "lie_codegen"


@dataclass(frozen=True)
class BoundedRow:
    """One solver on one task.

    Attributes:
        task, solver: names.
        solved, targets: targets reached, of how many that were asked for.
        starts: mean number of starts that took.
        median_ms: wall time a target.
        over_ours, over_reaching: that over the direct method's with least energy, and when it only reaches.
        cost: median int |u|^2 dt of what was reached, or the median duration.
        note: why there are no numbers.
    """

    task: str
    solver: str
    solved: int = 0
    targets: int = 0
    starts: float = float("nan")
    median_ms: float = float("nan")
    over_ours: float = float("nan")
    over_reaching: float = float("nan")
    cost: float = float("nan")
    note: str = ""


def bench_bounded(
    targets: int = 10, seed: int = 0, only: str = "", say: Callable[[str], None] | None = None
) -> list[BoundedRow]:
    """One row for each task and solver, ours first."""
    rows: list[BoundedRow] = []
    for case in bounded_cases(targets, seed):
        if only.lower() not in case.name.lower():
            continue
        ours = _row(case, "lie_codegen, least energy", _ours(case, "energy"), None)
        rows.append(ours)
        reaching = _row(case, "lie_codegen, reach only", _ours(case, "none"), ours.median_ms)
        rows.append(reaching)
        for name, make in PEERS.items():
            if say is not None:
                say(f"{case.name}: {name}")
            try:
                rows.append(_row(case, name, make(case), ours.median_ms, reaching.median_ms))
            except ImportError as error:
                rows.append(BoundedRow(case.name, name, note=f"not installed: {error.name}"))
            except ComputationError as error:
                rows.append(BoundedRow(case.name, name, note=str(error)))
    for car in CARS:
        if only.lower() in car.lower():
            if say is not None:
                say(car)
            rows += _cars(car, targets, seed)
    return rows


def missed(rows: Sequence[BoundedRow]) -> list[str]:
    """Tasks in which another solver reaches more targets than we do, or in which the quickest of those that reach as many is less than
    five times slower: with least energy for a solver that minimises it, reaching only for GRAPE. A closed form may be quicker."""
    found: list[str] = []
    for task in dict.fromkeys(row.task for row in rows):
        mine = [row for row in rows if row.task == task and row.solver.startswith(_OURS)]
        for row in rows:
            if row.note or row.task != task or row in mine:
                continue
            same = mine[-1] if "GRAPE" in row.solver else mine[0]
            theirs, our = row.solved * same.targets, same.solved * row.targets  # as shares, over one denominator
            if theirs > our:
                found.append(
                    f"{task}: {row.solver} reaches {row.solved} of {row.targets}, {same.solver} {same.solved} of {same.targets}"
                )
            elif theirs == our and row.median_ms < _GOAL * same.median_ms and not row.solver.startswith("closed"):
                found.append(
                    f"{task}: {row.solver} takes {row.median_ms / same.median_ms:.2g} times our time, goal {_GOAL:g}"
                )
    return found


def table(rows: Sequence[BoundedRow], misses: Sequence[str] = ()) -> str:
    """The rows as a text, and what falls short of the goal."""
    lines = [f"{'':44}{'solved':>9}{'starts':>8}{'ms':>11}{'/ours':>9}{'/reach':>9}{'cost':>10}"]
    last = ""
    for row in rows:
        if row.task != last:
            lines.append(row.task)
            last = row.task
        if row.note:
            lines.append(f"  {row.solver:42}  -  {row.note}")
            continue
        numbers = f"{row.starts:8.1f}{row.median_ms:11.1f}{row.over_ours:9.2f}{row.over_reaching:9.2f}{row.cost:10.4f}"
        lines.append(f"  {row.solver:42}{f'{row.solved}/{row.targets}':>9}{numbers}")
    return "\n".join([*lines, *(f"missed: {miss}" for miss in misses)])


def _ours(case: BoundedCase, objective: str) -> Start:
    """The direct method, constant pieces; its own starts count as one."""

    def start(target: Array, seed: int) -> Array | None:
        try:
            plan = direct(
                case.group,
                UpToPhase(target) if case.up_to_phase else target,
                list(case.directions),
                case.duration,
                drift=case.drift,
                bounds=case.bound,
                pieces=case.pieces,
                seed=seed,
                polish=False,
                objective=objective,
                starts=16 if objective == "energy" else 8,
            )
        except SteeringError:
            return None
        return np.asarray(plan.details["pieces"].first)

    return start


def _cars(car: str, targets: int, seed: int) -> list[BoundedRow]:
    """One row for each solver of a car's least time; solved is as short as the shortest that anybody found."""
    found = least_times(car, targets, seed)
    timed = {name: each for name, each in found.items() if not isinstance(each, str)}
    shortest = np.min([each.durations for each in timed.values()], axis=0)
    ours = float(np.median(next(iter(timed.values())).seconds))
    rows = []
    for name, each in found.items():
        if isinstance(each, str):
            rows.append(BoundedRow(car, name, note=each))
            continue
        median = float(np.median(each.seconds))
        solved, cost = each.solved(shortest), float(np.median(each.durations))
        rows.append(BoundedRow(car, name, solved, targets, 1.0, 1e3 * median, median / ours, cost=cost))
    return rows


def _row(case: BoundedCase, name: str, start: Start, ours: float | None, reaching: float | None = None) -> BoundedRow:
    start(case.targets[0], 1000)  # compiled, cached, warmed up
    seconds, tries, costs = [], [], []
    for number, target in enumerate(case.targets):
        began = time.perf_counter()
        for attempt in range(_STARTS):
            u = start(target, 100 * number + attempt)
            if u is not None or time.perf_counter() - began > _PATIENCE:
                break
        seconds.append(time.perf_counter() - began)
        tries.append(attempt + 1)
        if u is not None and _miss(case, target, u) < _NEAR:
            costs.append(float(np.sum(u**2)) * case.duration / case.pieces)
        if ours and len(seconds) == _FEW and 1e3 * min(seconds) > _OUTRUN * ours:
            break
    median = 1e3 * float(np.median(seconds))
    return BoundedRow(
        case.name,
        name,
        len(costs),
        len(seconds),
        float(np.mean(tries)),
        median,
        median / (ours or median),
        median / (reaching or median) if reaching else float("nan"),
        float(np.median(costs)) if costs else float("nan"),
    )


def _miss(case: BoundedCase, target: Array, u: Array) -> float:
    """|X - target| of constant controls played by exponentials, infinite where a bound is broken."""
    if np.max(np.abs(u)) > case.bound * (1 + 1e-6):
        return np.inf
    X = np.eye(case.group.degree, dtype=case.group.basis.dtype)
    for step in expm(case.group.hat(case.duration / case.pieces * (case.drift + u @ case.directions))):
        X = X @ step
    if case.up_to_phase:
        overlap = np.vdot(target, X)
        target = overlap / abs(overlap) * target
    return float(np.max(np.abs(X - target)))
