"""What is stated of open optimal control, held against the rows of `lie-codegen bench control`; and that everybody solves one program."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.ocp.plan import OptimalPlan

OURS, SAMPLE = "lie_codegen, one start", "lie_codegen, a sample"
FATROP, FATROP_COMPILED = "fatrop, interpreted", "fatrop, compiled"
ROTORS, BOX_FDDP, ITERATION = "lie_codegen, rotors", "crocoddyl box-FDDP, rotors", "crocoddyl, an iteration"
#: (solver, at most so many ms).
LIMITS = ((OURS, 5.0), (SAMPLE, 0.3))
#: (solver, at least so many times our time).
RATIOS = ((FATROP, 30.0), (FATROP_COMPILED, 5.0), (ITERATION, 10.0))
#: Two charts of a Runge-Kutta step differ by their error.
_CHARTS = 2e-3
_ROUNDING = 1e-7


@dataclass(frozen=True)
class ControlRow:
    """One solver.

    Attributes:
        solver: its name.
        solved, good, tasks: tasks whose conditions are met; and as cheap as the best found to 1 %; of how many.
        median_ms, p95_ms: of a solution, processor time (of a sample: wall time).
        over_ours: median of the ratio to ours, task by task.
        iterations: median.
        cost: of the last task.
        note: why there are no numbers.
    """

    solver: str
    solved: int = 0
    good: int = 0
    tasks: int = 0
    median_ms: float = float("nan")
    p95_ms: float = float("nan")
    over_ours: float = float("nan")
    iterations: float = float("nan")
    cost: float = float("nan")
    note: str = ""


def table(rows: Sequence[ControlRow], misses: Sequence[str] = ()) -> str:
    """The rows as a text."""
    lines = [f"{'':30}{'solved':>9}{'good':>7}{'ms':>10}{'p95':>10}{'/ours':>9}{'its':>7}"]
    for row in rows:
        if row.note:
            lines.append(f"{row.solver:30}  -  {row.note}")
            continue
        numbers = f"{row.median_ms:10.2f}{row.p95_ms:10.2f}{row.over_ours:9.1f}{row.iterations:7.0f}"
        lines.append(f"{row.solver:30}{f'{row.solved}/{row.tasks}':>9}{row.good:>7}{numbers}")
    return "\n".join([*lines, *(f"missed: {text}" for text in misses)])


def missed(rows: Sequence[ControlRow]) -> list[str]:
    """What is stated and does not hold: tasks solved, limits of time, ratios to the solvers that took part, agreement of costs."""
    found = []
    by_name = {row.solver: row for row in rows if not row.note}
    if (ours := by_name.get(OURS)) is not None and ours.solved < ours.tasks:
        found.append(f"{OURS}: {ours.solved} of {ours.tasks} solved")
    for name, limit in LIMITS:
        if (row := by_name.get(name)) is not None and not row.median_ms <= limit:
            found.append(f"{name}: {row.median_ms:.3g} ms, wanted at most {limit:g}")
    for name, least in RATIOS:
        if (row := by_name.get(name)) is not None and not row.over_ours >= least:
            found.append(f"{name}: {row.over_ours:.3g} times our time, wanted at least {least:g}")
    if ROTORS in by_name and BOX_FDDP in by_name:
        mine, theirs = by_name[ROTORS].cost, by_name[BOX_FDDP].cost
        if not abs(theirs - mine) <= _CHARTS * abs(mine):
            found.append(f"{BOX_FDDP}: its optimum {theirs:.6g} is not ours, {mine:.6g}: no comparison")
    return found


def disagreement(plan: OptimalPlan, task: Array, nlp: dict[str, Any], limits: tuple[Array, Array]) -> str:
    """Why our solution, put into the peers' program, is not a point of it with our cost; "" where it is one.

    So both have one discretisation and one cost: before anything is timed.
    """
    states = np.hstack([plan.X[:, :3, :3].reshape(-1, 9), plan.X[:, :3, 3], plan.z])
    x = np.concatenate([np.hstack([states[:-1], np.asarray(plan.u)]).ravel(), states[-1]])
    f, g = ca.Function("program", [nlp["x"], nlp["p"]], [nlp["f"], nlp["g"]])(x, task)
    values = np.array(g).ravel()
    off = float(np.max(np.maximum(limits[0] - values, values - limits[1])))
    if not off <= _ROUNDING:
        return f"our motion misses the peers' conditions by {off:.2g}"
    if not abs(float(f) - plan.cost) <= _ROUNDING * abs(plan.cost):
        return f"our cost is {plan.cost:.9g}, the peers' of the same motion {float(f):.9g}"
    return ""
