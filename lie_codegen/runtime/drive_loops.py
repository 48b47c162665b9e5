"""The loop under u(t) in C, see templates/drive.c, and in numpy."""

from __future__ import annotations

import ctypes
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.codegen.templates import template_folder
from lie_codegen.errors import CompileError
from lie_codegen.runtime.backend import load_library
from lie_codegen.runtime.drive_arguments import Arguments, Spans, Step
from lie_codegen.runtime.formula_input import FormulaInput
from lie_codegen.runtime.sources import build_source

#: Steps whose inputs numpy_loop holds in memory at once.
_SLOW_BLOCK = 4096


class _Signal(ctypes.Structure):
    """`Signal` of templates/drive.c; _Grid and _Ports likewise."""

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


@lru_cache(maxsize=1)
def drive_library() -> ctypes.CDLL | None:
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


def c_loop(
    compiled: Step, plan: Arguments, u: FormulaInput, spans: Spans, first: int, last: int, found: Array
) -> float:
    """The states of trajectories first .. last - 1 into `found`; the largest |h u| of any step.

    Raises:
        CompileError: there is no compiler.
    """
    library = drive_library()
    if library is None:
        raise CompileError("driven loops in C need a compiler")
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


def numpy_loop(
    compiled: Step, plan: Arguments, u: FormulaInput, spans: Spans, first: int, last: int, found: Array
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
