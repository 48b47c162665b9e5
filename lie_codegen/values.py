"""Results as values: dataclasses that hold arrays, compared by what they hold and printed short."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from dataclasses import Field, fields
from typing import Any, ClassVar

import numpy as np

#: Lines and characters of a printed value.
_LINES, _WIDTH = 10, 110
_FEW = 4


class Value:
    """Base of frozen dataclasses (declared with eq=False and repr=False) whose fields are plain data, arrays among them.

    Two values are equal where they are of one class and all compared fields are: arrays by shape, type and entry, NaN equal to
    itself. Equal values have equal hashes.
    """

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(same(getattr(self, name), getattr(other, name)) for name in _compared(self))

    def __hash__(self) -> int:
        return hash((type(self).__name__, *(_hashed(getattr(self, name)) for name in _compared(self))))

    def __repr__(self) -> str:
        shown = [f"{each.name}={brief(getattr(self, each.name))}" for each in fields(self) if each.repr]
        one = f"{type(self).__name__}({', '.join(shown)})"
        if len(one) <= _WIDTH:
            return one
        lines = [f"    {part}"[:_WIDTH] for part in shown]
        if len(lines) > _LINES - 2:
            lines = [*lines[: _LINES - 3], f"    and {len(lines) - _LINES + 3} more"]
        return "\n".join([f"{type(self).__name__}(", *lines, ")"])


def same(a: Any, b: Any) -> bool:
    """Whether two plain values are equal, as one bool: arrays entry by entry, NaN equal to itself."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        x, y = np.asarray(a), np.asarray(b)
        inexact = x.dtype.kind in "fc" and y.dtype.kind in "fc"
        return x.dtype == y.dtype and bool(np.array_equal(x, y, equal_nan=inexact))
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(same(value, b[key]) for key, value in a.items())
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return type(a) is type(b) and len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, float) and isinstance(b, float) and a != a and b != b:
        return True
    return bool(a == b)


def brief(value: Any) -> str:
    """A value in one short line: arrays by type and shape, unless they hold a few numbers."""
    if isinstance(value, np.ndarray):
        if value.ndim == 1 and value.size <= _FEW and value.dtype.kind in "iuf":
            return f"[{', '.join(f'{entry:.6g}' for entry in value)}]"
        return f"<{value.dtype} {' x '.join(map(str, value.shape)) or 'scalar'}>"
    if isinstance(value, float):
        return f"{value:.6g}"
    name = getattr(value, "name", None)
    if isinstance(name, str) and not isinstance(value, str) and hasattr(value, "labels"):
        return name  # a group
    return reprlib.repr(value).replace("\n", " ")


def _compared(value: Any) -> list[str]:
    return [each.name for each in fields(value) if each.compare]


def _hashed(value: Any) -> int:
    if isinstance(value, np.ndarray):
        # -0.0 equals 0.0, and NaN has many bit patterns: neither may change the hash.
        plain = value if value.dtype.kind not in "fc" else np.where(np.isnan(value), np.nan, value) + 0.0
        return hash((value.shape, value.dtype.str, plain.tobytes() if value.dtype.kind != "O" else str(plain)))
    if isinstance(value, Mapping):
        return hash(frozenset((key, _hashed(each)) for key, each in value.items()))
    if isinstance(value, list | tuple):
        return hash(tuple(_hashed(each) for each in value))
    if isinstance(value, float) and value != value:
        return hash("nan")
    return hash(value)
