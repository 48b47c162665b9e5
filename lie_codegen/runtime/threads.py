"""A range of samples shared out over threads; compiled code lets go of the interpreter lock."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lie_codegen.errors import InputError

#: Samples below which a thread costs more than it does.
LEAST = 1024


def in_parts(work: Callable[[int, int], None], count: int, threads: Any) -> None:
    """work(start, stop) for parts of range(count), one a thread.

    Raises:
        InputError: `threads` is no positive integer.
    """
    if isinstance(threads, bool) or not isinstance(threads, int) or threads < 1:
        raise InputError(f"threads is an integer of at least 1, given {threads!r}")
    parts = min(threads, count // LEAST)
    if parts < 2:
        work(0, count)
        return
    from concurrent.futures import ThreadPoolExecutor

    size = -(-count // parts // 8) * 8
    starts = range(0, count, size)
    with ThreadPoolExecutor(len(starts)) as pool:
        for done in [pool.submit(work, start, min(start + size, count)) for start in starts]:
            done.result()
