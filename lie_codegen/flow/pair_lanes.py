"""Many members by the pair 8(5,3) over twice eight lanes, each with steps of its own: templates/pair_lanes.c."""

from __future__ import annotations

import ctypes
from functools import lru_cache
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.codegen.templates import template_folder
from lie_codegen.errors import CompileError
from lie_codegen.flow.pair_library import FULL, STAGES, refuse
from lie_codegen.flow.pair_system import System
from lie_codegen.runtime.backend import load_library
from lie_codegen.runtime.pair_headers import group_headers
from lie_codegen.runtime.sources import build_source
from lie_codegen.runtime.threads import stopped

WIDE, HALVES = 8, 2
#: Steps of every lane in one call of compiled code, after which Python looks whether somebody pressed Ctrl-C.
_ROUNDS = 4096


class Lanes(ctypes.Structure):
    """`Lanes` of templates/pair_lanes.c."""

    _fields_ = [
        *((n, ctypes.c_void_p) for n in ("rate", "move", "lift")),
        *((n, ctypes.c_ssize_t) for n in ("members", "packed", "group", "front", "quaternions", "size", "numbers")),
        *((n, ctypes.c_void_p) for n in ("number", "number_stride", "number_size")),
        *((n, ctypes.c_double) for n in ("rtol", "atol", "reach")),
        *((n, ctypes.c_void_p) for n in ("X", "y", "times")),
        *((n, ctypes.c_ssize_t) for n in ("count", "row")),
        *((n, ctypes.c_void_p) for n in ("X_out", "y_out", "work")),
        *((n, ctypes.c_ssize_t) for n in ("most", "begun", "steps", "rejected", "evaluations")),
        ("stopped", ctypes.c_double),
        *((n, ctypes.c_double * WIDE) for n in ("t", "t_low", "h", "goal")),
        *((n, ctypes.c_ssize_t * WIDE) for n in ("member", "next", "tries")),
    ]  # fmt: skip


@lru_cache(maxsize=1)
def _library() -> Any:
    def files() -> dict[str, str]:
        text = (template_folder() / "pair_lanes.c").read_text(encoding="utf-8")
        return {"pair_lanes.c": text, **group_headers()}

    path = build_source(files, "pair_lanes.c", namespace="pair_lanes", definition="pair_lanes", more_flags=("-O3",))
    if path is None:
        raise CompileError("the pair 8(5,3) over lanes needs a C compiler")
    library, size, pointer = load_library(path), ctypes.c_ssize_t, ctypes.c_void_p
    library.lanes_start.restype, library.lanes_start.argtypes = None, (pointer,)
    library.lanes_run.restype, library.lanes_run.argtypes = size, (pointer, size)
    return library


def run_lanes(
    system: System,
    start: tuple[Array, Array],
    times: Array,
    out: tuple[Array, Array],
    first: int,
    rtol: float,
    atol: float,
    most: int,
    where: str,
) -> tuple[int, int, int]:
    """Members of `system` from their starts, their states to the members from `first` on of `out`.

    Args:
        system: whose numbers are those of these members alone.
        start: (n, packed) and (n, size).
        times: (k,) the start, and what is wanted.
        out: (k - 1, N, packed) and (k - 1, N, size).
        first: of n members among N.
        rtol, atol: of local errors.
        most: attempts of a member at a step.
        where: for messages.

    Returns:
        Steps, those rejected, evaluations of the rate, eight at a time.

    Raises:
        ComputationError: a member takes too many steps, needs one that is too short, or leaves the range of doubles.
        CompileError: there is no compiler.
    """  # fmt: skip
    X, y = (np.ascontiguousarray(each) for each in start)
    at = np.ascontiguousarray(times)
    numbers, strides = system.members_numbers()
    sizes = [port.size for port in system.number_ports]
    pointers = (ctypes.c_void_p * max(1, len(numbers)))(*(each.ctypes.data for each in numbers))
    moves, wide = ((ctypes.c_ssize_t * max(1, len(numbers)))(*each) for each in (strides, sizes))
    size = WIDE * (2 * system.packed + (5 + STAGES) * system.size + sum(sizes))
    room = np.zeros(HALVES * size + WIDE)
    work = room.ctypes.data + -room.ctypes.data % 64  # each half as the registers lie
    one = Lanes(
        *system.blocks, system.lifting, len(X), system.packed, system.turns, system.group, system.quaternions, system.size,
        len(numbers),
        ctypes.addressof(pointers), ctypes.addressof(moves), ctypes.addressof(wide),
        rtol, atol, system.reach, X.ctypes.data, y.ctypes.data, at.ctypes.data, len(at) - 1, out[0].shape[1],
        out[0].ctypes.data + 8 * first * system.packed, out[1].ctypes.data + 8 * first * system.size, work, most,
    )  # fmt: skip
    halves = (Lanes * HALVES)(one, one)
    library, status = _library(), FULL
    for k, half in enumerate(halves):
        half.work = work + 8 * k * size
        library.lanes_start(ctypes.addressof(half))
    while status == FULL and not stopped():
        status = library.lanes_run(ctypes.addressof(halves), _ROUNDS)
    refuse(status, halves[0].stopped, atol, most, where)
    counts = np.sum([(half.steps, half.rejected, half.evaluations) for half in halves], axis=0)
    steps, rejected, evaluations = counts.tolist()
    return steps, rejected, evaluations
