"""Closed loops run: continuous, or with a law that is called at samples and held between."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.control.loop_model import NOISE, Loop
from lie_codegen.errors import ComputationError
from lie_codegen.flow.pair_system import System
from lie_codegen.runtime.call import Compiled
from lie_codegen.runtime.library import Library
from lie_codegen.runtime.rows import row_by_row
from lie_codegen.runtime.sampled_loop import NoiseStream, SampledTask, sampled_loop
from lie_codegen.runtime.threads import step_pieces

MOST_STEPS = 2**21
_LARGEST_MOVE = 0.25
#: Steps from which errors that fall like the step are taken for those of a jump.
_JUMPED_AFTER = 2**12
#: Steps for which the reference is held in memory at once.
_BLOCK = 20_000
#: Loops of which the error is estimated, where there are many.
_WATCHED = 64


class Run(NamedTuple):
    """A loop to be run.

    Attributes:
        loop, library: what, and its kernels.
        start: (N, m) states at times[0].
        many: whether N loops were asked for, not one.
        times: (k,) equally spaced.
        numbers: inputs by name, of one loop or of N.
        threads: over which loops are shared out.
        sample, delay: of a sampled law: seconds from call to call (0 for a continuous law), samples from a call to when it acts.
        noise: of a sampled law.
        system: as the pair 8(5,3) integrates it, with these numbers; None where it has no smooth rate on groups.
    """

    loop: Loop
    library: Library
    start: Array
    many: bool
    times: Array
    numbers: Mapping[str, Array]
    threads: int
    sample: float
    delay: int
    noise: NoiseStream
    system: System | None

    def states(self, every: int) -> Array:
        """(k, N, m) or (k, m) states at the times; `every` steps between two times, or between two samples."""
        states = self._sampled(every) if self.sample else self._continuous(every)
        return states if self.many else states[:, 0]

    def of(self, kernel: str, given: Mapping[str, Any]) -> dict[str, Any]:
        """The inputs of a kernel by name, the state and the noise apart."""
        names = [port.name for port in self.library[kernel].inputs if port.name not in ("state", "noise")]
        return {name: given[name] if name in given else self.numbers[name] for name in names}

    def reference(self, t: Array) -> dict[str, Array]:
        """X_d, xi_d and xi_d_dot at the times, by name; nothing without a reference."""
        if not self.loop.moving:
            return {}
        made = self.sampled_at(self.library.reference, np.ascontiguousarray(t))
        return dict(zip(("X_d", "xi_d", "xi_d_dot"), made, strict=True))

    def sampled_at(self, kernel: Compiled[Any], *samples: Any, **named: Any) -> tuple[Array, ...]:
        """A kernel of the loop at samples: on lanes where there are many loops, for which lanes are compiled anyhow."""
        if not self.many:
            return row_by_row(kernel, *samples, **named)
        return tuple(kernel.batch(*samples, threads=self.threads, **named))

    def _continuous(self, every: int) -> Array:
        total = every * (len(self.times) - 1)
        h = (self.times[-1] - self.times[0]) / total
        found, state, step = [self.start[None]], self.start, self.library.loop_step
        ranks = {port.name: len(port.shape) for port in step.inputs}
        for first, count, kept in step_pieces(total, every, _BLOCK):
            clock = self.times[0] + h * (first + np.arange(count))
            stages = self._stages(self.times[0] + h * first, h, count)
            inputs = self.of("loop_step", {"t": clock[None], "h": h, **stages})
            if self.many:
                runs = step.scan_batch(state, n=count, every=kept, threads=self.threads, **inputs)
                made = np.moveaxis(runs[:, 1:], 0, 1)
            else:
                inputs = {name: x[0] if np.ndim(x) > ranks[name] else x for name, x in inputs.items()}
                made = np.asarray(step.scan(state[0], n=count, every=kept, **inputs))[1:, None]
            state = np.ascontiguousarray(made[-1])
            if (first + count) % every == 0:
                found.append(made)
        return np.concatenate(found)

    def _stages(self, start: float, h: float, count: int) -> dict[str, Array]:
        """The reference at the ends and the middle of each step, as the step takes it."""
        found = self.reference(start + h / 2 * np.arange(2 * count + 1))
        flat = {name: x.reshape(len(x), -1) for name, x in found.items()}
        return {name: np.stack([x[:-1:2], x[1::2], x[2::2]], axis=1)[None] for name, x in flat.items()}

    def _sampled(self, parts: int) -> Array:
        spans = len(self.times) - 1
        samples = round((self.times[1] - self.times[0]) / self.sample)
        command = self.loop.plant.sizes[2]
        ring = np.zeros((len(self.start), self.delay, command))
        found = [self._first_call(ring)[None]]
        names = ("loop_sample",) if "loop_sample" in self.library.kernels else ("loop_motion", "loop_control")
        h, state = self.sample / parts, found[0][0]
        for first, count, kept in step_pieces(spans * samples, samples, max(1, _BLOCK // parts)):
            task = SampledTask(count // kept, kept, parts, first, command, self.delay)
            called = self.times[0] + self.sample * (first + np.arange(count + 1))
            moved = (called[:-1, None] + h * np.arange(parts)).ravel()
            reference = {name: x[None] for name, x in self.reference(called[1:]).items()}
            given: dict[str, dict[str, Any]] = {
                "loop_sample": {"t": called[None, :-1], "h": self.sample, **reference},
                "loop_control": {"t": called[None, 1:], "h": self.sample, **reference},
                "loop_motion": {"t": moved[None], "h": h},
            }
            runs = sampled_loop(
                self.library, names, state, task, {name: self.of(name, given[name]) for name in names}, self.noise, ring,
                threads=self.threads,
            )  # fmt: skip
            state = np.ascontiguousarray(runs[:, -1])
            if (first + count) % samples == 0:
                found.append(np.moveaxis(runs, 0, 1))
        return np.concatenate(found)

    def _first_call(self, ring: Array) -> Array:
        """(N, m) states after the law was called at times[0]."""
        reference = {name: x[0] for name, x in self.reference(self.times[:1]).items()}
        inputs: dict[str, Any] = self.of("loop_control", {"t": self.times[0], "h": self.sample, **reference})
        if self.loop.noise:
            inputs["noise"] = self.noise.at(len(self.start), 0)
        behind = self.loop.extent(sampled=True) - self.start.shape[1]
        start = np.concatenate([self.start, np.zeros((len(self.start), behind))], axis=1)
        control = self.library.loop_control
        state = control.scan_batch(start, n=1, **inputs)[:, 1] if self.many else self._alone(start, inputs)
        if self.delay:
            command = self.loop.plant.sizes[2]
            ring[:, 0] = state[:, -command:]
            state[:, -command:] = 0
        return np.ascontiguousarray(state)

    def _alone(self, start: Array, inputs: Mapping[str, Any]) -> Array:
        """The same of one loop, without its axis."""
        ranks = {port.name: len(port.shape) for port in self.library.loop_control.inputs}
        single = {name: x[0] if np.ndim(x) > ranks[name] else x for name, x in inputs.items()}
        return np.asarray(self.library.loop_control(start[0], **single))[None]


def refined(run: Run, tolerance: float, narrower: Callable[[Run, Array], Run]) -> tuple[Array, int, float]:
    """States, steps and error: the steps are halved until two runs agree to the tolerance.

    Of many loops under a sampled law, which cannot do without their noise, 64 are watched; the others then take the same steps.

    Raises:
        ComputationError: two million steps do not bring the error below the tolerance, or the state is no longer finite; the law
            jumps on the way, which equal steps meet to a step only.
    """
    watched, order = run, run.loop.plant.order
    if run.sample and len(run.start) > _WATCHED:
        watched = narrower(run, np.linspace(0, len(run.start) - 1, _WATCHED).astype(int))
    gap = run.sample or float(run.times[1] - run.times[0])
    spans = round((run.times[-1] - run.times[0]) / gap)
    place = run.loop.plant.sizes[0]
    smooth = _smooth_columns(run.loop, run.start.shape[1]) if not run.sample else slice(None)
    every, previous, errors = 1, None, list[float]()
    while every * spans <= max(MOST_STEPS, 2 * spans):
        states = watched.states(every)
        finite = bool(np.all(np.isfinite(states)))
        if finite and previous is not None:
            error = float(np.max(np.abs((states - previous)[..., smooth]))) / 15
            # A fast turn is followed in short steps, whatever two runs of too long ones agree on.
            turn = np.max(np.abs(states[..., place:])) * gap / every if order == 2 else 0.0
            if error <= tolerance and turn <= _LARGEST_MOVE:
                return (states if watched is run else run.states(every)), every, error
            errors.append(error)
            if every * spans >= _JUMPED_AFTER and not run.sample and _of_first_order(run.loop, errors):
                raise ComputationError(
                    f"closed_loop({run.loop.plant.namespace}): the law jumps on the way, and equal steps meet a jump to a step only: "
                    f"the error is {error:.1e} with {every * spans} steps and falls no faster than they shorten; give step=, or "
                    "sample= as a controller calls the law"
                )
        previous = states if finite else None
        every *= 2
    raise ComputationError(
        f"closed_loop({run.loop.plant.namespace}): {MOST_STEPS} steps do not bring the error below {tolerance:g}, or the state "
        "grows without bound; shorten the time, loosen the tolerance, or check the gains"
    )


def _smooth_columns(loop: Loop, count: int) -> NDArray[np.bool_]:
    """The columns of a state but those that are held from step to step, which lag by a step whatever its length is."""
    kept = np.ones(count, dtype=bool)
    place = sum(loop.plant.sizes[:2])
    for each in loop.own_ports:
        size = loop.own_size(each.port)
        if each.kind == "held":
            kept[place : place + size] = False
        place += size
    return kept


def _of_first_order(loop: Loop, errors: list[float]) -> bool:
    """Whether a law that holds a state has errors that fall like the step: three times in a row by less than a third."""
    held = any(each.kind == "held" for each in loop.own_ports)
    return held and len(errors) > 3 and all(b > a / 3 for a, b in zip(errors[-4:-1], errors[-3:], strict=True))


#: What a loop without noise draws.
_NOTHING = np.zeros(0, dtype=np.uint32)
_NOTHING.flags.writeable = False
SILENT = NoiseStream(0, _NOTHING, 0)


def noise_stream(loop: Loop, seed: int, first: int) -> NoiseStream:
    """What a loop draws."""
    if not loop.noise:
        return NoiseStream(seed % 2**64, _NOTHING, first)
    return NoiseStream.of(seed, [NOISE.index(kind) for kind in loop.noise], loop.noise_sizes, first)
