"""What a run of a closed loop says at its times: configuration, velocity, states, outputs and command of the law, the reference."""

from __future__ import annotations

from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.control.loop_adaptive import motion_of, states_of
from lie_codegen.control.loop_arguments import LoopArguments
from lie_codegen.control.loop_origin import LoopMaking, loop_origin
from lie_codegen.control.loop_result import ClosedLoop
from lie_codegen.control.loop_run import Run
from lie_codegen.control.loop_states import own_states
from lie_codegen.flow.events import EventHits
from lie_codegen.flow.pair853 import PairRun
from lie_codegen.kernel.kernel import Port
from lie_codegen.values import Later


def result_of(
    run: Run,
    told: LoopArguments,
    found: Array | PairRun,
    count: int,
    error: float,
    events: tuple[EventHits, ...] = (),
) -> ClosedLoop:
    """The closed loop of states (k, m), or (k, N, m) of N loops, at its times, with what made it.

    Args:
        run, told: the loop and its arguments.
        found: the states, or the adaptive run that has them.
        count: steps from one output to the next, where they are equal.
        error: estimate on the entries.
        events: what was found along it.
    """
    loop, times = run.loop, run.times

    pair = found if isinstance(found, PairRun) else None

    def course() -> Array:
        return states_of(run, found) if isinstance(found, PairRun) else found

    X, xi = loop.plant.split(course()) if pair is None else motion_of(run, pair)
    states = own_states(loop, course(), sampled=bool(run.sample)) if loop.own_ports else {}
    moves = run.reference(times)
    made: list[tuple[dict[str, Array], Array | None]] = []

    def said() -> tuple[dict[str, Array], Array | None]:
        # what nobody asks for is not computed; who asks for one of the two gets both
        if not made:
            whole = course()
            outputs, u = _outputs(run, whole, moves)
            if run.sample and loop.law is not None:
                u = np.ascontiguousarray(whole[..., -loop.plant.sizes[2] :])
            made.append(({**outputs, **{name: value for name, value in states.items() if name not in outputs}}, u))
        return made[0]

    if loop.plant.order == 1 and loop.law is not None:
        u = said()[1]
        xi = xi if u is None else u
    gap = run.sample or float(times[1] - times[0])
    steps = pair.steps if pair is not None else count * round((times[-1] - times[0]) / gap)
    group = getattr(loop.plant, "group", None)
    making = LoopMaking(run, told.model, told.reference, told.rtol, count, pair)
    kind = told.kind if pair is None else "adaptive"
    later: Any = (Later(lambda: said()[0]), Later(lambda: said()[1]), Later(lambda: loop_origin(making, kind)))
    outputs, u_later, origin = later
    return ClosedLoop(
        times, X, xi, outputs, moves.get("X_d"), moves.get("xi_d"), steps, error, u_later, states, group, events, origin
    )._made_by(making)


def _outputs(run: Run, found: Array, moves: dict[str, Array]) -> tuple[dict[str, Array], Array | None]:
    """What the law gives at the times, and its command within the limits."""
    loop, times = run.loop, run.times
    if loop.law is None:
        return {}, None
    inner = loop.extent(sampled=False)
    states = found[..., :inner]
    if run.sample:  # the own states as the law used them stand behind those that it will use next
        place = sum(loop.plant.sizes[:2])
        own = inner - place
        states = np.concatenate([found[..., :place], found[..., place + own : place + 2 * own]], axis=-1)
    shape = states.shape[:-1]
    repeats = shape[1] if run.many else 1
    kernel = run.library.loop_outputs
    given: dict[str, Any] = {"t": np.repeat(times, repeats), "h": run.sample}
    given |= {name: np.repeat(value, repeats, axis=0) if run.many else value for name, value in moves.items()}
    given |= {
        port.name: _repeated(port, run.numbers[port.name], len(times))
        for port in kernel.inputs
        if port.name in run.numbers
    }
    names = [port.name for port in kernel.inputs[1:]]
    flat = np.ascontiguousarray(states.reshape(-1, inner))
    made = run.sampled_at(kernel, flat, **{name: given[name] for name in names})
    values = {port.name: v.reshape(*shape, *v.shape[1:]) for port, v in zip(kernel.outputs, made, strict=True)}
    command = values.pop(kernel.outputs[-1].name)
    return values, command


def _repeated(port: Port, values: Array, times: int) -> Array:
    """One a sample of all loops at all times, where there is one a loop."""
    return values if values.ndim == len(port.shape) else np.tile(values, (times, *[1] * len(port.shape)))
