"""A range of samples shared out over threads; compiled code lets go of the interpreter lock."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from lie_codegen.errors import InputError

Part = TypeVar("Part")

#: Samples below which a thread costs more than it does.
LEAST = 1024


def in_parts(work: Callable[[int, int], None], count: int, threads: Any) -> None:
    """work(start, stop) for parts of range(count), one a thread.

    Raises:
        InputError: `threads` is no positive integer.
    """
    share_out(work, count, threads, LEAST)


def share_out(work: Callable[[int, int], Part], count: int, threads: Any, least: int) -> list[Part]:
    """[work(start, stop), ...] for parts of range(count), in order, one a thread; no part is smaller than `least`.

    Raises:
        InputError: `threads` is no positive integer.
    """
    if isinstance(threads, bool) or not isinstance(threads, int) or threads < 1:
        raise InputError(f"threads is an integer of at least 1, given {threads!r}")
    parts = min(threads, count // least)
    if parts < 2:
        return [work(0, count)]
    from concurrent.futures import ThreadPoolExecutor

    size = -(-count // parts // 8) * 8
    starts = range(0, count, size)
    with ThreadPoolExecutor(len(starts)) as pool:
        return [done.result() for done in [pool.submit(work, start, min(start + size, count)) for start in starts]]
