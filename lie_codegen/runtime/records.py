"""Records in the cache: plain data of what something is, known by the text that it was made from.

A record belongs to the source of this package and the versions of what it computes with, as a compiled library does.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Hashable, Mapping
from fractions import Fraction
from typing import Any, TypeVar

import numpy as np

from lie_codegen.errors import InputError
from lie_codegen.kernel.saved import record_of, value_of
from lie_codegen.recent import Recent
from lie_codegen.runtime import cache
from lie_codegen.runtime.cache_folder import cache_folder, why_unusable
from lie_codegen.runtime.digests import digest, package_digest, versions
from lie_codegen.values import contents

T = TypeVar("T")


#: What was found or made in this process, by its source, so that no file is read twice; the oldest goes first.
_known: Recent[Any] = Recent(256)


def find_record(kind: str, source: Any) -> Any:
    """The record that was stored for this source (plain data, to which nobody writes); None if there is none."""
    asked = _asked("record", kind, source)
    found = _known.get(asked)
    if found is None:
        folder = cache_folder()
        found = None if why_unusable(folder) is not None else cache.find_note(folder, _key(kind, source))
        _keep(asked, found)
    return found


def store_record(kind: str, source: Any, record: Any) -> None:
    """Store plain data, or nothing where the cache cannot be written."""
    folder = cache_folder()
    if why_unusable(folder) is None:
        with contextlib.suppress(OSError):
            cache.store_note(folder, _key(kind, source), record)


def recalled(kind: str, source: Any, of: type[T], make: Callable[[], T]) -> T:
    """The value that `make` makes: from its record, or made and recorded.

    Args:
        kind, source: plain data that determines it.
        of: its class, a dataclass of plain data. Who asks again gets the same one: it is a value, to which nobody writes.
    """
    asked = _asked("value", kind, source)
    known = _known.get(asked)
    if isinstance(known, of):
        return known
    with contextlib.suppress(InputError):
        found = value_of(find_record(kind, source))
        if isinstance(found, of):
            _keep(asked, found)
            return found
    made = make()
    store_record(kind, source, record_of(made))
    return made


def _asked(form: str, kind: str, source: Any) -> Hashable:
    """A key; None where the source has none."""
    with contextlib.suppress(TypeError):
        return form, kind, contents(source)
    return None


def _keep(asked: Hashable, found: Any) -> None:
    if asked is not None and found is not None:
        _known.keep(asked, found)


def source_of(*given: Any) -> Any:
    """Nested sequences and mappings of texts and numbers as the source of a record; None where they hold anything else.

    A float is another source than the decimal it prints as: inputs take it at its binary value.
    """
    found = [_plain(each) for each in given]
    return None if any(each is None for each in found) else found


def _plain(value: Any) -> Any:
    if value is None:
        return ["none"]
    if isinstance(value, bool | np.bool_):
        return None
    if isinstance(value, str):
        return ["text", value]
    if isinstance(value, float | np.floating):
        return ["float", float(value).hex()]
    if isinstance(value, int | Fraction | np.integer):
        return ["exact", str(value)]
    if isinstance(value, Mapping):
        inside = source_of(*(each for pair in value.items() for each in pair))
        return None if inside is None else ["mapping", *inside]
    return source_of(*value) if isinstance(value, list | tuple | np.ndarray) else None


def _key(kind: str, source: Any) -> str:
    return digest(["record", kind, source, package_digest(), versions()])
