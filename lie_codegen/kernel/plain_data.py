"""Plain data that says what a thing is, and the thing made again from it.

A `Definition` is {"kind": "module:function", "parameters": {...}}: `made_from` calls that factory with those arguments.
`lie_codegen.kernel.definition` writes them, `lie_codegen.kernel.records` those of records that no factory made.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any, NoReturn, TypeVar, cast

from lie_codegen.errors import InputError

Factory = TypeVar("Factory", bound=Callable[..., Any])

#: Made once: an encoder a text would be a third of the time that a text takes.
_CANONICAL = json.JSONEncoder(sort_keys=True, separators=(",", ":"))


class NoDefinitionError(TypeError):
    """A value that is no plain data and has no definition, as a function written by the user."""


class Definition(dict[str, Any]):
    """A mapping of plain data that cannot be changed, and therefore has a hash."""

    def __hash__(self) -> int:  # type: ignore[override]
        return hash(self.text)

    @functools.cached_property
    def text(self) -> str:
        """Canonical JSON: equal definitions have equal texts."""
        return _CANONICAL.encode(self)

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError("a definition cannot be changed; make another thing")

    __setitem__ = __delitem__ = update = setdefault = pop = popitem = clear = __ior__ = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return Definition, (dict(self),)

    def __copy__(self) -> Definition:
        return self

    def __deepcopy__(self, _: Any) -> Definition:
        return self


def made_from(definition: Any) -> Any:
    """What a definition defines; plain data stays what it is.

    Raises:
        InputError: the kind is not that of a factory.
    """
    if isinstance(definition, list | tuple):
        return tuple(made_from(each) for each in definition)
    if not isinstance(definition, Mapping):
        return definition
    if not {"kind", "parameters"} <= definition.keys() <= {"kind", "parameters", "units", "member"}:
        return {key: made_from(each) for key, each in definition.items()}
    factory, arguments = _factory(definition["kind"]), definition["parameters"]
    if not getattr(factory, "__reads_plain_data__", False):
        arguments = {key: made_from(each) for key, each in arguments.items()}
    made = factory(**arguments)
    if "member" not in definition:
        return made
    return next(kernel for kernel in made if kernel.name == definition["member"])


def _factory(kind: str) -> Callable[..., Any]:
    module, _, name = str(kind).partition(":")
    try:
        function = getattr(import_module(module), name)
    except (ImportError, AttributeError, ValueError):
        raise InputError(f"nothing makes {kind!r}: was it moved or is its module not installed?") from None
    if not getattr(function, "__makes_defined__", False):
        raise InputError(f"{kind!r} is no factory of kernels or records (@kernel_factory)")
    return cast(Callable[..., Any], function)


def makes_records(function: Factory) -> Factory:
    """Decorates a function that `made_from` may call, for records that say their definition themselves."""
    function.__makes_defined__ = True  # type: ignore[attr-defined]
    return function
