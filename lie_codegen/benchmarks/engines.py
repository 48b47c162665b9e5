"""lie-codegen bench engines: the engines of lc.steer on the same random tasks, kind by kind; what method="auto" follows.

A task is the end of random controls that keep what the kind asks for, so that it can be met. Wall time of a repeated solution, engine after
engine in turn, and of a first one with what has to be compiled; a plan counts where its true end is met and its bounds hold, and as good where its cost is at most 1 % above the best of all.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import LieCodegenError
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.groups.catalogue_load import group as catalogue_group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.front import steer

_NEAR, _GOOD, _PIECES = 1e-6, 1.01, 12
System = tuple[str, tuple[str, ...], tuple[float, ...]]
#: Group, controls, and drift of the kinds that have one.
SYSTEMS: tuple[System, ...] = (
    ("so3", ("w1", "w2"), (0, 0, 0.7)),
    ("se2", ("omega", "vx"), (0, 0, 0.5)),
    ("su2", ("sx", "sy"), (0, 0, 0.5)),
    ("se3", ("w1", "w2", "w3"), (0, 0, 0, 1, 0, 0)),
)
#: Of kinds with one control: bounded, in a drift, they cannot stop.
SINGLE: tuple[System, ...] = (
    ("so3", ("w1",), (0, 0, 1)),
    ("se2", ("omega",), (0, 1, 0)),
    ("su2", ("sx",), (0, 0, 1)),
)
#: kind: (with bounds, with drift, objective).
KINDS = {
    "energy": (False, False, "energy"),
    "energy, bounds": (True, False, "energy"),
    "energy, drift": (False, True, "energy"),
    "energy, bounds, drift": (True, True, "energy"),
    "energy, bounds, at the edge": (True, False, "energy"),
    "energy, bounds, one control and drift": (True, True, "energy"),
    "least time, bounds": (True, False, "time"),
    "least time, bounds, drift": (True, True, "time"),
    "least time, bounds, one control and drift": (True, True, "time"),
}
#: What method="auto" takes.
AUTO = {kind: "optimal" if kind == "energy" else "direct" for kind in KINDS}
ENGINES = ("optimal", "direct", "ocp", "transcription")
_BOUND, _DURATION = 2.0, 2.0


@dataclass(frozen=True)
class EngineRow:
    """One engine on one kind of task.

    Attributes:
        kind, engine: names.
        solved, good, tasks: ends met within the bounds; and as cheap as the best found to 1 %; of how many.
        median_ms: of a repeated solution.
        first_ms: of a system's first call, the median over systems: with what it has to compile where the cache has it not yet.
    """

    kind: str
    engine: str
    solved: int
    good: int
    tasks: int
    median_ms: float
    first_ms: float


def bench_engines(
    count: int = 3, seed: int = 0, only: str = "", say: Callable[[str], None] = lambda line: None
) -> list[EngineRow]:
    """A row for each kind and engine, over `count` targets of each system."""
    rows: list[EngineRow] = []
    for kind in KINDS:
        if only in kind:
            rows += _rows(kind, count, seed, say)
    return rows


def missed(rows: Sequence[EngineRow]) -> list[str]:
    """Kinds of which another engine solves more than the one that method="auto" takes (decision 23)."""
    found = []
    for kind, engine in AUTO.items():
        own = {row.engine: row.solved for row in rows if row.kind == kind}
        better = [other for other, solved in own.items() if engine in own and solved > own[engine]]
        if better:
            found.append(f"{kind}: more are solved by {', '.join(better)} than by {engine}, which auto takes")
    return found


def table(rows: Sequence[EngineRow], misses: Sequence[str] = ()) -> str:
    """The rows as a text."""
    lines = [f"{'':44}{'':15}{'solved':>9}{'good':>7}{'ms':>10}{'first ms':>10}"]
    for row in rows:
        solved = f"{row.solved}/{row.tasks}"
        lines.append(f"{row.kind:44}{row.engine:15}{solved:>9}{row.good:>7}{row.median_ms:10.1f}{row.first_ms:10.0f}")
    return "\n".join([*lines, *(f"missed: {text}" for text in misses)])


def _rows(kind: str, count: int, seed: int, say: Callable[[str], None]) -> list[EngineRow]:
    found: dict[str, list[tuple[float, float]]] = {engine: [] for engine in ENGINES}
    firsts: dict[str, list[float]] = {engine: [] for engine in ENGINES}
    for name, controls, drift in SINGLE if "one control" in kind else SYSTEMS:
        group = catalogue_group(name)
        for number, (target, options) in enumerate(tasks(group, controls, drift, kind, count, seed)):
            for engine in ENGINES:
                say(f"{kind}: {name}, {engine}")
                attempt = _attempt(group, target, controls, engine, options)
                if attempt is not None:
                    found[engine].append(attempt[:2])
                    firsts[engine] += [attempt[2]] if number == 0 else []
    totals = max(len(each) for each in found.values())
    tried = {engine: each for engine, each in found.items() if each}
    best = np.min([[cost for cost, _ in each] for each in tried.values()], axis=0)
    return [
        EngineRow(
            kind, engine, sum(np.isfinite(cost) for cost, _ in each),
            sum(cost <= _GOOD * least for (cost, _), least in zip(each, best, strict=True) if np.isfinite(cost)),
            totals, float(np.median([ms for _, ms in each])), float(np.median(firsts[engine])),
        )
        for engine, each in tried.items()
    ]  # fmt: skip


def tasks(
    group: MatrixGroup, controls: Sequence[str], drift: Sequence[float], kind: str, count: int, seed: int
) -> list[tuple[Array, dict[str, Any]]]:
    """(target, options of steer): ends of random constant pieces within nine tenths of the bounds; or, at their edge, of pieces on them."""
    bounded, drifting, objective = KINDS[kind]
    if not drifting and group.name == "se3":
        return []  # three rates alone do not move it
    rng = np.random.default_rng([seed, *group.name.encode()])
    places = [group.algebra.index(label) for label in controls]
    constant = np.array(drift, dtype=float) if drifting else np.zeros(group.dim)
    made = []
    for _ in range(count):
        X = np.eye(group.degree)
        drawn = rng.uniform(-0.9 * _BOUND, 0.9 * _BOUND, (_PIECES, len(places)))
        if "edge" in kind:
            # one sign a half of the way: what slack is left is what the order of two motions gains
            drawn = _BOUND * np.repeat(np.sign(drawn[:2]), _PIECES // 2, axis=0)
        for u in drawn:
            xi = constant.copy()
            xi[places] += u
            X = X @ expm(group.hat(xi) * (_DURATION / _PIECES))
        options: dict[str, Any] = {"objective": objective} if objective != "energy" else {}
        if bounded:
            options["bounds"] = _BOUND
        if drifting:
            options["drift"] = constant
        made.append((X, options))
    return made


def _attempt(
    group: MatrixGroup, target: Array, controls: Sequence[str], engine: str, options: Mapping[str, Any]
) -> tuple[float, float, float] | None:
    """(cost, ms, ms of the first call); infinite cost where it found nothing; None where the engine does not do it."""
    given, duration = dict(options), (_DURATION if options.get("objective") != "time" else 1.0)
    if engine == "optimal" and given:
        return None
    span: Any = duration
    if engine == "ocp" and given.pop("objective", "") == "time":
        given["cost"], span = "1 + 1e-6*norm2(u)", (0.05, 20.0)

    def solve() -> float:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                plan = steer(group, target, controls, span, method=engine, **given)
        except LieCodegenError:
            return float("inf")
        if not plan.error <= _NEAR:
            return float("inf")
        return float(plan.duration if options.get("objective") == "time" else plan.cost)

    began = time.perf_counter()
    solve()  # compiled, cached, warmed up
    warm = time.perf_counter()
    cost = solve()
    return cost, 1e3 * (time.perf_counter() - warm), 1e3 * (warm - began)
