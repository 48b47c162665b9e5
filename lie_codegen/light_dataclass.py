"""Dataclasses without the compiler: `dataclass` as in dataclasses, for what a fresh process loads before its first result.

`dataclasses.dataclass` writes the text of up to six methods of a class and compiles each, half a millisecond to one of processor time; a process
that makes one call loads sixty classes. Here the methods are closures over the names of the fields. They do the same, and these are
dataclasses to whoever asks: fields, replace, signatures, patterns, pickles.
"""

from __future__ import annotations

import dataclasses
import inspect
import reprlib
from collections.abc import Callable
from dataclasses import MISSING, FrozenInstanceError
from itertools import repeat
from operator import attrgetter
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass


def _light(kind: type | None = None, /, *, frozen: bool = False, eq: bool = True, repr: bool = True) -> Any:
    """As dataclasses.dataclass, of which the field specifications are; a class that inherits fields is made by that one."""
    if kind is None:
        return lambda kind: _light(kind, frozen=frozen, eq=eq, repr=repr)
    if any(map(dataclasses.is_dataclass, kind.__mro__[1:])):
        return dataclasses.dataclass(frozen=frozen, eq=eq, repr=repr)(kind)
    own = set(vars(kind))
    kind.__doc__ = kind.__doc__ or kind.__name__  # in place of a signature, which takes longer than all the rest
    dataclasses.dataclass(init=False, repr=False, eq=False)(kind)  # finds the fields, and compiles nothing
    methods = {"__init__": _init(kind)}
    if repr:
        methods["__repr__"] = _repr(kind)
    if eq:
        methods |= _comparison(kind, frozen)
    if frozen:
        kind.__setattr__, kind.__delattr__ = _refuse_to_set, _refuse_to_delete  # type: ignore[assignment, method-assign]
        kind.__dataclass_params__.frozen = True  # type: ignore[attr-defined]  # asked for where a dataclass inherits from this one
    for name, method in methods.items():
        if name not in own or (name == "__hash__" and vars(kind)[name] is None):  # None beside an __eq__ of its own
            if method is not None:
                method.__name__, method.__qualname__ = name, f"{kind.__qualname__}.{name}"
                method.__module__ = kind.__module__
            setattr(kind, name, method)
    return kind


def _init(kind: type) -> Any:
    """__init__(self, a, b=..., *, c): every field is set, in order, and __post_init__ is called."""
    fields = dataclasses.fields(kind)
    given = [each for each in fields if each.init]
    places = tuple(each.name for each in given if not each.kw_only)
    known = {each.name for each in given}
    defaults = {each.name: each.default for each in given if each.default is not MISSING}
    factories = [(each.name, each.default_factory) for each in fields if each.default_factory is not MISSING]
    names = tuple(each.name for each in fields if each.init or each.default_factory is not MISSING)
    wanted, count, all_by_place = set(names), len(places), places == names
    is_finished = hasattr(kind, "__post_init__")
    put = object.__setattr__

    def initialise(self: Any, /, *args: Any, **named: Any) -> None:
        if named or len(args) != count or not all_by_place:
            values = {**defaults, **dict(zip(places, args, strict=False)), **named}
            twice = named and args and not named.keys().isdisjoint(places[: len(args)])
            for name, make in factories:
                if name not in values:
                    values[name] = make()
            if twice or len(args) > count or values.keys() != wanted or not named.keys() <= known:
                inspect.signature(initialise).bind(self, *args, **named)  # raises, and says which
            args = tuple(values[name] for name in names)
        # A loop in C, as `put` returns None; after an update of vars(self) attributes would be read half as fast.
        any(map(put, repeat(self), names, args))
        if is_finished:
            self.__post_init__()

    initialise.__wrapped__ = _Described(kind)  # type: ignore[attr-defined]
    return initialise


class _Described:
    """Where inspect.signature looks for the parameters of such an __init__: put together when they are asked for."""

    def __init__(self, kind: type) -> None:
        self._kind = kind

    def __call__(self) -> None:
        """A function is what is described."""

    @property
    def __signature__(self) -> inspect.Signature:
        owner = inspect.Parameter("self", inspect.Parameter.POSITIONAL_OR_KEYWORD)
        fields = sorted(
            (each for each in dataclasses.fields(self._kind) if each.init), key=lambda each: bool(each.kw_only)
        )
        return inspect.Signature([owner, *map(_parameter, fields)], return_annotation=None)


def _parameter(field: dataclasses.Field[Any]) -> inspect.Parameter:
    kind = inspect.Parameter.KEYWORD_ONLY if field.kw_only else inspect.Parameter.POSITIONAL_OR_KEYWORD
    default = field.default
    if default is MISSING:
        default = inspect.Parameter.empty if field.default_factory is MISSING else field.default_factory
    return inspect.Parameter(field.name, kind, default=default, annotation=field.type)


def _repr(kind: type) -> Any:
    names = [each.name for each in dataclasses.fields(kind) if each.repr]

    @reprlib.recursive_repr()
    def text(self: Any) -> str:
        return f"{type(self).__qualname__}({', '.join(f'{name}={getattr(self, name)!r}' for name in names)})"

    return text


def _comparison(kind: type, frozen: bool) -> dict[str, Any]:
    """__eq__ and, of what never changes, __hash__: those of the tuple of the fields."""
    fields = dataclasses.fields(kind)
    compared = _values([each.name for each in fields if each.compare])
    hashed = _values([each.name for each in fields if (each.compare if each.hash is None else each.hash)])

    def equal(self: Any, other: object) -> Any:
        return compared(self) == compared(other) if type(other) is type(self) else NotImplemented

    def hash_value(self: Any) -> int:
        return hash(hashed(self))

    return {"__eq__": equal, "__hash__": hash_value if frozen else None}


def _values(names: list[str]) -> Callable[[Any], tuple[Any, ...]]:
    """The tuple of the attributes of these names."""
    if len(names) > 1:
        return attrgetter(*names)
    return lambda owner: tuple(getattr(owner, name) for name in names)


def _refuse_to_set(self: Any, name: str, value: Any) -> None:
    raise FrozenInstanceError(f"cannot assign to field {name!r}")


def _refuse_to_delete(self: Any, name: str) -> None:
    raise FrozenInstanceError(f"cannot delete field {name!r}")


if not TYPE_CHECKING:
    dataclass = _light
