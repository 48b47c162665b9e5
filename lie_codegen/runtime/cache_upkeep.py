"""Looking after the cache: what is in it, clearing it, letting the least recently used go."""

from __future__ import annotations

import contextlib
import os
import time
from dataclasses import dataclass
from pathlib import Path

from lie_codegen.runtime.cache import DIGEST, in_use, read_json, remove_scratch, unlink
from lie_codegen.runtime.cache_folder import cache_folder, why_unusable
from lie_codegen.runtime.compiler import find_compilers
from lie_codegen.runtime.degraded import CALLS, reason_of
from lie_codegen.runtime.extension import has_headers, is_wanted
from lie_codegen.whole_files import BEGUN

_DEFAULT_LIMIT = 1 << 30
_STALE_SECONDS = 3_600.0
_DAY = 86_400.0
_AGED_DAYS = 30


@dataclass(frozen=True)
class CacheInfo:
    """What `lie-codegen cache` shows.

    Attributes:
        folder: where the cache is.
        problem: why it cannot be used, or None.
        degraded: what is slower than it could be, and why.
        entries, bytes: number of libraries, and their size.
        limit: bytes above which the least recently used go; LIE_CODEGEN_CACHE_LIMIT overrides.
    """

    folder: Path
    problem: str | None
    degraded: tuple[str, ...]
    entries: int
    bytes: int
    limit: int


def cache_info() -> CacheInfo:
    """The state of the cache."""
    folder = cache_folder()
    problem = why_unusable(folder) if folder.exists() else None
    entries = _entries(folder)
    return CacheInfo(
        folder, problem, why_degraded(folder), len(entries), sum(_size(entry) for entry in entries), limit()
    )


def why_degraded(folder: Path) -> tuple[str, ...]:
    """What is degraded for users of a cache folder: a line each."""
    if not find_compilers():
        return ("kernels are interpreted: no C compiler is found",)
    lines = []
    if not is_wanted():
        lines.append(f"{CALLS}: LIE_CODEGEN_CALL asks for it")
    elif not has_headers():
        lines.append(f"{CALLS}: there is no Python.h (the package python3-dev or python3-devel brings it)")
    for note in sorted((folder / "python").glob("requests/*.json")):
        reason = reason_of(read_json(note))
        if reason is not None:
            lines.append(f"{CALLS}: {' '.join(reason.split())[:500]}")
    return tuple(lines)


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
    unlink(folder / "requests" / ".looked-after")
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


def evict(folder: Path) -> None:
    """Remove what a killed build left, and the least recently used libraries above the limit, but none that this process uses.

    Once a day requests and locks go that nobody has used for a month.
    """
    _remove_stale(folder)
    _remove_aged(folder)
    entries, kept = sorted(_entries(folder), key=_last_use), in_use()
    total = sum(_size(entry) for entry in entries)
    for entry in entries:
        if total <= limit():
            break
        if entry.name not in kept:
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


def _remove_aged(folder: Path) -> None:
    """Requests whose library is gone, and requests and locks that are old; at most once a day, by the time of a stamp."""
    stamp, now = folder / "requests" / ".looked-after", time.time()
    with contextlib.suppress(OSError):
        if now - stamp.stat().st_mtime < _DAY:
            return
    with contextlib.suppress(OSError):
        stamp.parent.mkdir(mode=0o700, exist_ok=True)
        stamp.touch(mode=0o600)
    for file in (*folder.glob("requests/*.json"), *folder.glob("locks/*.lock")):
        with contextlib.suppress(OSError):
            data = read_json(file) if file.suffix == ".json" else None
            key = data.get("entry") if isinstance(data, dict) else None
            orphan = isinstance(key, str) and not (folder / "entries" / key).exists()
            # A lock is touched whenever it is taken, and held for minutes: one of last month is nobody's.
            if DIGEST.fullmatch(file.stem) and (orphan or now - file.stat().st_mtime > _AGED_DAYS * _DAY):
                unlink(file)


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
    for file in (*entry.glob("*-????????????????????????????????.*"), *entry.glob(f"{BEGUN}*"), entry / "sources.json"):
        unlink(file)
    with contextlib.suppress(OSError):
        entry.rmdir()
