"""Records in the cache: plain data of what something is, known by the text that it was made from.

A record belongs to the source of this package and the versions of what it computes with, as a compiled library does.
"""

from __future__ import annotations

import contextlib
from typing import Any

from lie_codegen.runtime import cache
from lie_codegen.runtime.cache_folder import cache_folder, why_unusable
from lie_codegen.runtime.digests import digest, package_digest, versions


def find_record(kind: str, source: Any) -> Any:
    """The record that was stored for this source (plain data); None if there is none."""
    folder = cache_folder()
    return None if why_unusable(folder) is not None else cache.find_note(folder, _key(kind, source))


def store_record(kind: str, source: Any, record: Any) -> None:
    """Store plain data, or nothing where the cache cannot be written."""
    folder = cache_folder()
    if why_unusable(folder) is None:
        with contextlib.suppress(OSError):
            cache.store_note(folder, _key(kind, source), record)


def _key(kind: str, source: Any) -> str:
    return digest(["record", kind, source, package_digest(), versions()])
