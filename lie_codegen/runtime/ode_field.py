"""The right side of a differential equation, as the loops of templates/ode.c call it."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.runtime.call import Compiled
from lie_codegen.runtime.ode_library import CALLBACK, FieldRecord


class Field:
    """f(t, y) of a compiled kernel, or of a Python function, as C calls it.

    Args:
        rate: a kernel whose input `state` is y and whose first output is f (or the values of events); or f(t, y) -> (n,).
        size: n, the size of y, also where the values are those of events.
        state, time: names of the kernel's inputs; time None where it has none.
        constants: the other inputs, by name.
    """

    def __init__(
        self,
        rate: Compiled[Any] | Callable[[float, Array], ArrayLike],
        size: int,
        *,
        state: str = "y",
        time: str | None = "t",
        constants: Mapping[str, ArrayLike] | None = None,
    ) -> None:
        self.size, self.rate = size, rate
        self._error: BaseException | None = None
        if not _is_kernel(rate):
            self.address, self.places, self.inputs = 0, (0, 0), []
            self.outputs: list[Array] = []
            return
        names = [port.name for port in rate.inputs]
        given = dict(constants or {})
        self.places = (names.index(state), names.index(time) if time in names else -1)
        self.inputs = [
            np.zeros(port.shape) if number in self.places
            else _filled(given.pop(port.name), port.shape)
            for number, port in enumerate(rate.inputs)
        ]  # fmt: skip
        if given:
            raise InputError(f"{rate.name} has no input {', '.join(given)}")
        if rate.inputs[self.places[0]].size != size:
            raise ShapeError(f"{rate.name}: {state} has {rate.inputs[self.places[0]].size} entries, not {size}")
        self.outputs = [np.zeros(port.shape) for port in rate.outputs]
        self.address = rate.backend.address(many=False)

    def __call__(self, t: float, y: Array) -> Array:
        """f(t, y), by Python."""
        if not _is_kernel(self.rate):
            return np.asarray(self.rate(t, y), dtype=float)
        given: list[Any] = list(self.inputs)
        given[self.places[0]] = np.reshape(y, self.rate.inputs[self.places[0]].shape)
        if self.places[1] >= 0:
            given[self.places[1]] = t
        result = self.rate(*given)
        first = result if len(self.rate.outputs) == 1 else result[0]
        return np.atleast_1d(np.asarray(first, dtype=float)).ravel()

    @cached_property
    def record(self) -> FieldRecord:
        """What the C code reads."""
        pointers = (ctypes.c_void_p * max(1, len(self.inputs)))(*[each.ctypes.data for each in self.inputs])
        results = (ctypes.c_void_p * max(1, len(self.outputs)))(*[each.ctypes.data for each in self.outputs])
        callback = None if self.address else CALLBACK(self._called)
        self._kept = (pointers, results, callback)  # alive as long as the field is
        return FieldRecord(
            self.address or None,
            None if callback is None else ctypes.cast(callback, ctypes.c_void_p).value,
            self.size, len(self.inputs), *self.places, len(self.outputs),
            ctypes.cast(pointers, ctypes.c_void_p).value, ctypes.cast(results, ctypes.c_void_p).value,
        )  # fmt: skip

    def _called(self, t: float, y: int, result: int) -> int:
        try:
            state = np.ctypeslib.as_array(ctypes.cast(y, ctypes.POINTER(ctypes.c_double)), (self.size,))
            found = self(t, state.copy())
            np.ctypeslib.as_array(ctypes.cast(result, ctypes.POINTER(ctypes.c_double)), found.shape)[:] = found
        except BaseException as error:  # it cannot pass through C; `raise_pending` raises it on the other side
            self._error = error
            return 1
        return 0

    def raise_pending(self) -> None:
        """Raise what a Python function raised while C called it."""
        error, self._error = self._error, None
        if error is not None:
            raise error


def _is_kernel(rate: Any) -> TypeGuard[Compiled[Any]]:
    """Whether it is a compiled kernel, behind the extension type or not."""
    return hasattr(rate, "signature") and hasattr(rate, "backend")


def _filled(value: ArrayLike, shape: tuple[int, ...]) -> Array:
    """A copy of its own, in C order, of a number or an array as one of a shape."""
    array = np.array(value, dtype=float, order="C")
    return array if array.shape == shape else np.array(np.broadcast_to(array, shape), order="C")


def only_python(*fields: Field | None) -> bool:
    """Whether a kernel among them has no C: CasADi's interpreter is not to be called from C."""
    return any(each is not None and _is_kernel(each.rate) and not each.address for each in fields)
