"""What must not grow: memory over many calls."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import lie_codegen as lc

_PAGE = 4  # kB
_ALLOWED = 512  # kB: what the allocator may keep


def _resident() -> int:
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * _PAGE


def calls(count: int) -> tuple[int, list[str]]:
    """(calls, finds): resident memory after so many calls of every kind is what it was after a hundredth of them."""
    library, x = lc.build("so3"), np.array([0.1, 0.2, 0.3])
    X, several = library.exp(x), np.ones((100, 3))
    kinds = {
        "a call": (lambda: library.exp(x), count),
        "a list": (lambda: library.exp([0.1, 0.2, 0.3]), count // 10),
        "two matrices": (lambda: library.compose(X, X), count // 10),
        "a logarithm": (lambda: library.log(X), count // 10),
        "a batch": (lambda: library.exp.batch(several), count // 100),
        "a refusal": (lambda: _refused(library), count // 100),
    }
    tried, found = 0, []
    for name, (call, times) in kinds.items():
        for _ in range(max(1000, times // 100)):
            call()
        before = _resident()
        for _ in range(times):
            call()
        tried += times
        if _resident() - before > _ALLOWED:
            found.append(f"{name}: {times} times took {_resident() - before} kB")
    return tried, found


def _refused(library: Any) -> None:
    try:
        library.exp("no")
    except lc.errors.InputError:
        return
    raise AssertionError("a text was taken for three numbers")
