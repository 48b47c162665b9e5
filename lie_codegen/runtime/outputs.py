"""New arrays for results: large ones from memory that was touched before (templates/output_pool.h), where there is the extension."""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.runtime.extension import extension

_FROM = 32_768  # bytes


def empty(shape: tuple[int, ...], dtype: np.dtype[Any]) -> Array:
    """As numpy.empty of float64, complex128, float32 or complex64; 64-byte aligned where it is large, and not at the price of fresh pages."""
    if prod(shape) * dtype.itemsize < _FROM:
        return np.empty(shape, dtype)
    module = extension()
    if module is None:
        return np.empty(shape, dtype)
    if dtype in (np.dtype(np.float64), np.dtype(np.complex128)):
        array: Array = module.empty(shape, dtype.kind == "c")
        return array
    doubles: Array = module.empty((-(-prod(shape) * dtype.itemsize // 8),), False)
    return doubles.view(dtype)[: prod(shape)].reshape(shape)


def copied(values: Array) -> Array:
    """A copy in C order, in memory as `empty` gives it."""
    if values.nbytes < _FROM:
        return values.copy()
    array = empty(values.shape, values.dtype)
    array[...] = values
    return array


def idle_bytes() -> int:
    """Memory of results that are gone, kept for the next ones: 512 MB or a quarter of the machine's at most; given back when idle."""
    module = extension()
    return 0 if module is None else int(module.idle_bytes())
