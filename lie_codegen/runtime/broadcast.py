"""Compiled kernels called as numpy functions: arguments of any leading axes, broadcast against each other."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import NotFiniteError, ShapeError
from lie_codegen.runtime.call import Compiled
from lie_codegen.runtime.rows import row_by_row


def broadcast_call(function: Compiled[Any], *arguments: ArrayLike) -> tuple[Array, ...]:
    """Outputs of shape (..., *port.shape) of arguments of shape (..., *port.shape); batch axes broadcast.

    Raises:
        ShapeError: an argument's trailing axes are not its port's shape, or the leading ones do not broadcast.
        NotFiniteError: an argument holds NaN or infinity.
    """
    arrays, leading = [], []
    for port, value in zip(function.inputs, arguments, strict=True):
        try:
            array = np.asarray(value, dtype=np.float64, order="C")
        except (TypeError, ValueError) as error:
            raise ShapeError(f"{function.name}: {port.name} is not an array of real numbers") from error
        cut = array.ndim - len(port.shape)
        if cut < 0 or array.shape[cut:] != port.shape:
            raise ShapeError(f"{function.name}: {port.name} has shape {array.shape}, expected (..., {port.shape})")
        if not np.isfinite(array).all():
            raise NotFiniteError(f"{function.name}: {port.name} holds NaN or infinity")
        arrays.append(array)
        leading.append(array.shape[:cut])
    if not any(leading):  # one point: a call, with none of the work of a batch
        single: Any = function(*arrays)
        single = (single,) if len(function.outputs) == 1 else single
        return tuple(
            np.asarray(r, dtype=np.float64).reshape(p.shape)[()] for r, p in zip(single, function.outputs, strict=True)
        )
    try:
        batch = np.broadcast_shapes(*leading)
    except ValueError as error:
        raise ShapeError(f"{function.name}: leading axes {leading} do not broadcast") from error
    count = int(np.prod(batch))
    flat = [
        np.ascontiguousarray(np.broadcast_to(a, (*batch, *p.shape))).reshape((count, *p.shape))
        for a, p in zip(arrays, function.inputs, strict=True)
    ]
    return tuple(
        r.reshape((*batch, *p.shape))[()] for r, p in zip(row_by_row(function, *flat), function.outputs, strict=True)
    )
