"""What a compiled library depends on, as digests."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import sys
import time
from functools import cache
from pathlib import Path
from typing import Any

from lie_codegen.runtime import cache as cache_entries
from lie_codegen.runtime.cache_folder import cache_folder, why_unusable

#: Distributions whose version may change the C text.
_DISTRIBUTIONS = ("casadi", "sympy", "jinja2")
#: Longer than any file system rounds its times [ns].
_TICK = 5 * 10**9
_METADATA_FOLDER = re.compile(r"([A-Za-z0-9_.]+)-([^-]+)\.(?:dist|egg)-info")


def digest(data: Any) -> str:
    """SHA-256 of plain data, by its canonical JSON."""
    return hashlib.sha256(json.dumps(data, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


@cache
def versions() -> dict[str, str]:
    """Version of each distribution, from the name of its metadata folder: nothing is imported."""
    found = dict.fromkeys(_DISTRIBUTIONS, "")
    for folder in reversed(sys.path):
        try:
            names = os.listdir(folder or ".")
        except OSError:
            continue
        for name in names:
            match = _METADATA_FOLDER.fullmatch(name)
            if match and match[1].lower() in found:
                found[match[1].lower()] = match[2]
    return found


@cache
def package_digest() -> str:
    """Digest of this package's own source: a changed formula is a changed library.

    Reading 700 files takes three times as long as asking for their sizes and times, by which the cache knows the digest again.
    """
    folder = Path(__file__).resolve().parent.parent
    sizes, newest = _sizes_and_times(str(folder))
    home = cache_folder()
    if why_unusable(home) is not None:
        return _tree_digest(folder, ".py")
    key = digest(["source of this package", str(folder), sizes])
    known = cache_entries.find_note(home, key)
    if isinstance(known, str):
        return known
    found = _tree_digest(folder, ".py")
    # A file saved again within one tick of the clock keeps its time: what was saved just now is not noted yet.
    if time.time_ns() - newest > _TICK:
        with contextlib.suppress(OSError):
            cache_entries.store_note(home, key, found)
    return found


@cache
def templates_digest() -> str:
    """Digest of the templates, and of the plain C beside them."""
    from lie_codegen.codegen.templates import template_folder

    return _tree_digest(template_folder(), (".jinja", ".c", ".h"))


@cache
def cpu_identity() -> str:
    """Model and features of the processor, for which -march=native compiles."""
    wanted = ("model name", "flags", "Features", "CPU implementer", "CPU part", "isa", "cpu")
    lines: list[str] = []
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as file:
            for line in file:
                key = line.split(":")[0].strip()
                if not key and lines:
                    break
                if key in wanted:
                    lines.append(line.strip())
    except OSError:
        lines = []
    machine = os.uname().machine if hasattr(os, "uname") else os.environ.get("PROCESSOR_ARCHITECTURE", "")
    return "\n".join([sys.platform, machine, *lines])


def _sizes_and_times(root: str) -> tuple[list[list[Any]], int]:
    """[path, size, times of its content and of its entry] of the Python files below a folder, in order; and the newest time."""
    found: list[list[Any]] = []
    folders = [root]
    while folders:
        with os.scandir(folders.pop()) as entries:
            for entry in entries:
                if entry.name.endswith(".py"):
                    known = entry.stat()
                    found.append([entry.path[len(root) :], known.st_size, known.st_mtime_ns, known.st_ctime_ns])
                elif entry.is_dir(follow_symlinks=False):
                    folders.append(entry.path)
    return sorted(found), max(max(each[2:]) for each in found)


def _tree_digest(folder: Path, suffix: str | tuple[str, ...]) -> str:
    """Of the names and contents below a folder; by os and not pathlib, which would take three times as long."""
    root = str(folder)
    paths = sorted(
        os.path.join(parent, name) for parent, _, names in os.walk(root) for name in names if name.endswith(suffix)
    )
    summary = hashlib.sha256()
    for path in paths:
        with open(path, "rb", buffering=0) as file:
            content = file.read()
        summary.update(f"{path[len(root) :]}\0{len(content)}\0".encode())
        summary.update(content)
    return summary.hexdigest()
