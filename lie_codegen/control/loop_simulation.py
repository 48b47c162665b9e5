"""The ways that a closed loop goes: by its tolerance, by Gauss steps, in given steps, in steps that are halved until two runs agree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.control.curve_reference import CurveReference, check_curve
from lie_codegen.control.loop_adaptive import adaptive, by_gauss, loop_events
from lie_codegen.control.loop_library import several
from lie_codegen.control.loop_origin import narrower, run_in_steps
from lie_codegen.control.loop_prepared import Prepared
from lie_codegen.control.loop_readout import result_of
from lie_codegen.control.loop_result import ClosedLoop
from lie_codegen.control.loop_run import SILENT, Run, noise_stream, refined
from lie_codegen.control.loop_states import initial_own
from lie_codegen.control.reference_check import check_once
from lie_codegen.errors import InputError
from lie_codegen.flow.events import Event
from lie_codegen.identifiers import shown
from lie_codegen.runtime.threads import check_threads


def refuse(given: Mapping[str, Any], why: str) -> None:
    """Refuse what was given of these arguments.

    Raises:
        InputError: naming them.
    """
    stray = [name for name, value in given.items() if value is not None]
    if stray:
        raise InputError(f"closed_loop: {', '.join(stray)} {why}")


def loop_by(
    method: str, loop: Prepared, X0: ArrayLike | None, xi0: ArrayLike | None, states: Mapping[str, ArrayLike], seed: Any,
    runs: int | None, first: Any, threads: int, events: Sequence[Event],
) -> ClosedLoop:  # fmt: skip
    """The loop that was prepared, from its start; see `closed_loop`."""
    told, run = loop.told, _run(loop, X0, xi0, states, seed, runs, first, threads)
    by_pair = run.system is not None and run.system.compiled
    if method == "gauss":
        if told.step is None or not by_pair:
            raise InputError(
                'closed_loop: method="gauss" is of a law that acts continuously on a group; give it a step'
            )
        if events:
            raise InputError("closed_loop: events go with rtol, not with method='gauss'")
        equal = run_in_steps(run, told.model, told.reference)
        return result_of(equal, told, by_gauss(run, told.parts), told.parts, float("nan"))
    if events and (told.step is not None or not by_pair):
        raise InputError(
            "closed_loop: events are of a law that acts continuously on a group, with rtol; not with step or sample"
        )
    if told.step is not None:
        return result_of(run, told, run.states(told.parts), told.parts, float("nan"))
    if by_pair:
        pair = adaptive(run, told.rtol)
        hits = loop_events(run, pair, events) if events else ()
        return result_of(run, told, pair, 0, pair.error_estimate, hits)
    if run.system is not None:
        run = run_in_steps(run, told.model, told.reference)
    found, count, error = refined(run, told.rtol, narrower)
    return result_of(run, told, found, count, error)


def _run(
    loop: Prepared, X0: ArrayLike | None, xi0: ArrayLike | None, states: Mapping[str, ArrayLike], seed: Any, runs: int | None,
    first: Any, threads: int,
) -> Run:  # fmt: skip
    """The compiled loop with its numbers and its start."""
    told, model, library = loop.told, loop.loop, loop.library
    check_threads(threads)
    if told.reference is not None:
        ends = float(told.times[0]), float(told.times[-1])
        if isinstance(told.reference, CurveReference):
            check_curve(told.reference, *ends, library.reference.batch)
        else:
            check_once(told.reference, *ends, library.reference)
    start, many = model.plant.starts(X0, xi0)
    start, many = several(start, many, loop.loops, runs)
    if states or model.own_ports:
        start = initial_own(model, start, {**told.start, **states})
    stream = SILENT
    if model.noise or seed is not None or type(first) is not int or first:
        stream = noise_stream(model, _whole(seed, "seed", 0), _whole(first, "first", 0))
    sample = told.sample or 0.0
    return Run(
        model, library, start, many, told.times.copy(), loop.numbers, threads, sample, told.delay, stream, loop.system
    )


def _whole(value: Any, name: str, default: int) -> int:
    if value is None:
        return default
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 0:
        raise InputError(f"closed_loop: {name} is a whole number, not negative; given {shown(value)}")
    return int(value)
