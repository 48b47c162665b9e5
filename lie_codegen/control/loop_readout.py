"""What a run of a closed loop says at its times: configuration, velocity, states, outputs and command of the law, the reference."""

from __future__ import annotations

from functools import cached_property, partial
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
from lie_codegen.flow.pair_run import PairRun
from lie_codegen.kernel.kernel import Port
from lie_codegen.values import Later, made_of


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
    X, xi = loop.plant.split(found) if isinstance(found, np.ndarray) else motion_of(run, found)
    moves = run.reference(times)
    steps = (
        count * round((times[-1] - times[0]) / (run.sample or float(times[1] - times[0])))
        if pair is None
        else pair.steps
    )
    making = LoopMaking(run, told.model, told.reference, told.rtol, count, pair)
    said = _Said(run, found, moves)
    if loop.plant.order == 1 and loop.law is not None:
        u = said.both[1]
        xi = xi if u is None else u
    kind = told.kind if pair is None else "adaptive"
    return made_of(
        ClosedLoop,
        {
            "t": times, "X": X, "xi": xi, "outputs": Later(said.outputs), "X_d": moves.get("X_d"), "xi_d": moves.get("xi_d"),
            "steps": steps, "error_estimate": error, "u": Later(said.command), "states": said.states if loop.own_ports else {},
            "group": getattr(loop.plant, "group", None), "events": events, "origin": Later(partial(loop_origin, making, kind)),
            "_made": making,
        },
    )  # fmt: skip


class _Said:
    """What the law says along a run: what nobody asks for is not computed, and who asks for one part gets all."""

    def __init__(self, run: Run, found: Array | PairRun, moves: dict[str, Array]) -> None:
        self._run, self._found, self._moves = run, found, moves

    @cached_property
    def course(self) -> Array:
        """The states."""
        return states_of(self._run, self._found) if isinstance(self._found, PairRun) else self._found

    @cached_property
    def states(self) -> dict[str, Array]:
        """The own states of the law by name."""
        return own_states(self._run.loop, self.course, sampled=bool(self._run.sample))

    @cached_property
    def both(self) -> tuple[dict[str, Array], Array | None]:
        """Outputs, own states among them, and the command."""
        run, loop = self._run, self._run.loop
        outputs, u = _outputs(run, self.course, self._moves)
        if run.sample and loop.law is not None:
            u = np.ascontiguousarray(self.course[..., -loop.plant.sizes[2] :])
        return {**outputs, **{name: value for name, value in self.states.items() if name not in outputs}}, u

    def outputs(self) -> dict[str, Array]:
        """The outputs."""
        return self.both[0]

    def command(self) -> Array | None:
        """The command."""
        return self.both[1]


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
