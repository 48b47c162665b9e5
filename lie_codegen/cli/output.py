"""What the command line prints: text or one JSON object on stdout, progress and errors on stderr."""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from enum import Enum
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """Numbers, texts, lists and dicts only."""
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, Enum):
        return value.name.lower()
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, complex):
        return {"re": value.real, "im": value.imag}
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None  # JSON has neither NaN nor infinity
    if value is None or isinstance(value, str | int | float | bool):
        return value
    return str(value)


def emit(text: str, data: Mapping[str, Any], as_json: bool) -> None:
    """Prints the text, or the data as one JSON object."""
    print(json.dumps(plain(data), indent=2) if as_json else text)  # noqa: T201


def complain(message: str) -> None:
    """One line on stderr."""
    print(message, file=sys.stderr)  # noqa: T201


@contextmanager
def progress(what: str) -> Iterator[Any]:
    """A callable that reports a stage on stderr, with the time since the start; the first line after one second."""
    started = time.perf_counter()

    def report(line: str) -> None:
        complain(f"[{time.perf_counter() - started:6.1f} s] {what}: {line}")

    yield report
