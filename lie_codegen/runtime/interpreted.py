"""Backends without C of their own: CasADi's interpreter, and doubles in the place of floats."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from lie_codegen.runtime.backend import Arrays, Backend


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

    calls = batch

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

    def scan_batch(
        self,
        count: int,
        steps: int,
        every: int,
        inputs: Arrays,
        strides: Sequence[tuple[int, int]],
        trajectories: np.ndarray[Any, Any],
    ) -> None:
        rows = [_flat(array) for array in inputs]
        for j in range(count):
            mine = [row[j * lane :] for row, (lane, _) in zip(rows, strides, strict=True)]
            mine[0] = mine[0][: self._function.numel_in(0)]
            self.scan(steps, every, mine, [step for _, step in strides], trajectories[j])

    def reduce(
        self,
        count: int,
        steps: int,
        inputs: Arrays,
        strides: Sequence[tuple[int, int]],
        how: Sequence[int],
        outputs: Sequence[np.ndarray[Any, Any] | None],
    ) -> None:
        rows = [_flat(array) for array in inputs]
        sizes = [self._function.numel_in(i) for i in range(len(inputs))]
        states, *kept = [None if each is None else _flat(each).reshape(count, -1) for each in outputs]
        for j in range(count):
            state: Any = rows[0][j * strides[0][0] :][: sizes[0]]
            for k in range(steps):
                starts = [j * lane + k * step for lane, step in strides[1:]]
                rest = [row[at : at + size] for row, at, size in zip(rows[1:], starts, sizes[1:], strict=True)]
                found = [np.array(each.nonzeros()) for each in self._function.call([state, *rest])]
                state = found[0]
                for way, target, value in zip(how[1:], kept, found[1:], strict=True):
                    if target is not None:
                        target[j] = _REDUCED[way](target[j], value)
            if states is not None:
                states[j] = state

    def loop_address(self, *, many: bool) -> int:
        return 0

    def address(self, *, many: bool) -> int:
        return 0

    def beside(self, symbol: str, main: str, more_files: Mapping[str, str], more_flags: tuple[str, ...]) -> int:
        return 0


class Rounded:
    """A backend that computes in doubles, for arrays of floats."""

    def __init__(self, backend: Backend) -> None:
        self._backend = backend

    def call(self, inputs: Arrays, outputs: Arrays) -> None:
        with _doubles(outputs) as wide:
            self._backend.call([_widened(array) for array in inputs], wide)

    def batch(self, count: int, inputs: Arrays, strides: Sequence[int], outputs: Arrays) -> None:
        with _doubles(outputs) as wide:
            self._backend.batch(count, [_widened(array) for array in inputs], strides, wide)

    def calls(self, count: int, inputs: Arrays, strides: Sequence[int], outputs: Arrays) -> None:
        with _doubles(outputs) as wide:
            self._backend.calls(count, [_widened(array) for array in inputs], strides, wide)

    def scan(
        self, count: int, every: int, inputs: Arrays, strides: Sequence[int], trajectory: np.ndarray[Any, Any]
    ) -> None:
        with _doubles([trajectory]) as (wide,):
            self._backend.scan(count, every, [_widened(array) for array in inputs], strides, wide)

    def scan_batch(
        self,
        count: int,
        steps: int,
        every: int,
        inputs: Arrays,
        strides: Sequence[tuple[int, int]],
        trajectories: np.ndarray[Any, Any],
    ) -> None:
        with _doubles([trajectories]) as (wide,):
            self._backend.scan_batch(count, steps, every, [_widened(array) for array in inputs], strides, wide)

    def reduce(
        self,
        count: int,
        steps: int,
        inputs: Arrays,
        strides: Sequence[tuple[int, int]],
        how: Sequence[int],
        outputs: Sequence[np.ndarray[Any, Any] | None],
    ) -> None:
        with _doubles([each for each in outputs if each is not None]) as wide:
            rest = iter(wide)
            given = [None if each is None else next(rest) for each in outputs]
            self._backend.reduce(count, steps, [_widened(array) for array in inputs], strides, how, given)

    def loop_address(self, *, many: bool) -> int:
        return 0

    def address(self, *, many: bool) -> int:
        return 0

    def beside(self, symbol: str, main: str, more_files: Mapping[str, str], more_flags: tuple[str, ...]) -> int:
        return 0


def _widened(array: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    return array.astype(np.complex128 if array.dtype.kind == "c" else np.float64)


@contextmanager
def _doubles(outputs: Arrays) -> Iterator[list[np.ndarray[Any, Any]]]:
    """Arrays of doubles in the place of the outputs, which get them rounded."""
    wide = [_widened(array) for array in outputs]
    yield wide
    for array, values in zip(outputs, wide, strict=True):
        array[...] = values


#: How the numbers of `scans.REDUCTIONS` reduce; a NaN stays.
_REDUCED: dict[int, Callable[[Any, Any], Any]] = {1: np.add, 2: np.maximum, 3: np.minimum, 4: lambda _, new: new}


def _flat(array: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """The doubles of an array, as a view."""
    return array.reshape(-1).view(np.float64)
