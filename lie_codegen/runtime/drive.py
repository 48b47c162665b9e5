"""Loops whose input is a formula of time, evaluated in the loop itself; see templates/drive.c."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.runtime.arguments import dtype_of
from lie_codegen.runtime.drive_arguments import STAGES, Spans, Step, arguments_of
from lie_codegen.runtime.drive_loops import c_loop, drive_library, numpy_loop
from lie_codegen.runtime.formula_input import FormulaInput, formula_input
from lie_codegen.runtime.scans import Step as LoopStep
from lie_codegen.runtime.scans import check_loop
from lie_codegen.runtime.threads import CALLS, in_parts


def driven_loop(
    compiled: Step,
    start: Array,
    u: FormulaInput,
    spans: Spans,
    *,
    at: Mapping[str, float] = STAGES,
    others: Mapping[str, Any] | None = None,
    threads: int = 1,
) -> tuple[Array, float]:
    """The loop of a step kernel under u(t), states kept at the ends of the spans.

    Args:
        compiled: a kernel whose first output has the type of its first input.
        start: the state, or (T, *shape).
        u: the input.
        spans: the steps.
        at: port -> where in a step it reads u, 0 to 1.
        others: the remaining inputs by name: as for `scan_batch`; ports `h` and `t` that are not among them get the
            length of a step and the time at which it begins.
        threads: over which trajectories are shared out.

    Returns:
        (spans + 1, *shape), or (T, spans + 1, *shape) if start or u has T; and the largest |h u| of any step.

    Raises:
        InputError, ShapeError: naming the argument.
    """
    plan, many = arguments_of(compiled, start, u, spans, at, dict(others or {}))
    state = compiled.signature.inputs[0]
    found = np.empty((plan.count, spans.count + 1, *state.shape), dtype_of(state))
    moves: list[float] = [0.0]
    loop = c_loop if compiled.backend.loop_address(many=False) and drive_library() else numpy_loop

    def some(first: int, last: int) -> None:
        fixed = spans.knots is not None and plan.count == 1 and not any(step for _, step in plan.strides)
        # Ctrl-C is heard between two calls of C: a long run is cut where that changes no number, one trajectory from knot to knot.
        size = max(1, CALLS // spans.parts)
        if not fixed or spans.count <= size:
            moves.append(loop(compiled, plan, u, spans, first, last, found))
            return
        # One long run from knot to knot, in pieces: between two of them Python looks whether to stop.
        mine, knots = plan, np.asarray(spans.knots)
        found[0, 0] = plan.arrays[0][0]
        for begin in range(0, spans.count, size):
            part = Spans(min(size, spans.count - begin), spans.parts, knots[begin : begin + size + 1])
            made = np.empty((1, part.count + 1, *found.shape[2:]), found.dtype)
            moves.append(loop(compiled, mine, u, part, 0, 1, made))
            found[0, begin + 1 : begin + part.count + 1] = made[0, 1:]
            mine = replace(mine, arrays=[np.ascontiguousarray(made[:, -1]), *mine.arrays[1:]])

    in_parts(some, plan.count, threads, spans.count * spans.parts)
    return (found if many else found[0]), max(moves)


class _Iterated(Step, LoopStep, Protocol):
    """A compiled step."""


def driven(
    compiled: _Iterated,
    start: Any,
    u: Any,
    *,
    n: int,
    h: float,
    t0: float,
    every: int,
    at: Mapping[str, float] | None,
    others: Mapping[str, Any],
    threads: int,
) -> Array:
    """`Compiled.drive`: equal steps from t0 under an input of the user."""
    check_loop(compiled, "drive", n, every)
    for name, value in (("h", h), ("t0", t0)):
        if isinstance(value, bool) or not isinstance(value, (int, float, np.number)) or not np.isfinite(value):
            raise InputError(f"{compiled.name}.drive: {name} is a finite number, given {value!r}")
    formula = formula_input(u, float(t0), float(t0) + int(n) * float(h))
    if formula is None:
        raise InputError(
            f"{compiled.name}.drive: u must be a PeriodicInput of sines and cosines or of straight pieces, a SampledInput, "
            "or a FormulaInput; sample other functions and use scan"
        )
    spans = Spans(int(n) // int(every), int(every), None, float(t0), float(h))
    return driven_loop(compiled, start, formula, spans, at=at or STAGES, others=others, threads=threads)[0]
