"""The narrow interface behind every compiled kernel, and its two forms: C through ctypes, CasADi's interpreter.

Arrays are C-contiguous, aligned, of double entries (complex ones as pairs); shapes were checked before.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from lie_codegen.codegen.signature import Signature
from lie_codegen.codegen.views import is_step
from lie_codegen.errors import CacheError

Arrays = Sequence[np.ndarray[Any, Any]]


class Backend(Protocol):
    """One kernel, as a machine."""

    def call(self, inputs: Arrays, outputs: Arrays) -> None:
        """One evaluation."""

    def batch(self, count: int, inputs: Arrays, strides: Sequence[int], outputs: Arrays) -> None:
        """`count` evaluations; strides in doubles from one sample of an input to the next, 0 to repeat it."""

    def scan(
        self, count: int, every: int, inputs: Arrays, strides: Sequence[int], trajectory: np.ndarray[Any, Any]
    ) -> None:
        """state <- f(state, ...) `count` times, from inputs[0]; stores the start and every `every`-th state."""


class CtypesBackend:
    """Functions of a shared library; the interpreter lock is released while they run."""

    def __init__(self, library: ctypes.CDLL, signature: Signature) -> None:
        self._inputs = ctypes.c_void_p * len(signature.inputs)
        self._outputs = ctypes.c_void_p * len(signature.outputs)
        self._strides = ctypes.c_ssize_t * len(signature.inputs)
        self._call = _function(library, f"{signature.symbol}_call", ctypes.c_void_p, ctypes.c_void_p)
        self._batch = _function(library, f"{signature.symbol}_batch", ctypes.c_ssize_t, *[ctypes.c_void_p] * 3)
        self._scan = (
            _function(library, f"{signature.symbol}_scan", ctypes.c_ssize_t, ctypes.c_ssize_t, *[ctypes.c_void_p] * 3)
            if is_step(signature.inputs, signature.outputs)
            else None
        )

    def call(self, inputs: Arrays, outputs: Arrays) -> None:
        self._call(self._inputs(*[a.ctypes.data for a in inputs]), self._outputs(*[a.ctypes.data for a in outputs]))

    def batch(self, count: int, inputs: Arrays, strides: Sequence[int], outputs: Arrays) -> None:
        self._batch(
            count,
            self._inputs(*[a.ctypes.data for a in inputs]),
            self._strides(*strides),
            self._outputs(*[a.ctypes.data for a in outputs]),
        )

    def scan(
        self, count: int, every: int, inputs: Arrays, strides: Sequence[int], trajectory: np.ndarray[Any, Any]
    ) -> None:
        if self._scan is None:
            raise CacheError("the library has no loop for this kernel")
        self._scan(
            count,
            every,
            self._inputs(*[a.ctypes.data for a in inputs]),
            self._strides(*strides),
            trajectory.ctypes.data,
        )


class InterpretedBackend:
    """CasADi's interpreter: the same numbers, without a compiler."""

    def __init__(self, function: Any) -> None:
        self._function = function

    def call(self, inputs: Arrays, outputs: Arrays) -> None:
        results = self._function.call([_flat(array) for array in inputs])
        for array, result in zip(outputs, results, strict=True):
            _flat(array)[:] = result.nonzeros()

    def batch(self, count: int, inputs: Arrays, strides: Sequence[int], outputs: Arrays) -> None:
        rows = [_flat(array) for array in inputs]
        sizes = [self._function.numel_in(i) for i in range(len(inputs))]
        targets = [_flat(array).reshape(count, -1) for array in outputs] if count else []
        for k in range(count):
            starts = [k * stride for stride in strides]
            results = self._function.call(
                [row[start : start + size] for row, start, size in zip(rows, starts, sizes, strict=True)]
            )
            for target, result in zip(targets, results, strict=True):
                target[k] = result.nonzeros()

    def scan(
        self, count: int, every: int, inputs: Arrays, strides: Sequence[int], trajectory: np.ndarray[Any, Any]
    ) -> None:
        rows = [_flat(array) for array in inputs]
        sizes = [self._function.numel_in(i) for i in range(len(inputs))]
        stored = _flat(trajectory).reshape(count // every + 1, -1)
        state: Any = rows[0]
        stored[0] = state
        for k in range(count):
            rest = [
                row[k * stride : k * stride + size]
                for row, stride, size in zip(rows[1:], strides[1:], sizes[1:], strict=True)
            ]
            state = np.array(self._function.call([state, *rest])[0].nonzeros())
            if (k + 1) % every == 0:
                stored[(k + 1) // every] = state


def load_library(path: Path) -> ctypes.CDLL:
    """Open a shared library.

    Raises:
        CacheError: the system cannot load it.
    """
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        raise CacheError(f"the compiled library {path} cannot be loaded: {error}") from error


def _function(library: ctypes.CDLL, symbol: str, *types: Any) -> Any:
    function = library[symbol]
    function.argtypes = types
    function.restype = None
    return function


def _flat(array: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """The doubles of an array, as a view."""
    return array.reshape(-1).view(np.float64)
