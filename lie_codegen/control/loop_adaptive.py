"""Continuous loops by the pair 8(5,3): steps as long as the motion allows, errors judged at the times that were asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.control.loop_model import Loop
from lie_codegen.control.loop_rate import columns, moves_of, short_of
from lie_codegen.control.loop_run import Run
from lie_codegen.control.plants import GroupPlant
from lie_codegen.errors import InputError
from lie_codegen.flow.events import INNER, Event, EventHits, event_function, find_events
from lie_codegen.flow.gauss_steps import gauss
from lie_codegen.flow.pair853 import integrate
from lie_codegen.flow.pair_run import PairRun
from lie_codegen.flow.pair_system import System
from lie_codegen.flow.product_rate import reach_of
from lie_codegen.groups.maps.packed_arrays import elements_of
from lie_codegen.runtime.library import Library
from lie_codegen.runtime.outputs import copied

#: The relative part of a tolerance that is absolute: rounding.
_ROUNDING = 1e-15


def loop_system(loop: Loop, library: Library, numbers: Mapping[str, Array]) -> System:
    """The loop as the pair integrates it."""
    moves, short = moves_of(loop), short_of(loop)
    if short is not None:
        numbers_of = tuple(numbers[port.name] for port in library.loop_rate.inputs[2:])
        return System(
            library.loop_rate, library.loop_settle, short.size, inf, numbers_of, steady=loop.steady,
            lift=library.loop_lift, quaternions=short.quaternions,
        )  # fmt: skip
    reach = min(reach_of(move.group, closed=move.derivation.closed_exponential) for move in moves)
    turns = sum(move.group.dim for move in moves)
    given = tuple(numbers[port.name] for port in library.loop_rate.inputs[3:])
    # the velocity is part of the state of a body; that of an element of the law's own is what the law says at the time
    alone = loop.plant.order == 2 and len(moves) == 1
    algebra = moves[0].group.algebra if alone and loop.steady else None
    return System(library.loop_rate, library.loop_settle, turns, reach, given, steady=loop.steady, algebra=algebra)


def _system(run: Run) -> System:
    """That of a run which has one.

    Raises:
        InputError: it has none.
    """
    if run.system is None:
        raise InputError(f"closed_loop({run.loop.plant.namespace}): the loop has no smooth rate on groups")
    return run.system


def adaptive(run: Run, tolerance: float) -> PairRun:
    """The run by the pair; `motion_of` and `states_of` say what it went through.

    Raises:
        ComputationError: as `integrate`.
    """
    system = _system(run)
    X0, behind = _parted(run.loop, run.start)
    y0 = np.zeros((len(behind), system.size))
    y0[:, system.group :] = behind
    return integrate(
        system, X0, y0, run.times, rtol=_ROUNDING, atol=tolerance, where=f"closed_loop({run.loop.plant.namespace})", threads=run.threads
    )  # fmt: skip


def states_of(run: Run, pair: PairRun) -> Array:
    """(k, N, m) or (k, m) states at the times."""
    states = joined(run.loop, pair.X, pair.y)
    return states if run.many else states[:, 0]


def motion_of(run: Run, pair: PairRun) -> tuple[Array, Array]:
    """X and xi at the times, as the plant splits those states: of a body by itself from where they stand already."""
    plant = run.loop.plant
    if run.loop.own_ports or not isinstance(plant, GroupPlant):
        return plant.split(states_of(run, pair))
    first = pair.y.shape[2] - plant.sizes[1]
    if run.many:
        return elements_of(plant.group, pair.X), copied(pair.y[:, :, first:])
    return elements_of(plant.group, pair.X[:, 0]), copied(pair.y[:, 0, first:])


def _parted(loop: Loop, states: Array) -> tuple[Array, Array]:
    """Elements and vectors of (N, m) states: the inverse of `joined`."""
    if not loop.own_ports:
        size = loop.plant.sizes[0]
        return states[:, :size], states[:, size:]
    elements, vectors = columns(loop)
    if not vectors or elements[-1] < vectors[0]:
        return states[:, : len(elements)], states[:, len(elements) :]
    return states[:, elements], states[:, vectors]


def joined(loop: Loop, X: Array, y: Array) -> Array:
    """(..., m) states of (..., packed) elements and (..., size) vectors behind Theta."""
    elements, vectors = columns(loop)
    behind = y[..., y.shape[-1] - len(vectors) :]
    if not vectors or elements[-1] < vectors[0]:  # as they stand, unless elements of the law's own come after vectors
        return np.concatenate([X, behind], axis=-1)
    states = np.empty((*X.shape[:-1], len(elements) + len(vectors)))
    states[..., elements], states[..., vectors] = X, behind
    return states


def states_within(run: Run, pair: PairRun, t: Array) -> Array:
    """(k, m) states of one loop at any times of the run, by fresh steps from the knots before them."""
    return joined(run.loop, *pair.at(_system(run), t))


def loop_events(run: Run, pair: PairRun, events: Sequence[Event]) -> tuple[EventHits, ...]:
    """What is found of the events along one loop: sign changes between steps and at two places within each.

    Raises:
        InputError, ExpressionError: as `find_events`.
    """
    plant = run.loop.plant
    where = f"closed_loop({plant.namespace})"
    if run.many:
        raise InputError(f"{where}: events are of one loop; run it alone")
    if not isinstance(plant, GroupPlant):
        raise InputError(f"{where}: events are of loops on groups")
    group = plant.group
    functions = [event_function(each, group.degree, group.is_complex, plant.sizes[1]) for each in events]
    system = _system(run)

    def inside(step: NDArray[np.intp], part: Array) -> tuple[Array, Array | None]:
        X, y = pair.within(system, step, part)
        return plant.split(joined(run.loop, X, y))

    count = len(pair.knot_t)
    parts = np.concatenate([[0.0], INNER])
    step = np.repeat(np.arange(count), len(parts))
    X, xi = inside(np.append(step, count - 1), np.append(np.tile(parts, count), 1.0))
    return find_events(events, functions, pair.knot_t, pair.knot_h, (X, xi), inside, where)


def by_gauss(run: Run, parts: int) -> Array:
    """(k, N, m) or (k, m) states by Gauss collocation of order 6, `parts` equal steps between two times, one loop after another.

    Raises:
        ComputationError: as `gauss`.
    """
    whole, (elements, vectors) = _system(run), columns(run.loop)
    found = []
    for k, state in enumerate(run.start):
        system = whole.of_members(k)
        y0 = np.concatenate([np.zeros(system.group), state[vectors]])
        X, y = gauss(system, state[elements], y0, run.times, parts, f"closed_loop({run.loop.plant.namespace})")
        found.append(joined(run.loop, X, y))
    states = np.stack(found, axis=1)
    return states if run.many else states[:, 0]
