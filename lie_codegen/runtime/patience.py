"""A line on stderr while something takes over a second, in a terminal or a notebook; nothing elsewhere."""

from __future__ import annotations

import functools
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

_FIRST, _EVERY = 1.0, 1.0
_busy = threading.Lock()


def _somebody_watches() -> bool:
    return sys.stderr is not None and (sys.stderr.isatty() or "ipykernel" in sys.modules)


@contextmanager
def progress(what: str) -> Iterator[None]:
    """What runs inside may take long: after a second stderr says for how long it has run, once a second.

    The line is written by a thread beside the work, is overwritten each time and taken away at the end; of pieces of work inside
    each other the outermost speaks.
    """
    if not _somebody_watches() or not _busy.acquire(blocking=False):
        yield
        return
    done = threading.Event()
    speaker = threading.Thread(target=_speak, args=(what, done), daemon=True)
    speaker.start()
    try:
        yield
    finally:
        done.set()
        speaker.join()
        _busy.release()


def shows_progress(function: Callable[P, R]) -> Callable[P, R]:
    """Decorates a function that may take long: `progress` under its name."""

    @functools.wraps(function)
    def call(*args: P.args, **named: P.kwargs) -> R:
        if not _somebody_watches():
            return function(*args, **named)
        with progress(function.__name__):
            return function(*args, **named)

    return call


def _speak(what: str, done: threading.Event) -> None:
    started = time.perf_counter()
    width, wait = 0, _FIRST
    while not done.wait(wait):
        line = f"{what}: {time.perf_counter() - started:.0f} s"
        width, wait = len(line), _EVERY
        sys.stderr.write(f"\r{line}")
        sys.stderr.flush()
    if width:
        sys.stderr.write("\r" + " " * width + "\r")
        sys.stderr.flush()
