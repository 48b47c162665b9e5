"""The narrow interface behind every compiled kernel, and its two forms: C through ctypes, CasADi's interpreter.

Arrays are C-contiguous, aligned, of double entries (complex ones as pairs); shapes were checked before.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from lie_codegen.codegen.signature import Signature, is_step
from lie_codegen.errors import CacheError
from lie_codegen.runtime.arguments import dtype_of
from lie_codegen.runtime.lane_library import LaneLibrary

Arrays = Sequence[np.ndarray[Any, Any]]


class Backend(Protocol):
    """One kernel, as a machine."""

    def call(self, inputs: Arrays, outputs: Arrays) -> None:
        """One evaluation."""

    def batch(self, count: int, inputs: Arrays, strides: Sequence[int], outputs: Arrays) -> None:
        """`count` evaluations; strides in doubles from one sample of an input to the next, 0 to repeat it."""

    def calls(self, count: int, inputs: Arrays, strides: Sequence[int], outputs: Arrays) -> None:
        """The same as `count` times `call`, without lanes."""

    def scan(
        self, count: int, every: int, inputs: Arrays, strides: Sequence[int], trajectory: np.ndarray[Any, Any]
    ) -> None:
        """state <- f(state, ...) `count` times, from inputs[0]; stores the start and every `every`-th state."""

    def scan_batch(
        self,
        count: int,
        steps: int,
        every: int,
        inputs: Arrays,
        strides: Sequence[tuple[int, int]],
        trajectories: np.ndarray[Any, Any],
    ) -> None:
        """`count` such loops; strides in doubles from one trajectory to the next and from one step to the next."""

    def reduce(
        self,
        count: int,
        steps: int,
        inputs: Arrays,
        strides: Sequence[tuple[int, int]],
        how: Sequence[int],
        outputs: Sequence[np.ndarray[Any, Any] | None],
    ) -> None:
        """`count` such loops of which the last states are kept, and each output with how[k] reduced into outputs[k]."""

    def loop_address(self, *, many: bool) -> int:
        """Where the C of `scan` (`scan_batch`) is; 0 if there is none."""

    def address(self, *, many: bool) -> int:
        """Where the C of `call` is, or of eight calls at once, with entry i of sample m at 8 i + m; 0 if there is none."""

    def beside(self, symbol: str, main: str, more_files: Mapping[str, str], more_flags: tuple[str, ...]) -> int:
        """Where a function of further C is that includes this kernel's over lanes; 0 if there is none."""


class _Workspace:
    """Buffers of one call, with their addresses; asking numpy for an address costs more than a kernel."""

    def __init__(self, signature: Signature) -> None:
        self.inputs = [np.empty(port.shape, dtype_of(port, signature.real)) for port in signature.inputs]
        self.outputs = [np.empty(port.shape, dtype_of(port, signature.real)) for port in signature.outputs]
        self.input_pointers = _pointers(self.inputs)
        self.output_pointers = _pointers(self.outputs)


class CtypesBackend:
    """Functions of a shared library; the interpreter lock is released while they run."""

    def __init__(self, library: ctypes.CDLL, signature: Signature, lanes: LaneLibrary | None = None) -> None:
        void, size = ctypes.c_void_p, ctypes.c_ssize_t
        self._lanes = lanes
        self._open_lanes: Callable[[], ctypes.CDLL] = (lambda: library) if lanes is None else lanes.open
        symbol = signature.symbol
        self._signature = signature
        self._idle: list[_Workspace] = []  # pop and append are atomic: no two calls ever share a workspace
        self._call = _function(library, f"{symbol}_call", void, void)
        self._calls = _function(
            library, f"{symbol}_batch", size, void, void, void
        )  # one lane: a loop over the function
        self._scan = None
        if is_step(signature.inputs, signature.outputs):
            self._scan = _function(library, f"{symbol}_scan", size, size, void, void, void)

    @cached_property
    def _batch(self) -> Any:
        void, size = ctypes.c_void_p, ctypes.c_ssize_t
        return _function(self._open_lanes(), f"{self._signature.symbol}_batch", size, void, void, void)

    @cached_property
    def _reduce(self) -> Any:
        void, size = ctypes.c_void_p, ctypes.c_ssize_t
        symbol = f"{self._signature.symbol}_reduce"
        return _function(self._open_lanes(), symbol, size, size, void, void, void, void, void)

    @cached_property
    def _scan_batch(self) -> Any:
        void, size = ctypes.c_void_p, ctypes.c_ssize_t
        symbol = f"{self._signature.symbol}_scan_batch"
        return _function(self._open_lanes(), symbol, size, size, size, void, void, void, void)

    def call(self, inputs: Arrays, outputs: Arrays) -> None:
        try:
            workspace = self._idle.pop()
        except IndexError:
            workspace = _Workspace(self._signature)
        for buffer, array in zip(workspace.inputs, inputs, strict=True):
            buffer[...] = array
        self._call(workspace.input_pointers, workspace.output_pointers)
        for buffer, array in zip(workspace.outputs, outputs, strict=True):
            array[...] = buffer
        self._idle.append(workspace)

    def batch(self, count: int, inputs: Arrays, strides: Sequence[int], outputs: Arrays) -> None:
        self._batch(count, _pointers(inputs), _strides(strides), _pointers(outputs))

    def calls(self, count: int, inputs: Arrays, strides: Sequence[int], outputs: Arrays) -> None:
        self._calls(count, _pointers(inputs), _strides(strides), _pointers(outputs))

    def scan(
        self, count: int, every: int, inputs: Arrays, strides: Sequence[int], trajectory: np.ndarray[Any, Any]
    ) -> None:
        if self._scan is None:
            raise CacheError("the library has no loop for this kernel")
        self._scan(count, every, _pointers(inputs), _strides(strides), trajectory.ctypes.data)

    def scan_batch(
        self,
        count: int,
        steps: int,
        every: int,
        inputs: Arrays,
        strides: Sequence[tuple[int, int]],
        trajectories: np.ndarray[Any, Any],
    ) -> None:
        if self._scan is None:
            raise CacheError("the library has no loop for this kernel")
        lanes, moves = (_strides([pair[side] for pair in strides]) for side in (0, 1))
        self._scan_batch(count, steps, every, _pointers(inputs), lanes, moves, trajectories.ctypes.data)

    def reduce(
        self,
        count: int,
        steps: int,
        inputs: Arrays,
        strides: Sequence[tuple[int, int]],
        how: Sequence[int],
        outputs: Sequence[np.ndarray[Any, Any] | None],
    ) -> None:
        lanes, moves = (_strides([pair[side] for pair in strides]) for side in (0, 1))
        kept = (ctypes.c_void_p * len(outputs))(*[None if each is None else each.ctypes.data for each in outputs])
        self._reduce(count, steps, _pointers(inputs), lanes, moves, (ctypes.c_int * len(how))(*how), kept)

    def loop_address(self, *, many: bool) -> int:
        if self._scan is None:
            return 0
        return ctypes.cast(self._scan_batch if many else self._scan, ctypes.c_void_p).value or 0

    def address(self, *, many: bool) -> int:
        symbol = self._signature.symbol
        if not many:
            return ctypes.cast(self._call, ctypes.c_void_p).value or 0
        library = None if self._lanes is None else self._lanes.block(symbol)
        return 0 if library is None else ctypes.cast(library[f"{symbol}_block"], ctypes.c_void_p).value or 0

    def beside(self, symbol: str, main: str, more_files: Mapping[str, str], more_flags: tuple[str, ...]) -> int:
        library = None if self._lanes is None else self._lanes.beside(main, more_files, more_flags)
        function = getattr(library, symbol, None)
        return 0 if function is None else ctypes.cast(function, ctypes.c_void_p).value or 0


def load_library(path: Path) -> ctypes.CDLL:
    """Open a shared library.

    Raises:
        CacheError: the system cannot load it.
    """
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        raise CacheError(
            f"the compiled library cannot be loaded: {error}; set LIE_CODEGEN_CACHE to a folder from which code may run"
        ) from error


def _function(library: ctypes.CDLL, symbol: str, *types: Any) -> Any:
    function = library[symbol]
    function.argtypes = types
    function.restype = None
    return function


def _pointers(arrays: Arrays) -> Any:
    return (ctypes.c_void_p * len(arrays))(*[array.ctypes.data for array in arrays])


def _strides(strides: Sequence[int]) -> Any:
    return (ctypes.c_ssize_t * len(strides))(*strides)
