"""What a driven loop is given, checked: its steps in time, which ports read u(t), and the arrays of the others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.codegen.signature import Signature, is_step
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.kernel.kernel import Port
from lie_codegen.runtime.arguments_scan import loops
from lie_codegen.runtime.backend import Backend
from lie_codegen.runtime.formula_input import FormulaInput


class Step(Protocol):
    """What a loop needs of the step that it repeats."""

    signature: Signature
    backend: Backend

    def scan_batch(self, *args: Any, n: int, every: int = 1, out: Any = None, threads: int = 1, **named: Any) -> Array:
        """Its own loop over many trajectories, for what the driven C loop does not take."""


#: Where in a step the inputs of the integrators read u.
STAGES: Mapping[str, float] = {"u0": 0.0, "um": 0.5, "u1": 1.0}
#: As many as templates/drive.c has room for.
_MOST_PORTS, _MOST_POINTS = 32, 8


@dataclass(frozen=True)
class Spans:
    """Steps in time: between knots, `parts` each; without knots, of length h from `start`. States are kept at the spans.

    Attributes:
        count: number of spans.
        parts: steps in each.
        knots: (count + 1,) or None.
        start, h: without knots.
    """

    count: int
    parts: int
    knots: NDArray[np.float64] | None = None
    start: float = 0.0
    h: float = 0.0

    def steps(self, first: int, last: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """When the steps first .. last - 1 begin, and how long they are."""
        index = np.arange(first, last)
        if self.knots is None:
            return np.asarray(self.start + index * self.h, dtype=float), np.full(len(index), self.h)
        span, inside = np.divmod(index, self.parts)
        h: NDArray[np.float64] = np.asarray(np.diff(self.knots)[span] / self.parts)
        return np.asarray(self.knots[span] + inside * h, dtype=float), h


@dataclass(frozen=True)
class Arguments:
    """Arguments of a loop: arrays and strides by port; the point of u that a port reads, or -1."""

    arrays: list[Array]
    strides: list[tuple[int, int]]
    count: int
    at: NDArray[np.float64]
    point: list[int]
    step_port: int
    time_port: int


def arguments_of(
    compiled: Step, start: Array, u: FormulaInput, spans: Spans, at: Mapping[str, float], others: dict[str, Any]
) -> tuple[Arguments, bool]:
    """What the loop is given, and whether the result has an axis of trajectories.

    Raises:
        InputError, ShapeError: naming the argument.
    """
    name, ports = compiled.signature.name, compiled.signature.inputs
    if not is_step(ports, compiled.signature.outputs):
        raise InputError(f"{name}: the first output is not of the shape of the first input; it cannot be iterated")
    driven = {port.name: at[port.name] for port in ports[1:] if port.name in at}
    if not driven:
        raise InputError(f"{name}: none of its inputs is among {', '.join(at)}; say with at= which ones read u(t)")
    _check_driven(name, ports, driven, u.dim, at, others)
    # The loop gives h and t itself, unless the caller does.
    clock = {each: _find(ports, each) if each not in others else -1 for each in ("h", "t")}
    points = sorted(set(driven.values()))
    given = np.asarray(start)
    many = given.ndim > len(ports[0].shape) or u.trajectories is not None
    values: list[Any] = [given if given.ndim > len(ports[0].shape) else given[None]]
    for number, port in enumerate(ports[1:], 1):
        if port.name in driven or number in clock.values():
            values.append(np.zeros(port.shape))
        elif port.name in others:
            values.append(others.pop(port.name))
        else:
            raise ShapeError(f"{name}: missing {port.name}")
    if others:
        raise ShapeError(f"{name} has no argument {next(iter(others))!r}")
    if u.trajectories is not None and len(values[0]) == 1:
        values[0] = np.repeat(values[0], u.trajectories, axis=0)
    arrays, strides, count = loops(compiled.signature, values, spans.count * spans.parts)
    if u.trajectories not in (None, count):
        raise ShapeError(f"{name}: u has {u.trajectories} trajectories, the other inputs have {count}")
    point = [-1, *(points.index(driven[port.name]) if port.name in driven else -1 for port in ports[1:])]
    return Arguments(arrays, strides, count, np.array(points), point, clock["h"], clock["t"]), many or count > 1


def _check_driven(
    name: str,
    ports: Sequence[Port],
    driven: Mapping[str, float],
    dim: int,
    at: Mapping[str, float],
    others: Mapping[str, Any],
) -> None:
    if len(ports) > _MOST_PORTS or len(set(driven.values())) > _MOST_POINTS:
        raise InputError(f"{name}: at most {_MOST_PORTS} inputs and {_MOST_POINTS} points in a step")
    for port in ports:
        if port.name in driven and port.shape not in ((dim,), () if dim == 1 else (dim,)):
            raise ShapeError(f"{name}: {port.name} has shape {port.shape}, u(t) has ({dim},)")
        if port.name in driven and not 0 <= at[port.name] <= 1:
            raise InputError(f"{name}: at[{port.name!r}] is {at[port.name]}; it must lie in [0, 1]")
        if port.name in driven and port.name in others:
            raise ShapeError(f"{name}: {port.name} reads u(t); do not give it too")


def _find(ports: Sequence[Port], name: str) -> int:
    return next((number for number, port in enumerate(ports) if port.name == name and not port.shape and number), -1)
