"""The kernel arithmetic over numpy arrays: a kernel evaluated at many points at once, without a compiler."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import NotFiniteError, ShapeError
from lie_codegen.kernel.kernel import Kernel, Port


class NumpyArithmetic:
    """Element by element; both branches of `where` are evaluated, as in generated code."""

    routines = True

    def constant(self, value: Any) -> float:
        return float(value)

    sin: Callable[..., Any] = staticmethod(np.sin)
    cos: Callable[..., Any] = staticmethod(np.cos)
    tan: Callable[..., Any] = staticmethod(np.tan)
    exp: Callable[..., Any] = staticmethod(np.exp)
    expm1: Callable[..., Any] = staticmethod(np.expm1)
    log: Callable[..., Any] = staticmethod(np.log)
    sqrt: Callable[..., Any] = staticmethod(np.sqrt)
    sinh: Callable[..., Any] = staticmethod(np.sinh)
    cosh: Callable[..., Any] = staticmethod(np.cosh)
    tanh: Callable[..., Any] = staticmethod(np.tanh)
    acos: Callable[..., Any] = staticmethod(np.arccos)
    asin: Callable[..., Any] = staticmethod(np.arcsin)
    atan: Callable[..., Any] = staticmethod(np.arctan)
    atan2: Callable[..., Any] = staticmethod(np.arctan2)
    fabs: Callable[..., Any] = staticmethod(np.fabs)

    def less(self, a: Any, b: Any) -> Any:
        return np.less(a, b)

    def where(self, condition: Any, then: Any, otherwise: Any) -> Any:
        return np.where(condition, then, otherwise)

    def call(self, routine: Any, values: list[Any], when: Any = None) -> list[Any]:
        """The routine at one point after another."""
        condition = np.asarray(True if when is None else when)
        shape = np.broadcast_shapes(condition.shape, *(np.shape(value) for value in values))
        points = np.stack([np.broadcast_to(value, shape).ravel() for value in values], axis=-1).astype(np.float64)
        results = np.zeros((len(points), routine.outputs))
        for k in np.flatnonzero(np.broadcast_to(condition, shape).ravel()):
            results[k] = routine.evaluate(points[k])
        return [results[:, i].reshape(shape) for i in range(routine.outputs)]


def evaluate(kernel: Kernel, *arguments: ArrayLike) -> tuple[Array, ...]:
    """The outputs of a real kernel at one point or at many; batch axes lead and broadcast.

    Args:
        kernel: a kernel whose ports are real.
        arguments: for each input port an array of shape (..., *port.shape).

    Returns:
        For each output port an array of shape (..., *port.shape).

    Raises:
        ShapeError: an argument's trailing axes are not the port's shape.
        NotFiniteError: an argument holds NaN or infinity.
    """
    arrays = [_checked(kernel, port, value) for port, value in zip(kernel.inputs, arguments, strict=True)]
    batch = np.broadcast_shapes(*(a.shape[: a.ndim - len(p.shape)] for a, p in zip(arrays, kernel.inputs, strict=True)))
    with np.errstate(divide="ignore", invalid="ignore"):
        results = kernel.evaluate(
            NumpyArithmetic(), *(_spread(p, a) for p, a in zip(kernel.inputs, arrays, strict=True))
        )
    return tuple(_gathered(port, value, batch) for port, value in zip(kernel.outputs, results, strict=True))


def _checked(kernel: Kernel, port: Port, value: ArrayLike) -> Array:
    array = np.asarray(value, dtype=np.float64)
    if array.shape[max(array.ndim - len(port.shape), 0) :] != port.shape:
        raise ShapeError(f"{kernel.name}: {port.name} has shape {array.shape}, expected (..., {port.shape})")
    if not np.isfinite(array).all():
        raise NotFiniteError(f"{kernel.name}: {port.name} holds NaN or infinity")
    return array


def _spread(port: Port, array: Array) -> Any:
    if not port.shape:
        return array
    if len(port.shape) == 1:
        return [array[..., i] for i in range(port.shape[0])]
    return [[array[..., i, j] for j in range(port.shape[1])] for i in range(port.shape[0])]


def _gathered(port: Port, value: Any, batch: tuple[int, ...]) -> Array:
    if not port.shape:
        return np.array(np.broadcast_to(value, batch), dtype=np.float64)
    if len(port.shape) == 1:
        return np.stack([np.broadcast_to(entry, batch) for entry in value], axis=-1).astype(np.float64)
    rows = [np.stack([np.broadcast_to(entry, batch) for entry in row], axis=-1) for row in value]
    return np.stack(rows, axis=-2).astype(np.float64)
