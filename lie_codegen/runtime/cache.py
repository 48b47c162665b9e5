"""The cache of compiled libraries: written atomically, locked across processes, verified before every load.

    <cache>/entries/<digest>/entry.json      signatures, file name and SHA-256 of the library
    <cache>/entries/<digest>/<name>-<its own SHA-256>.so
    <cache>/requests/<digest>.json           a request (definition, options, versions) -> an entry
    <cache>/locks/<digest>.lock

The name of a library holds the digest of its content: a path that was loaded is never another library later. Every JSON file bears
a seal, the digest of what it says and of its place: what was damaged, swapped with another entry or written by another user is not there.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import os
import re
import shutil
import stat
import weakref
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lie_codegen.codegen.signature import Signature
from lie_codegen.door import warn_caller
from lie_codegen.errors import CacheWarning
from lie_codegen.runtime.compiler import compile_seconds
from lie_codegen.whole_files import private_file

#: The form of every key.
DIGEST = re.compile(r"[0-9a-f]{64}")
#: Characters before what a sealed file says.
_HEAD = len('{"seal": "", "data": ') + 64


@dataclass(frozen=True, eq=False)
class Entry:
    """A verified library on disk; while the record lives its process does not evict it."""

    namespace: str
    library: Path
    signatures: tuple[Signature, ...]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        _living.add(self)


_living: weakref.WeakSet[Entry] = weakref.WeakSet()


def in_use() -> set[str]:
    """Keys of the entries that this process may still read from."""
    return {entry.library.parent.name for entry in list(_living)}


def find_request(folder: Path, request: str) -> Entry | None:
    """The library that answered an equal request before, verified; None if there is none."""
    data = read_json(folder / "requests" / f"{request}.json")
    key = data.get("entry") if isinstance(data, dict) else None
    return find_entry(folder, key) if isinstance(key, str) and DIGEST.fullmatch(key) else None


def find_entry(folder: Path, key: str) -> Entry | None:
    """The library of that digest, verified byte for byte; None if it is missing or damaged."""
    home = folder / "entries" / key
    data = read_json(home / "entry.json")
    try:
        namespace, name, expected = str(data["namespace"]), str(data["file"]), str(data["sha256"])
        signatures = tuple(Signature.from_json(each) for each in data["signatures"])
        notes = tuple(str(note) for note in data["notes"])
        if "/" in name or "\\" in name or _file_digest(home / name) != expected:
            return None
    except (OSError, ValueError, TypeError, LookupError):
        return None
    with contextlib.suppress(OSError):
        os.utime(home / "entry.json")  # the time of last use, for eviction
    return Entry(namespace, home / name, signatures, notes)


def store_entry(
    folder: Path,
    key: str,
    built: Path,
    namespace: str,
    signatures: Sequence[Signature],
    notes: Sequence[str] = (),
) -> Entry:
    """Move a library just built (on the same disk) into the cache.

    Raises:
        OSError: the disk is full or the folder cannot be written; no half entry is left.
    """
    content = _file_digest(built)
    home = folder / "entries" / key
    for part in (home.parent, home):
        part.mkdir(mode=0o700, exist_ok=True)
    library = home / f"{namespace}-{content[:32]}{built.suffix}"
    os.replace(built, library)
    data = {
        "namespace": namespace,
        "file": library.name,
        "sha256": content,
        "signatures": [each.to_json() for each in signatures],
        "notes": list(notes),
    }
    write_json(home / "entry.json", data)
    return Entry(namespace, library, tuple(signatures), tuple(notes))


def store_request(folder: Path, request: str, key: str) -> None:
    """Remember which library answers a request.

    Raises:
        OSError: as `store_entry`.
    """
    write_json(folder / "requests" / f"{request}.json", {"entry": key})


def find_note(folder: Path, key: str) -> Any:
    """What was noted under that digest; None if nothing was."""
    return read_json(folder / "requests" / f"{key}.json")


def store_note(folder: Path, key: str, data: Any) -> None:
    """Note plain data under a digest.

    Raises:
        OSError: as `store_entry`.
    """
    write_json(folder / "requests" / f"{key}.json", data)


@contextlib.contextmanager
def lock(folder: Path, key: str) -> Iterator[None]:
    """Hold the entry against other processes; a process that dies lets go of it. One that hangs is not waited for for ever.

    Raises:
        OSError: the folder cannot be written.
    """
    from filelock import FileLock, Timeout

    locks = folder / "locks"
    locks.mkdir(mode=0o700, exist_ok=True)
    held = FileLock(locks / f"{key}.lock")
    patience = compile_seconds()
    try:
        held.acquire(timeout=patience)
    except Timeout:
        _warn_held(str(folder), patience)
    except NotImplementedError:
        pass  # a file system without locks: entries are written atomically, so that building twice costs time alone
    try:
        yield
    finally:
        held.release()


@functools.cache
def _warn_held(folder: str, patience: float) -> None:
    warn_caller(
        f"another process has held a lock of {folder} for {patience:g} s (LIE_CODEGEN_COMPILE_SECONDS); building beside it",
        CacheWarning,
    )


@contextlib.contextmanager
def scratch(folder: Path) -> Iterator[Path]:
    """A private folder to build in, on the disk of the cache; gone afterwards.

    Raises:
        OSError: the folder cannot be written.
    """
    parent = folder / "scratch"
    parent.mkdir(mode=0o700, exist_ok=True)
    import tempfile

    home = Path(tempfile.mkdtemp(prefix="build-", dir=parent))
    try:
        yield home
    finally:
        remove_scratch(home)


def write_json(path: Path, data: Any) -> None:
    """Write under a seal, atomically: a reader sees the old file or the new one.

    Raises:
        OSError: it cannot be written; the old file is untouched.
    """
    path.parent.mkdir(mode=0o700, exist_ok=True)
    text = json.dumps(data)
    with private_file(path) as fresh:
        fresh.write_text(f"{_head(path, text)}{text}}}", encoding="utf-8")


def read_json(path: Path) -> Any:
    """What `write_json` wrote at that place; None where it cannot be read, is damaged, was moved there, or is another user's."""
    try:
        status = path.lstat()  # a FIFO would never answer, and what another user left may be anything
        if not stat.S_ISREG(status.st_mode) or (hasattr(os, "getuid") and status.st_uid != os.getuid()):
            return None
        content = path.read_text(encoding="utf-8")
        text = content[_HEAD : len(content) - 1]
        return json.loads(text) if content == f"{_head(path, text)}{text}}}" else None
    except (OSError, ValueError):
        return None


def _head(path: Path, text: str) -> str:
    """The seal of a text at a place, as the file begins: the file as a whole is JSON too."""
    place = f"{path.parent.name}/{path.name}\0{text}"
    return f'{{"seal": "{hashlib.sha256(place.encode("utf-8", "surrogatepass")).hexdigest()}", "data": '


def _file_digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def remove_scratch(home: Path) -> None:
    """Remove a folder of `scratch`, whatever a compiler left in it."""
    shutil.rmtree(home, ignore_errors=True)


def unlink(file: Path) -> None:
    """Remove a file if it is there and may be removed."""
    with contextlib.suppress(OSError):
        file.unlink()
