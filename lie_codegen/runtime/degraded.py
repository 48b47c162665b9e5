"""What runs slower than it could, and why: said once a process, noted for a day where it will not mend itself, listed by `lie-codegen cache`.

    <cache>/python/requests/<digest>.json    why the extension type could not be compiled, and when

Only a compiler that works and refuses the text leaves a note. One that was killed, late or out of disk leaves none: the next process tries
again, and is fast if it succeeds.
"""

from __future__ import annotations

import time
from functools import cache as memoised
from pathlib import Path
from typing import Any

from lie_codegen.door import warn_caller
from lie_codegen.errors import DegradedWarning
from lie_codegen.runtime import cache

_DAY = 86_400.0
CALLS = "calls go through ctypes (the same results, a hundred times slower to call)"
BATCHES = "batches run one sample at a time (the same results, two to eight times slower)"


@memoised
def warn_degraded(what: str, why: str) -> None:
    """Say once a process that something is slower than it could be."""
    first = why.strip().splitlines()[0] if why.strip() else "no reason given"
    warn_caller(f"{what}: {first}", DegradedWarning)


def refused_before(folder: Path, key: str) -> str | None:
    """Why that was refused within a day; None if it is to be tried."""
    return reason_of(cache.find_note(folder, key))


def note_refused(folder: Path, key: str, reason: str) -> None:
    """Remember for a day that a working compiler refuses a text.

    Raises:
        OSError: the folder cannot be written.
    """
    cache.store_note(folder, key, {"entry": None, "reason": reason, "time": time.time()})


def forget_refused(folder: Path, key: str) -> None:
    """What was refused has been compiled."""
    cache.unlink(folder / "requests" / f"{key}.json")


def reason_of(note: Any) -> str | None:
    """The reason in a note that is not a day old; None for any other."""
    if not isinstance(note, dict) or note.get("entry") is not None:
        return None
    when, reason = note.get("time"), note.get("reason")
    is_recent = isinstance(when, int | float) and 0 <= time.time() - when < _DAY
    return str(reason) if is_recent else None
