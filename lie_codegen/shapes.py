"""Checks of the shape of an array and of the length of a list: what is refused is named, with what is taken."""

from __future__ import annotations

from collections.abc import Sequence
from types import EllipsisType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import ShapeError


def shaped(value: ArrayLike, shape: tuple[int | str | EllipsisType, ...], where: str) -> Array:
    """The value as doubles of a shape: (3,), (..., 3) with any axes before, ("k", 3) with an axis of any length.

    Raises:
        ShapeError: naming `where`: no numbers, complex ones, or another shape, with the one that is taken.
    """
    try:
        array = np.asarray(value)
        is_complex = array.dtype.kind == "c"
        array = array if is_complex else array.astype(float, copy=False)
    except (TypeError, ValueError):
        raise ShapeError(f"{where} must be numbers of shape {_written(shape)}, given {value!r:.60}") from None
    if is_complex:
        raise ShapeError(f"{where} is real, of shape {_written(shape)}; complex numbers were given")
    open_ended = shape[:1] == (...,)
    last = shape[1:] if open_ended else shape
    own = array.shape[max(0, array.ndim - len(last)) :] if open_ended else array.shape
    if len(own) != len(last) or any(n != m for n, m in zip(last, own, strict=True) if not isinstance(n, str)):
        raise ShapeError(f"{where} has shape {array.shape}; give {_written(shape)}")
    return array


def _written(shape: tuple[int | str | EllipsisType, ...]) -> str:
    return str(shape).replace("Ellipsis", "...").replace("'", "")


def entries_of(value: Any, count: int, where: str) -> list[Any]:
    """The entries of a list, a tuple, an array or a SymPy vector of so many, numbers or texts as they are.

    Raises:
        ShapeError: naming `where`: it is none, or holds another number of them.
    """
    of_sympy = getattr(value, "flat", None)  # a method there, an iterator of numpy's
    rows = of_sympy() if callable(of_sympy) else value.tolist() if hasattr(value, "tolist") else value
    if isinstance(rows, str) or not isinstance(rows, Sequence) or len(rows) != count:
        raise ShapeError(f"{where} must hold {count} entries, given {value!r:.80}")
    return list(rows)
