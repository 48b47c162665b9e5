"""A range of samples shared out over threads, in pieces: compiled code lets go of the interpreter lock, and between two pieces
Python looks whether somebody pressed Ctrl-C."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

from lie_codegen.door import on_behalf
from lie_codegen.errors import InputError
from lie_codegen.identifiers import shown

Part = TypeVar("Part")

#: Samples below which a thread costs more than it does.
LEAST = 1024
#: Evaluations of a kernel in one call of compiled code: a twentieth of a second for most, much more than what Python costs in between.
CALLS = 2**19
_here = threading.local()


def in_parts(work: Callable[[int, int], None], count: int, threads: Any, weight: int = 1) -> None:
    """work(start, stop) for parts of range(count), one a thread, each in pieces.

    Args:
        work: does some.
        count: of samples.
        threads: over which they are shared out.
        weight: evaluations a sample.

    Raises:
        InputError: `threads` is no positive integer.
    """
    share_out(work, count, threads, LEAST, weight)


def check_threads(threads: Any) -> None:
    """Refuse what is no number of threads.

    Raises:
        InputError: `threads` is no positive integer.
    """
    if isinstance(threads, bool) or not isinstance(threads, int) or threads < 1:
        raise InputError(f"threads is an integer of at least 1, given {shown(threads)}")


def share_out(work: Callable[[int, int], Part], count: int, threads: Any, least: int, weight: int = 0) -> list[Part]:
    """[work(start, stop), ...] for parts of range(count), in order, one a thread; no part is smaller than `least`.

    With a weight, of evaluations a sample, the parts are cut into pieces of `CALLS` evaluations.

    Raises:
        InputError: `threads` is no positive integer.
    """
    check_threads(threads)
    piece = max(8, CALLS // weight // 8 * 8) if weight > 0 else max(1, count)
    parts = min(threads, count // least)
    if parts < 2:
        return [work(first, last) for first, last in _pieces(0, count, piece)]
    from concurrent.futures import ThreadPoolExecutor

    size = -(-count // parts // 8) * 8
    over = threading.Event()

    def share(start: int) -> list[Part]:
        _here.over = over
        done = []
        for first, last in _pieces(start, min(start + size, count), piece):
            if stopped():
                break
            done.append(work(first, last))
        return done

    starts, share_on_behalf = range(0, count, size), on_behalf(share)
    with ThreadPoolExecutor(len(starts)) as pool:
        waiting = [pool.submit(share_on_behalf, start) for start in starts]
        try:
            return [part for done in waiting for part in done.result()]
        finally:  # Ctrl-C comes to the thread that waits here: the others stop behind the piece that they are at
            over.set()


def stopped() -> bool:
    """Whether the work that this thread has a share of was given up; long shares look between their pieces."""
    over: threading.Event | None = getattr(_here, "over", None)
    return over is not None and over.is_set()


def _pieces(start: int, stop: int, size: int) -> Iterator[tuple[int, int]]:
    if start == stop:
        yield start, stop
    for first in range(start, stop, size):
        yield first, min(first + size, stop)


def interruptible(work: Callable[[], Part]) -> Part:
    """work(), one long call of compiled code that has no pieces, in a thread of its own, so that the caller hears Ctrl-C.

    After Ctrl-C the call runs on to its end without anybody waiting for it, and what it finds is dropped.
    """
    if threading.current_thread() is not threading.main_thread():
        return work()
    found: list[Part] = []
    failed: list[BaseException] = []

    def run() -> None:
        try:
            found.append(work())
        except BaseException as error:
            failed.append(error)

    worker = threading.Thread(target=on_behalf(run), daemon=True)
    worker.start()
    worker.join()
    if failed:
        raise failed[0]
    return found[0]


def step_pieces(steps: int, every: int, most: int) -> Iterator[tuple[int, int, int]]:
    """(first, count, every) of pieces of a loop of which each `every`-th state is kept: whole intervals, or parts of one.

    A piece that is part of an interval keeps its last state alone; it is wanted where first + count is a multiple of `every`.
    """
    if every <= most:
        size = most // every * every
        for first in range(0, steps, size):
            yield first, min(size, steps - first), every
        return
    for begin in range(0, steps, every):
        for first in range(begin, begin + every, most):
            count = min(most, begin + every - first)
            yield first, count, count
