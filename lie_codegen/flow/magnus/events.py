"""Events along a Magnus flow: its states at every step, and fresh partial steps between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.flow.events import INNER, Event, EventHits, Function, find_events
from lie_codegen.flow.magnus import numpy_steps
from lie_codegen.flow.magnus.drive import Drive
from lie_codegen.flow.magnus.norms import norms_of
from lie_codegen.flow.magnus.run import MOST_STEPS, flow
from lie_codegen.flow.magnus.steps import plan_steps
from lie_codegen.groups.matrix_group import MatrixGroup


def run_events(
    group: MatrixGroup,
    drive: Drive,
    times: Array,
    start: Array,
    events: tuple[Event, ...],
    functions: tuple[Function, ...],
    order: int,
    longest: float,
) -> tuple[EventHits, ...]:
    """What is found of the events between the first and the last time, with steps no longer than those of the run."""
    where = f"simulate({group.name})"
    coarse = plan_steps(drive, norms_of(group), times, MOST_STEPS)
    widths = np.diff(coarse.knots) / coarse.parts if coarse is not None else np.empty(0)
    if coarse is None:
        return ()
    # The steps of the run, each with its two inner places as times of output.
    multiple = max(1, int(np.ceil(float(np.max(widths)) / longest * (1 - 1e-12))))
    starts, lengths = coarse.times(multiple).moments
    stops = np.append((starts[:, None] + lengths[:, None] * np.concatenate([[0.0], INNER])).ravel(), times[-1])
    fine = plan_steps(drive, norms_of(group), stops, MOST_STEPS)
    if fine is None:
        return ()
    X = np.concatenate([start[None], flow(group, drive, fine, order, start)])
    begins = X[0:-1:3]

    def inside(step: NDArray[np.intp], part: Array) -> tuple[Array, None]:
        D = numpy_steps.increments(group, drive, order, starts[step], part * lengths[step])
        return begins[step] + begins[step] @ D, None

    return find_events(events, functions, starts, lengths, (X, None), inside, where)
