"""What `lc.closed_loop` knows before it is told a start: arguments read and checked, kernels, numbers. Kept for calls alike.

A call is known by what it was told: arrays and numbers by their bytes, laws, references and groups by identity, which they are values
enough for. What may differ another time though it looks the same, a Python function, a file, an object with a kernel, is read anew.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.control.loop_adaptive import loop_system
from lie_codegen.control.loop_arguments import LoopArguments, loop_arguments
from lie_codegen.control.loop_library import loop_library, loop_numbers
from lie_codegen.control.loop_model import Loop
from lie_codegen.door import warnings_given
from lie_codegen.flow.pair_system import System
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.runtime.library import Library
from lie_codegen.values import Value

#: Bytes of an array, and entries of a sequence, up to which a call is worth knowing again: beyond, what they are for takes longer.
_BYTES, _ENTRIES = 2**15, 64
#: The arguments that a loop is known by.
TOLD = (
    "group", "law", "inertia", "reference", "t", "rtol", "tolerance", "step", "sample", "delay", "noise", "limits", "disturbance", "external",
    "observer", "gains", "order",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Prepared:
    """A loop without its start.

    Attributes:
        told: the arguments, read.
        loop, library: the loop and its kernels.
        numbers: inputs by name, of one loop or of N; nobody writes to them.
        loops: N, or None for one.
        system: the loop as the pair integrates it; None where it has no smooth rate on groups.
    """

    told: LoopArguments
    loop: Loop
    library: Library
    numbers: dict[str, Array]
    loops: int | None
    system: System | None


class _Call(tuple[Hashable, ...]):
    """A key, with the arguments that it stands for."""

    arguments: Sequence[Any]


class _UnknowableError(Exception):
    """An argument that cannot be known again."""


class _WarnedError(Exception):
    """A loop that was warned of: whoever asks for it again is warned again."""

    def __init__(self, made: Prepared) -> None:
        self.made = made


def prepared(method: str, arguments: Sequence[Any]) -> Prepared:
    """The loop of these arguments of `loop_arguments`, in the order of `TOLD`, prepared now or before.

    Raises:
        InputError, ShapeError, NotFiniteError: naming the argument.
    """
    try:
        call = _Call([method, *[None if value is None else _known(value) for value in arguments]])
    except _UnknowableError:
        return _prepare(method, arguments)
    call.arguments = arguments
    try:
        return _kept(call)
    except _WarnedError as warned:
        return warned.made


@lru_cache(maxsize=64)
def _kept(call: _Call) -> Prepared:
    # the key lives as long as what it is the key of, and with it the laws that it knows by identity; arrays are the caller's to change
    before, call.arguments = warnings_given(), [_own(value) for value in call.arguments]
    made = _prepare(str(call[0]), call.arguments)
    for value in (made.told.times, *made.numbers.values()):
        value.flags.writeable = False
    if warnings_given() > before:
        raise _WarnedError(made)
    return made


def _own(value: Any) -> Any:
    """The value with arrays of its own."""
    if isinstance(value, np.ndarray):
        return value.copy()
    if type(value) in (list, tuple):
        return type(value)(map(_own, value))
    return {name: _own(each) for name, each in value.items()} if type(value) is dict else value


def _known(value: Any) -> Hashable:
    """What tells a value from others.

    Raises:
        _UnknowableError: it may change, or is large.
    """
    kind = type(value)
    if kind is np.ndarray:
        if value.nbytes <= _BYTES and value.dtype.kind in "fiub":
            return value.shape, value.dtype, value.tobytes()
    elif value is None or kind is float or kind is int or kind is bool:
        return kind, value
    if kind is str and not value.endswith(".toml") and value != "-":
        return kind, value
    if kind in (list, tuple) and len(value) <= _ENTRIES:
        return kind, *map(_known, value)
    if kind is dict and len(value) <= _ENTRIES and all(type(name) is str for name in value):
        return kind, *value, *map(_known, value.values())
    if isinstance(value, MatrixGroup) or (
        isinstance(value, Kernel | Value) and getattr(value, "definition", None) is not None
    ):
        return kind, id(value)
    raise _UnknowableError


def _prepare(method: str, values: Sequence[Any]) -> Prepared:
    arguments = dict(zip(TOLD, values, strict=True))
    told = loop_arguments(**arguments)
    by_rate = told.kind == "continuous" and (told.step is None or method == "gauss")
    loop, library = loop_library(told.model, told.reference, "adaptive" if by_rate else told.kind)
    numbers, loops = loop_numbers(loop, told.inertia, arguments["gains"] or {}, told.numbers)
    system = loop_system(loop, library, numbers) if "loop_rate" in library.kernels else None
    return Prepared(told, loop, library, numbers, loops, system)
