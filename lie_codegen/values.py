"""Results as values: dataclasses that hold arrays, compared by what they hold and printed short."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import Field, dataclass, fields, is_dataclass
from enum import Enum
from typing import Any, ClassVar, TypeVar

import numpy as np

from lie_codegen.door import guard_methods

#: Lines and characters of a printed value.
_LINES, _WIDTH = 10, 110
_FEW = 4
#: Classes of values that are keys by themselves, and bytes of the largest array that is part of one.
_ATOMS, _LARGEST = frozenset({bool, int, str}), 2**15
_ENTRIES = 6


Record = TypeVar("Record")


class Value:
    """Base of frozen dataclasses (declared with eq=False and repr=False) whose fields are plain data, arrays among them.

    Two values are equal where they are of one class and all compared fields are: arrays by shape, type and entry, NaN equal to
    itself. Equal values have equal hashes. Pickles hold the fields alone: what is cached beside them is computed again.
    """

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    def __init_subclass__(cls, **named: Any) -> None:
        super().__init_subclass__(**named)
        guard_methods(cls)

    def __getstate__(self) -> dict[str, Any]:
        kept = (*(each.name for each in fields(self)), "definition")  # of a factory's record, beside its fields
        return {name: getattr(self, name) for name in kept if name in vars(self)}

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
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
        lines = [f"    {part}" for part in shown]
        if len(lines) > _LINES - 2:
            lines = [*lines[: _LINES - 3], f"    and {len(lines) - _LINES + 3} more"]
        return "\n".join([f"{type(self).__name__}(", *lines, ")"])


def settle(record: Any, **kept: Any) -> None:
    """Fields of a frozen record in the one form in which they are kept: for its own `__post_init__`, and for what stands beside the
    fields of a new one, as its definition.

    The one place that goes round what frozen refuses; a record that was handed out never changes.
    """
    for name, value in kept.items():
        object.__setattr__(record, name, value)


def made_of(kind: type[Record], kept: dict[str, Any]) -> Record:
    """A frozen record of all its fields, each in the form in which it is kept, and of what stands beside them: what its constructor makes, in a
    quarter of the time, which counts where a whole call takes some ten microseconds. The record takes the dict as it is."""
    record = object.__new__(kind)
    object.__setattr__(record, "__dict__", kept)
    return record


@dataclass(eq=False)
class Later:
    """A field's value that is made when it is first asked for; see `Deferred`. Nobody is handed one: it need not be frozen."""

    make: Callable[[], Any]


class Deferred:
    """A field of a Value that may be given as a `Later`: whoever asks for it gets what that makes, made once.

    A data descriptor in the place of the field's default, which a dataclass asks for as the class's own attribute.
    """

    def __init__(self, *default: Any) -> None:
        self._default = default

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, owner: Any, kind: type | None = None) -> Any:
        if owner is None:
            if not self._default:
                raise AttributeError(f"the field {self._name} has no default")
            return self._default[0]
        value = vars(owner)[self._name]
        if isinstance(value, Later):
            value = vars(owner)[self._name] = value.make()
        return value

    def __set__(self, owner: Any, value: Any) -> None:
        vars(owner)[self._name] = value


def same(a: Any, b: Any) -> bool:
    """Whether two plain values are equal, as one bool: arrays entry by entry, dataclasses field by field, NaN equal to itself."""
    if a is b:
        return True
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        x, y = np.asarray(a), np.asarray(b)
        inexact = x.dtype.kind in "fc" and y.dtype.kind in "fc"
        return x.dtype == y.dtype and bool(np.array_equal(x, y, equal_nan=inexact))
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(same(value, b[key]) for key, value in a.items())
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return type(a) is type(b) and len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    if getattr(a, "definition", None) is not None and type(a) is type(b):
        return bool(a == b)  # a kernel is what its definition says; its functions are made again by whoever loads it
    if is_dataclass(a) and type(a) is type(b):
        return all(same(getattr(a, name), getattr(b, name)) for name in _compared(a))
    return bool(a == b) or (_is_nan(a) and _is_nan(b))


def contents(value: Any) -> Hashable:
    """What plain data and frozen records of it hold, as a key by which they are known again: arrays by their bytes, so that one which
    was changed in place is another.

    Raises:
        TypeError: it is a function, or what may change unseen, or holds such, or an array of over 32 kB.
    """
    kind = type(value)
    if value is None or kind in _ATOMS:
        return kind, value
    if kind is float:
        return kind, value or repr(value)  # 0.0 and -0.0 are equal
    if kind is complex:
        return kind, repr(value)
    if kind is np.ndarray and value.dtype.kind in "fciub" and value.nbytes <= _LARGEST:
        return value.shape, value.dtype, value.tobytes()
    if kind in (list, tuple):
        return kind, *map(contents, value)
    if kind is dict:
        return kind, *map(contents, value), *map(contents, value.values())
    definition = getattr(value, "definition", None)
    if definition is not None:  # it is what that says
        return kind, definition
    if is_dataclass(kind) and kind.__dataclass_params__.frozen:  # type: ignore[attr-defined]
        return kind, *(contents(getattr(value, each.name)) for each in fields(value))
    raise TypeError(f"{kind.__name__} is not known by what it holds")


def brief(value: Any) -> str:
    """A value in one short line: arrays by type and shape, unless they hold a few numbers."""
    if isinstance(value, np.ndarray):
        if value.ndim == 1 and value.size <= _FEW and value.dtype.kind in "iuf":
            return f"[{', '.join(f'{entry:.6g}' for entry in value)}]"
        return f"<{value.dtype} {' x '.join(map(str, value.shape)) or 'scalar'}>"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, Mapping):
        return f"{{{_listed([f'{key}: {_inner(each)}' for key, each in value.items()])}}}"
    if isinstance(value, list | tuple):
        inside = _listed([_inner(each) for each in value])
        return f"[{inside}]" if isinstance(value, list) else f"({inside})"
    return _inner(value)


def _inner(value: Any) -> str:
    """A value within another one."""
    if isinstance(value, np.ndarray | float | Enum):
        return brief(value)
    if isinstance(value, Mapping | list | tuple):
        return f"<{type(value).__name__} of {len(value)}>"
    name = getattr(value, "name", None)
    if isinstance(name, str) and hasattr(value, "labels"):
        return name  # a group
    if is_dataclass(value):
        return f"<{type(value).__name__}{f' {name}' if isinstance(name, str) else ''}>"
    return " ".join(reprlib.repr(value).split())


def _listed(entries: Sequence[str]) -> str:
    shown = ", ".join(entries[:_ENTRIES])
    return shown if len(entries) <= _ENTRIES else f"{shown}, and {len(entries) - _ENTRIES} more"


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
        return hash(tuple(map(_hashed, value)))
    if getattr(value, "definition", None) is not None:
        return hash(value)  # as `same` compares it
    if is_dataclass(value) and not isinstance(value, Value | type):
        return hash((type(value).__name__, *(_hashed(getattr(value, name)) for name in _compared(value))))
    return hash("nan") if _is_nan(value) else hash(value)


def _is_nan(value: Any) -> bool:
    return isinstance(value, float | complex) and bool(value != value)
