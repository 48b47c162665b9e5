"""Hostile values, and calls of every public name with one argument replaced by each of them.

A call may succeed, or raise an error of ours. Anything else is a find: another exception, or a call that outlives its alarm.
"""

from __future__ import annotations

import contextlib
import inspect
import random
import signal
import tempfile
import traceback
import warnings
from collections.abc import Callable, Iterator
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import sympy as sp

import lie_codegen as lc
from lie_codegen.errors import LieCodegenError
from tests.hunt.plausible import plausible_arguments

INF, NAN = float("inf"), float("nan")

#: Values that nobody means; made anew for each call, for an iterator is spent by one.
HOSTILE: dict[str, Callable[[], Any]] = {
    "None": lambda: None,
    "True": lambda: True,
    "a negative number": lambda: -1,
    "zero": lambda: 0,
    "a huge integer": lambda: 10**5000,
    "a large integer": lambda: 2**63,
    "NaN": lambda: NAN,
    "inf": lambda: INF,
    "1e300": lambda: 1e300,
    "1e-300": lambda: 1e-300,
    "a complex number": lambda: 1 + 2j,
    "a Decimal": lambda: Decimal("1e400"),
    "a Fraction": lambda: Fraction(1, 3),
    "the empty text": lambda: "",
    "a text": lambda: "no such thing",
    "11e400": lambda: "11e400",
    "a long text": lambda: "9" * 20_000,
    "a NUL": lambda: "so3\0",
    "code": lambda: "__import__('os').system('true')",
    "bytes": lambda: b"so3",
    "an object": object,
    "a class": lambda: int,
    "a function": lambda: lambda *args, **named: None,
    "a generator": lambda: (k for k in range(3)),
    "an empty list": list,
    "an empty mapping": dict,
    "a list of NaN": lambda: [NAN] * 3,
    "a list of inf": lambda: [INF, 0.0, 0.0],
    "a list of 1e300": lambda: [1e300] * 3,
    "a list of texts": lambda: ["a", "b", "c"],
    "a list of None": lambda: [None, None],
    "a ragged list": lambda: [[1, 2], [3]],
    "a list that holds itself": lambda: _endless(),
    "an empty array": lambda: np.zeros((0, 3)),
    "an array of objects": lambda: np.array([object()], dtype=object),
    "an array of NaN": lambda: np.full((3, 3), NAN),
    "an array of the wrong shape": lambda: np.ones((2, 5, 7)),
    "an array of bool": lambda: np.array([True, False, True]),
    "an array of 1e300": lambda: np.full((3, 3), 1e300),
    "a scalar array": lambda: np.array(1.0),
    "an integer array": lambda: np.array([1, 2, 3]),
    "a masked array": lambda: np.ma.masked_array([0.1, 0.2, 0.3], [True, False, False]),
    "a list with masked entries": lambda: [np.ma.masked_array([0.1, 0.2, 0.3], [True, False, False])] * 3,
    "a complex array": lambda: np.array([0.1 + 1j, 0.2, 0.3]),
    "a symbol": lambda: sp.Symbol("x"),
    "sympy's NaN": lambda: sp.nan,
    "a mapping of nonsense": lambda: {"a": object(), 3: None},
    "a slice": lambda: slice(None),
    "a path": lambda: Path("/no/such/place/at all"),
    "a folder": lambda: Path("/"),
}


def _endless() -> list[Any]:
    value: list[Any] = []
    value.append(value)
    return value


#: What nobody may take for numbers: a call that succeeds with it is a find.
NEVER_TAKEN = ("a masked array", "a list with masked entries")
#: Files, pictures and whole pipelines have tests of their own; these names are records of results.
LEFT_OUT = {
    "kernel_factory", "Plan", "Status", "ClosedLoop", "Trajectory", "Propagator", "Kernel", "MatrixGroup", "plot_plan", "load",
    "generate", "generate_closed_loop", "build", "group_names",
}  # fmt: skip


class LateError(Exception):
    """The alarm rang."""


def alarmed(seconds: float, call: Callable[[], Any]) -> Any:
    """The result of a call.

    Raises:
        LateError: it took longer, of this process's own time, or many times longer by the clock; what runs in C may ring late.
    """

    def ring(number: int, frame: FrameType | None) -> None:
        raise LateError(f"over {seconds:g} s")

    # By the clock alone a busy machine would be late; by the processor alone what waits for a FIFO would never be.
    timers = ((signal.SIGPROF, signal.ITIMER_PROF, seconds), (signal.SIGALRM, signal.ITIMER_REAL, 12 * seconds))
    before = [signal.signal(number, ring) for number, _, _ in timers]
    try:
        for _, timer, allowed in timers:
            signal.setitimer(timer, allowed)
        return call()
    finally:
        for (number, timer, _), handler in zip(timers, before, strict=True):
            signal.setitimer(timer, 0)
            signal.signal(number, handler)


def judged(seconds: float, call: Callable[[], Any]) -> str | None:
    """What is wrong with how a call ended: None for a result and for an error of ours."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            alarmed(seconds, call)
        except LieCodegenError as error:
            return None if len(str(error)) < 7000 else f"a message of {len(str(error))} characters"
        except Exception as error:
            return _found(error)
    return None


def _found(error: Exception) -> str:
    last = traceback.extract_tb(error.__traceback__)[-1]
    ours = [frame for frame in traceback.extract_tb(error.__traceback__) if "lie_codegen/" in frame.filename]
    where = ours[-1] if ours else last
    return f"{type(error).__name__} in {Path(where.filename).name}:{where.lineno}: {str(error)[:120]}"


def public_functions() -> Iterator[tuple[str, Any]]:
    """(name, callable) of the front door that are tried here."""
    for name in sorted(lc.__all__):
        value = getattr(lc, name)
        if callable(value) and name not in LEFT_OUT and not inspect.ismodule(value):
            yield name, value


def attempts(function: Any) -> Iterator[tuple[str, str]]:
    """(parameter, hostile value) for every parameter, optional ones too."""
    for name, parameter in inspect.signature(function).parameters.items():
        if parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
            for value in HOSTILE:
                yield name, value


def try_function(function: Any, parameter: str, value: str, seconds: float = 5.0) -> str | None:
    """The verdict on one call."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        arguments = {name: make() for name, make in plausible_arguments(function).items()}
    arguments[parameter] = HOSTILE[value]()
    positional = {
        name for name, each in inspect.signature(function).parameters.items() if each.kind is each.POSITIONAL_ONLY
    }
    first = [arguments.pop(name) for name in list(arguments) if name in positional]
    answer: list[Any] = []
    verdict = judged(seconds, lambda: answer.append(function(*first, **arguments)))
    return "masked entries were taken" if answer and value in NEVER_TAKEN else verdict


def hunt(share: float, seed: int = 0, seconds: float = 5.0) -> tuple[int, list[str]]:
    """(calls tried, finds) over a share of all calls of the front door."""
    with (
        tempfile.TemporaryDirectory(prefix="hunt-") as folder,
        contextlib.chdir(folder),
    ):  # a text may be taken for a file
        return _hunt(random.Random(seed), share, seconds)


def _hunt(rng: random.Random, share: float, seconds: float) -> tuple[int, list[str]]:
    tried, found = 0, []
    for name, function in public_functions():
        for parameter, value in attempts(function):
            if rng.random() < share:
                tried += 1
                verdict = try_function(function, parameter, value, seconds)
                if verdict is not None and "LateError" in verdict:
                    # A first call may compile for seconds on a busy machine; what is late without end is late again.
                    verdict = try_function(function, parameter, value, 4 * seconds)
                if verdict is not None:
                    found.append(f"lc.{name}({parameter}={value}): {verdict}")
    return tried, found
