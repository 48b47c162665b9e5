"""Looking after the cache: what is in it, clearing it, letting the least recently used go."""

from __future__ import annotations

import contextlib
import os
import time
from dataclasses import dataclass
from pathlib import Path

from lie_codegen.runtime.cache import DIGEST, remove_scratch, unlink
from lie_codegen.runtime.cache_folder import cache_folder, why_unusable

_DEFAULT_LIMIT = 1 << 30
_STALE_SECONDS = 3_600.0


@dataclass(frozen=True)
class CacheInfo:
    """What `lie-codegen cache` shows.

    Attributes:
        folder: where the cache is.
        problem: why it cannot be used, or None.
        entries, bytes: number of libraries, and their size.
        limit: bytes above which the least recently used go; LIE_CODEGEN_CACHE_LIMIT overrides.
    """

    folder: Path
    problem: str | None
    entries: int
    bytes: int
    limit: int


def cache_info() -> CacheInfo:
    """The state of the cache."""
    folder = cache_folder()
    problem = why_unusable(folder) if folder.exists() else None
    entries = _entries(folder)
    return CacheInfo(folder, problem, len(entries), sum(_size(entry) for entry in entries), limit())


def clear_cache() -> int:
    """Remove every library and request, and nothing else; return the number of libraries of kernels removed."""
    folder = cache_folder()
    _clear(folder / "python")
    with contextlib.suppress(OSError):
        (folder / "python").rmdir()
    return _clear(folder)


def _clear(folder: Path) -> int:
    entries = _entries(folder)
    for entry in entries:
        _remove_entry(entry)
    for pattern in ("requests/*.json", "locks/*.lock"):
        for file in folder.glob(pattern):
            if DIGEST.fullmatch(file.stem):
                unlink(file)
    _remove_stale(folder)
    for name in ("entries", "requests", "locks", "scratch"):
        with contextlib.suppress(OSError):
            (folder / name).rmdir()
    return len(entries)


def limit() -> int:
    """Size of the cache in bytes: LIE_CODEGEN_CACHE_LIMIT, else 1 GiB."""
    try:
        return max(0, int(os.environ.get("LIE_CODEGEN_CACHE_LIMIT", "")))
    except ValueError:
        return _DEFAULT_LIMIT


def evict(folder: Path, keep: str) -> None:
    """Remove what a killed build left, and the least recently used libraries above the limit."""
    _remove_stale(folder)
    entries = sorted(_entries(folder), key=_last_use)
    total = sum(_size(entry) for entry in entries)
    for entry in entries:
        if total <= limit():
            break
        if entry.name != keep:
            total -= _size(entry)
            _remove_entry(entry)


def _entries(folder: Path) -> list[Path]:
    return [path for path in folder.glob("entries/*") if DIGEST.fullmatch(path.name) and path.is_dir()]


def _remove_stale(folder: Path) -> None:
    """Remove what killed builds left; a young scratch folder may be a build that runs now."""
    for left in folder.glob("scratch/build-*"):
        with contextlib.suppress(OSError):
            if time.time() - left.stat().st_mtime > _STALE_SECONDS:
                remove_scratch(left)


def _last_use(entry: Path) -> float:
    try:
        return (entry / "entry.json").stat().st_mtime
    except OSError:
        return 0.0


def _size(entry: Path) -> int:
    total = 0
    for file in entry.glob("*"):
        with contextlib.suppress(OSError):
            total += file.stat().st_size
    return total


def _remove_entry(entry: Path) -> None:
    unlink(entry / "entry.json")  # first: without it the rest is never loaded
    for file in (*entry.glob("*-????????????????????????????????.*"), *entry.glob(".new-*"), entry / "sources.json"):
        unlink(file)
    with contextlib.suppress(OSError):
        entry.rmdir()
