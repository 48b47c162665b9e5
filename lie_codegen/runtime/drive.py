"""Loops whose input is a formula of time, evaluated in the loop itself; see templates/drive.c."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.codegen.signature import Signature, is_step
from lie_codegen.codegen.templates import template_folder
from lie_codegen.errors import CompileError, InputError, ShapeError
from lie_codegen.kernel.kernel import Port
from lie_codegen.runtime.arguments import dtype_of
from lie_codegen.runtime.arguments_scan import loops
from lie_codegen.runtime.backend import Backend, load_library
from lie_codegen.runtime.formula_input import FormulaInput
from lie_codegen.runtime.sources import build_source
from lie_codegen.runtime.threads import CALLS, in_parts


class Step(Protocol):
    """What a loop needs of the step that it repeats."""

    signature: Signature
    backend: Backend

    def scan_batch(self, *args: Any, n: int, every: int = 1, out: Any = None, threads: int = 1, **named: Any) -> Array:
        """Its own loop over many trajectories, for what the driven C loop does not take."""


#: Where in a step the inputs of the integrators read u.
STAGES: Mapping[str, float] = {"u0": 0.0, "um": 0.5, "u1": 1.0}
_MOST_PORTS, _MOST_POINTS = 32, 8
_SLOW_BLOCK = 4096


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
class _Plan:
    """Arguments of a loop: arrays and strides by port; the point of u that a port reads, or -1."""

    arrays: list[Array]
    strides: list[tuple[int, int]]
    count: int
    at: NDArray[np.float64]
    point: list[int]
    step_port: int
    time_port: int


class _Signal(ctypes.Structure):
    _fields_ = [(n, ctypes.c_ssize_t) for n in ("dim", "rates", "pieces", "wave_stride", "line_stride")] + [
        (n, ctypes.c_void_p) for n in ("rate", "rate_low", "cosines", "sines", "times", "left", "right")
    ]


class _Grid(ctypes.Structure):
    _fields_ = [
        ("spans", ctypes.c_ssize_t),
        ("parts", ctypes.c_ssize_t),
        ("knots", ctypes.c_void_p),
        ("start", ctypes.c_double),
        ("h", ctypes.c_double),
    ]


class _Ports(ctypes.Structure):
    _fields_ = [(n, ctypes.c_ssize_t) for n in ("inputs", "state", "step_port", "time_port", "points")] + [
        (n, ctypes.c_void_p) for n in ("at", "point", "inputs_at", "lane", "step")
    ]


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
    plan, many = _plan(compiled, start, u, spans, at, dict(others or {}))
    state = compiled.signature.inputs[0]
    found = np.empty((plan.count, spans.count + 1, *state.shape), dtype_of(state))
    moves: list[float] = [0.0]
    loop = _c_loop if compiled.backend.loop_address(many=False) and _library() else _numpy_loop

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


def _plan(
    compiled: Step, start: Array, u: FormulaInput, spans: Spans, at: Mapping[str, float], others: dict[str, Any]
) -> tuple[_Plan, bool]:
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
    return _Plan(arrays, strides, count, np.array(points), point, clock["h"], clock["t"]), many or count > 1


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


@lru_cache(maxsize=1)
def _library() -> ctypes.CDLL | None:
    """The compiled driver; None where there is no compiler."""
    try:
        path = build_source(
            lambda: {"drive.c": (template_folder() / "drive.c").read_text(encoding="utf-8")},
            "drive.c",
            namespace="lie_codegen_drive",
            definition="drive",
        )
    except CompileError:
        return None
    if path is None:
        return None
    library = load_library(path)
    library.lie_codegen_drive.restype = ctypes.c_double
    library.lie_codegen_drive_work.restype = ctypes.c_ssize_t
    return library


def _c_loop(compiled: Step, plan: _Plan, u: FormulaInput, spans: Spans, first: int, last: int, found: Array) -> float:
    library = _library()
    if library is None:
        return _numpy_loop(compiled, plan, u, spans, first, last, found)
    state, count = compiled.signature.inputs[0].size, last - first
    scan = compiled.backend.loop_address(many=False)
    batch = compiled.backend.loop_address(many=True) if count > 1 else 0
    at, point = np.ascontiguousarray(plan.at), np.array(plan.point, dtype=np.intp)
    lane, step = (np.array([pair[side] for pair in plan.strides], dtype=np.intp) for side in (0, 1))
    # Every input of trajectory `first` on: 8 bytes a double, its stride from one trajectory to the next.
    pointers = np.array(
        [array.ctypes.data + 8 * first * stride for array, (stride, _) in zip(plan.arrays, plan.strides, strict=True)],
        dtype=np.uintp,
    )
    signal = _signal(u, first)
    knots = None if spans.knots is None else np.ascontiguousarray(spans.knots)
    grid = _Grid(spans.count, spans.parts, None if knots is None else knots.ctypes.data, spans.start, spans.h)
    ports = _Ports(
        len(plan.arrays), state, plan.step_port, plan.time_port, len(at),
        *(each.ctypes.data for each in (at, point, pointers, lane, step)),
    )  # fmt: skip
    sizes = (u.dim, len(u.rates), len(at), state)
    space = np.zeros(int(library.lie_codegen_drive_work(*(ctypes.c_ssize_t(each) for each in sizes))))
    return float(
        library.lie_codegen_drive(
            ctypes.c_void_p(scan),
            ctypes.c_void_p(batch),
            ctypes.c_ssize_t(count),
            ctypes.byref(signal),
            ctypes.byref(grid),
            ctypes.byref(ports),
            ctypes.c_void_p(space.ctypes.data),
            ctypes.c_void_p(found[first:last].ctypes.data),
        )
    )


def _signal(u: FormulaInput, first: int) -> _Signal:
    def table(values: NDArray[np.float64]) -> tuple[int, int]:
        stride = values[0].size if values.ndim == 3 else 0
        return values.ctypes.data + 8 * first * stride, stride

    (cosines, waves), (sines, _) = table(u.cosines), table(u.sines)
    (left, lines), (right, _) = table(u.left), table(u.right)
    pieces = max(0, len(u.times) - 1)
    return _Signal(
        u.dim, len(u.rates), pieces, waves, lines,
        u.rates.ctypes.data, u.rates_low.ctypes.data, cosines, sines, u.times.ctypes.data, left, right,
    )  # fmt: skip


def _numpy_loop(
    compiled: Step, plan: _Plan, u: FormulaInput, spans: Spans, first: int, last: int, found: Array
) -> float:
    """The same without the driver: u by numpy, block by block."""
    total, largest = spans.count * spans.parts, 0.0
    # whole spans a block, so that the states asked for fall on its ends
    block = _SLOW_BLOCK // spans.parts * spans.parts or spans.parts
    mine = [a if lane == 0 else a[first:last] for a, (lane, _) in zip(plan.arrays, plan.strides, strict=True)]
    own = u.trajectories is not None
    state = mine[0]
    found[first:last, 0] = state
    for begin in range(0, total, block):
        end = min(begin + block, total)
        moments, lengths = spans.steps(begin, end)
        values = u.values(moments, lengths, plan.at)
        values = values[first:last] if own else values[None]
        largest = max(largest, float(np.max(lengths[:, None] * np.linalg.norm(values, axis=-1), initial=0.0)))
        arguments = [state]
        for number, (array, port) in enumerate(zip(mine, compiled.signature.inputs, strict=True)):
            if number == 0:
                continue
            if plan.point[number] >= 0:
                entries = values[:, :, plan.point[number]]
                arguments.append(np.ascontiguousarray(entries.reshape(*entries.shape[:2], *port.shape)))
            elif number in (plan.step_port, plan.time_port):
                arguments.append(np.ascontiguousarray((lengths if number == plan.step_port else moments)[None]))
            else:
                arguments.append(array[:, begin:end] if plan.strides[number][1] else array)
        if len(state) == 1 and not own:
            arguments[0] = state
        made = compiled.scan_batch(*arguments, n=end - begin, every=spans.parts)
        place = begin // spans.parts
        found[first:last, place + 1 : place + made.shape[1]] = made[:, 1:]
        state = np.ascontiguousarray(made[:, -1])
    return largest
