"""Loops of a sampled law: steps of a motion, then a call of the law, with noise that is drawn in the loop; see templates/loop.c."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.codegen.templates import template_folder
from lie_codegen.errors import CompileError
from lie_codegen.runtime.arguments_scan import loops
from lie_codegen.runtime.backend import load_library
from lie_codegen.runtime.philox import uniforms
from lie_codegen.runtime.sources import build_source
from lie_codegen.runtime.threads import in_parts


@dataclass(frozen=True)
class NoiseStream:
    """Which numbers are drawn.

    Attributes:
        seed: 64 bits, the key.
        what: (b,) one number for each block of four: 256 times the kind of noise, plus the block.
        first: index of the first loop.
    """

    seed: int
    what: NDArray[np.uint32]
    first: int = 0

    @classmethod
    def of(cls, seed: int, kinds: Sequence[int], sizes: Sequence[int], first: int = 0) -> NoiseStream:
        """The stream of these kinds of noise, so many components each: what one draws does not depend on the others."""
        what = [256 * kind + block for kind, size in zip(kinds, sizes, strict=True) for block in range(-(-size // 4))]
        return cls(seed % 2**64, np.array(what, dtype=np.uint32), first)

    def at(self, count: int, sample: int) -> Array:
        """(N, 4 b) numbers of N loops at one sample."""
        return uniforms(self.seed, self.what, np.arange(self.first, self.first + count, dtype=np.uint64), sample)


@dataclass(frozen=True)
class SampledTask:
    """A stretch of a sampled loop.

    Attributes:
        spans: states to be kept.
        samples: between two of them.
        parts: steps of the motion a sample.
        first: number of the sample at which the stretch begins.
        command: components of the command, the last of the state.
        delay: samples from the call of the law to when its command acts.
    """

    spans: int
    samples: int
    parts: int
    first: int
    command: int
    delay: int = 0


class _Stage(ctypes.Structure):
    _fields_ = [
        ("scan", ctypes.c_void_p),
        ("batch", ctypes.c_void_p),
        ("inputs", ctypes.c_ssize_t),
        ("noise", ctypes.c_ssize_t),
        ("inputs_at", ctypes.c_void_p),
        ("lane", ctypes.c_void_p),
        ("step", ctypes.c_void_p),
    ]


class _Noise(ctypes.Structure):
    _fields_ = [
        ("seed", ctypes.c_uint64),
        ("first_loop", ctypes.c_uint64),
        ("first_sample", ctypes.c_uint64),
        ("blocks", ctypes.c_ssize_t),
        ("what", ctypes.c_void_p),
    ]


class _Task(ctypes.Structure):
    _fields_ = [(n, ctypes.c_ssize_t) for n in ("spans", "samples", "parts", "size", "command", "delay")] + [
        ("ring", ctypes.c_void_p)
    ]


@dataclass(frozen=True)
class _Bound:
    """A kernel with its inputs."""

    kernel: Any
    arrays: list[Array]
    strides: list[tuple[int, int]]
    noise: int

    def structure(self, start: int, many: bool, keep: list[Any]) -> _Stage:
        """For C, from loop `start` on; what must live as long goes to `keep`."""
        pointers = np.array(
            [a.ctypes.data + 8 * start * lane for a, (lane, _) in zip(self.arrays, self.strides, strict=True)],
            dtype=np.uintp,
        )
        lane, step = (np.array([pair[side] for pair in self.strides], dtype=np.intp) for side in (0, 1))
        keep += [pointers, lane, step]
        backend = self.kernel.backend
        return _Stage(
            backend.loop_address(many=False), backend.loop_address(many=True) if many else 0, len(self.arrays), self.noise,
            pointers.ctypes.data, lane.ctypes.data, step.ctypes.data,
        )  # fmt: skip


def sampled_loop(
    library: Any,
    names: Sequence[str],
    start: Array,
    task: SampledTask,
    inputs: Mapping[str, Mapping[str, Any]],
    noise: NoiseStream,
    ring: Array,
    *,
    threads: int = 1,
) -> Array:
    """(N, spans, m) states kept, from (N, m) states at the beginning of the stretch.

    Args:
        library: has the kernels.
        names: (both,), a step and then the law; or (motion, control), with several steps a sample.
        start: the states.
        task: the stretch.
        inputs: kernel -> its inputs by name but for state and noise, as `scan_batch` takes them: those of the law one a sample,
            for the calls at the end of each, those of the motion one a step.
        noise: what is drawn for a kernel's input `noise`.
        ring: (N, delay, command) of commands on their way, changed in place.
        threads: over which the loops are shared out.
    """
    total = task.spans * task.samples
    bound = [
        _bound(library[name], start, inputs[name], total * (task.parts if len(names) == 2 and i == 0 else 1))
        for i, name in enumerate(names)
    ]
    found = np.empty((len(start), task.spans, start.shape[1]))
    loop = _c_loop if bound[0].kernel.backend.loop_address(many=False) and _library() else _numpy_loop

    def some(first: int, last: int) -> None:
        loop(bound, start, task, noise, ring, found, first, last)

    in_parts(some, len(start), threads, total * task.parts)
    return found


def _bound(kernel: Any, start: Array, inputs: Mapping[str, Any], calls: int) -> _Bound:
    values: list[Any] = [start]
    place = -1
    for number, port in enumerate(kernel.signature.inputs[1:], 1):
        if port.name == "noise":
            place = number
        values.append(np.zeros(port.shape) if port.name == "noise" else inputs[port.name])
    arrays, strides, _ = loops(kernel.signature, values, calls)
    return _Bound(kernel, arrays, strides, place)


@lru_cache(maxsize=1)
def _library() -> ctypes.CDLL | None:
    """The compiled loop; None where there is no compiler."""
    try:
        path = build_source(
            lambda: {"loop.c": (template_folder() / "loop.c").read_text(encoding="utf-8")},
            "loop.c",
            namespace="lie_codegen_loop",
            definition="loop",
        )
    except CompileError:
        return None
    if path is None:
        return None
    library = load_library(path)
    library.lie_codegen_loop.restype = None
    library.lie_codegen_loop_work.restype = ctypes.c_ssize_t
    return library


def _c_loop(
    bound: Sequence[_Bound],
    start: Array,
    task: SampledTask,
    noise: NoiseStream,
    ring: Array,
    found: Array,
    first: int,
    last: int,
) -> None:
    library = _library()
    if library is None:
        return
    size, many = start.shape[1], len(start) > 1
    keep: list[Any] = []
    stages = [each.structure(first, many, keep) for each in bound]
    pointers = [ctypes.byref(stages[0]), None, None] if len(stages) == 1 else [None, *map(ctypes.byref, stages)]
    blocks = len(noise.what) if any(each.noise >= 0 for each in bound) else 0
    drawn = _Noise(noise.seed, noise.first + first, task.first, blocks, noise.what.ctypes.data)
    mine = ring[first:]
    told = _Task(
        task.spans, task.samples, task.parts, size, task.command, task.delay, mine.ctypes.data if mine.size else None
    )
    space = np.empty(int(library.lie_codegen_loop_work(ctypes.c_ssize_t(size), ctypes.c_ssize_t(blocks))))
    library.lie_codegen_loop(
        ctypes.c_ssize_t(last - first), ctypes.byref(told), *pointers, ctypes.byref(drawn),
        ctypes.c_void_p(start.ctypes.data + 8 * first * size), ctypes.c_ssize_t(size),
        ctypes.c_void_p(found.ctypes.data + 8 * first * task.spans * size), ctypes.c_ssize_t(task.spans * size),
        ctypes.c_void_p(space.ctypes.data), ctypes.c_int(many),
    )  # fmt: skip


def _numpy_loop(
    bound: Sequence[_Bound],
    start: Array,
    task: SampledTask,
    noise: NoiseStream,
    ring: Array,
    found: Array,
    first: int,
    last: int,
) -> None:
    """The same without a compiler, call by call."""
    state = np.ascontiguousarray(start[first:last])
    stream = NoiseStream(noise.seed, noise.what, noise.first + first)
    for sample in range(task.spans * task.samples):
        for i, each in enumerate(bound):
            calls = task.parts if i + 1 < len(bound) else 1
            arguments: list[Any] = [state]
            for k, (array, (lane, step)) in enumerate(zip(each.arrays, each.strides, strict=True)):
                if k == 0:
                    continue
                here = array[first:last] if lane else array
                begin = sample * calls
                if k == each.noise:
                    here = stream.at(len(state), task.first + sample + 1)
                elif step:
                    here = np.ascontiguousarray(here[:, begin : begin + calls])
                arguments.append(here)
            state = np.ascontiguousarray(each.kernel.scan_batch(*arguments, n=calls, every=calls)[:, -1])
        if task.delay:
            place = (task.first + sample + 1) % task.delay
            acting = ring[first:last, place].copy()
            ring[first:last, place] = state[:, -task.command :]
            state[:, -task.command :] = acting
        if (sample + 1) % task.samples == 0:
            found[first:last, sample // task.samples] = state
