"""What a closed loop was run from: in its own process the objects, in a file or a pickle their definitions, which make them again."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.control.loop_adaptive import loop_system
from lie_codegen.control.loop_library import loop_library
from lie_codegen.control.loop_run import Run, refined
from lie_codegen.flow.pair_run import PairRun
from lie_codegen.kernel.plain_data import Definition, made_from
from lie_codegen.kernel.records import check_kinds
from lie_codegen.kernel.saved import Saved
from lie_codegen.runtime.sampled_loop import NoiseStream


class LoopMaking(NamedTuple):
    """What ran a loop.

    Attributes:
        run: the loop, its kernels and where it began.
        model, reference: arguments of `loop_library`.
        rtol: for a loop without a step.
        parts: steps between two times, or two samples; 0 where they were of any length.
        pair: the steps of any length of a single loop.
    """

    run: Run
    model: Mapping[str, Any]
    reference: Any
    rtol: float
    parts: int
    pair: PairRun | None = None

    def in_steps(self) -> tuple[Run, int]:
        """The loop by equal steps, as C to take home, and how many of them from one time to the next."""
        if self.parts:
            return self.run, self.parts
        run = run_in_steps(self.run, self.model, self.reference)
        return run, refined(run, self.rtol, narrower)[1]


@dataclass(frozen=True, eq=False, repr=False)
class LoopOrigin(Saved):
    """The same as data.

    Attributes:
        loop, reference: definitions in JSON; no reference is an empty text.
        kind: which kernels ran, as `loop_library` takes it.
        start, many, numbers, sample, delay, noise: of the `Run`.
        rtol, parts: as in `LoopMaking`.
        knots: t, h, X, y at the beginning of every step of any length of a single loop; or nothing.
    """

    loop: str
    reference: str
    kind: str
    start: Array
    many: bool
    numbers: dict[str, Array]
    sample: float
    delay: int
    noise: NoiseStream
    rtol: float
    parts: int
    knots: tuple[Array, ...] = field(default=())

    def again(self, times: Array) -> LoopMaking:
        """What ran the loop at these times; kernels come from the cache.

        Raises:
            InputError: a definition names a law that this installation does not have.
        """
        model = {name: made_from(each) for name, each in _read(self.loop)["parameters"].items()}
        reference = made_from(_read(self.reference)) if self.reference else None
        loop, library = loop_library(model, reference, self.kind)
        system = loop_system(loop, library, self.numbers) if "loop_rate" in library.kernels else None
        run = Run(
            loop, library, self.start, self.many, times, self.numbers, 1, self.sample, self.delay, self.noise, system
        )  # fmt: skip
        pair = None
        if self.knots:
            X, y = self.knots[2:]
            nothing = np.empty((0, 1, X.shape[1])), np.empty((0, 1, y.shape[1]))
            pair = PairRun(*nothing, len(X), 0, 0, float("nan"), 0.0, np.column_stack(self.knots))
        return LoopMaking(run, model, reference, self.rtol, self.parts, pair)


def loop_origin(making: LoopMaking, kind: str) -> LoopOrigin | None:
    """The origin of a loop as data; None where a part of it is a function that somebody wrote and has no definition."""
    run, reference = making.run, getattr(making.reference, "definition", None)
    loop = getattr(run.loop, "definition", None)
    if not isinstance(loop, Definition) or (making.reference is not None and not isinstance(reference, Definition)):
        return None
    pair = making.pair
    single = pair is not None and not run.many
    knots = (pair.knot_t, pair.knot_h, pair.knot_X, pair.knot_y) if pair is not None and single else ()
    return LoopOrigin(
        loop.text, "" if reference is None else reference.text, kind, run.start, run.many, dict(run.numbers), run.sample,
        run.delay, run.noise, making.rtol, making.parts, knots,
    )  # fmt: skip


def run_in_steps(run: Run, model: Mapping[str, Any], reference: Any) -> Run:
    """The same loop by equal steps: without a compiler, and as C to take home."""
    return run._replace(library=loop_library(model, reference, "continuous")[1], system=None)


def narrower(run: Run, loops: Array) -> Run:
    """Some of the loops alone; their noise is other numbers, as large."""
    ranks = {port.name: len(port.shape) for port in run.loop.number_ports(noisy=True)}
    numbers = {
        name: np.ascontiguousarray(value[loops]) if value.ndim > ranks[name] else value
        for name, value in run.numbers.items()
    }
    return run._replace(start=np.ascontiguousarray(run.start[loops]), numbers=numbers)


def _read(text: str) -> Any:
    definition = json.loads(text)
    check_kinds(definition, "the loop")
    return definition
