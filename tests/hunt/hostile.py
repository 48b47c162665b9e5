"""Hostile values, and calls of every public name with one argument replaced by each of them.

A call may succeed, or raise an error of ours. Anything else is a find: another exception, or a call that outlives its alarm.
"""

from __future__ import annotations

import inspect
import random
import signal
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


def _law() -> Any:
    return lc.tracking_law("so3", inertia=[1, 2, 2], error="so3_right", gains={"K_p": [1, 1, 1], "K_d": 1})


def _cart() -> Any:
    return lc.lagrangian_system(coordinates=["x"], lagrangian="dx^2/2 - x^2/2", forces={"x": "u"})


def _body() -> Any:
    return lc.free_rigid_body([3, 2, 1])


def _flow() -> Any:
    return lc.euler_average(_body(), ["-0.2*w1", "0.1*w2", "-0.1*w3"])


#: Plausible arguments by the name of the parameter; what is not here is left to its default, or gets 1.0.
PLAUSIBLE: dict[str, Callable[[], Any]] = {
    "group": lambda: "so3",
    "name_or_path": lambda: "so3",
    "what": lambda: "so3",
    "a": lambda: "so3",
    "b": lambda: "r3",
    "u": lambda: lc.PeriodicInput(["cos(t)", "sin(t)", "0"]),
    "inertia": lambda: [1.0, 2.0, 2.5],
    "name": lambda: "thing",
    "namespace": lambda: "thing",
    "labels": lambda: ["a", "b"],
    "brackets": lambda: {("a", "b"): {"b": 1}},
    "matrices": lambda: [[[0, 1], [0, 0]], [[1, 0], [0, -1]]],
    "combinations": lambda: {"a": {"w1": 1}, "b": {"w2": 1}, "c": {"w3": 1}},
    "controls": lambda: ["w1", "w2"],
    "target": lambda: [0.1, 0.2, 0.3],
    "duration": lambda: 1.0,
    "eps": lambda: 0.1,
    "order": lambda: 2,
    "t": lambda: [0.0, 0.5, 1.0],
    "X": lambda: np.eye(3),
    "Y": lambda: np.eye(3),
    "X0": lambda: np.eye(3),
    "X_d": lambda: np.eye(3),
    "Xs": lambda: np.array([np.eye(3), np.eye(3)]),
    "R": lambda: np.eye(3),
    "q": lambda: [1.0, 0.0, 0.0, 0.0],
    "s": lambda: 0.5,
    "xi": lambda: [0.1, 0.2, 0.3],
    "xi0": lambda: [0.1, 0.2, 0.3],
    "xi_d": lambda: [0.0, 0.0, 0.0],
    "x": lambda: [0.1, 0.2, 0.3],
    "y": lambda: [0.1, 0.2, 0.3],
    "gains": lambda: {"K_p": [1, 1, 1], "K_d": 1},
    "error": lambda: "so3_right",
    "law": _law,
    "system": _cart,
    "flow": _flow,
    "body": _body,
    "kernel": lambda: lc.group_kernels("so3")[0],
    "port": lambda: "g",
    "components": lambda: ["cos(t)", "sin(t)", "0"],
    "coordinates": lambda: ["x"],
    "lagrangian": lambda: "dx^2/2 - x^2/2",
    "forces": lambda: {"x": "u"},
    "estimates": lambda: [lc.Uncertain("so3", np.eye(3), np.eye(3) * 1e-4)],
    "covariance": lambda: np.eye(3) * 1e-4,
    "times": lambda: [0.0, 0.5, 1.0],
    "values": lambda: [[0.0, 0.0, 0.0]] * 3,
    "library": lambda: "scipy",
    "qubits": lambda: 1,
    "path": lambda: "/no/such/file",
    "folder": lambda: "/proc/none",
    "center": lambda: [0.0, 0.0, 1.0],
    "radius": lambda: 0.1,
    "axis": lambda: [0.0, 0.0, 1.0],
    "direction": lambda: [0.0, 0.0, 1.0],
    "half_angle": lambda: 0.3,
    "point": lambda: [0.0, 0.0, 1.0],
    "element": lambda: np.eye(3),
    "formula": lambda: "X[0][0] - 1/2",
    "delta": lambda: 0.1,
    "directions": lambda: np.eye(3),
    "positions": lambda: np.eye(3),
    "weights": lambda: [1.0, 1.0],
    "position": lambda: ["cos(t)", "sin(t)", "0"],
    "perturbation": lambda: ["-0.2*w1", "0.1*w2", "-0.1*w3"],
    "vehicle": lambda: lc.underwater_vehicle("se3", inertia=1),
    "fields": lambda: lc.vibrational_fields(_cart(), lc.PeriodicInput(["cos(t)"])),
    "intervals": lambda: 4,
    "mass": lambda: 1,
    "B": lambda: np.eye(3),
    "omega": lambda: 1.0,
    "steps": lambda: 3,
    "parameters": lambda: None,
    "problem": lambda: lc.ocp("so3", duration=1.0, intervals=4, controls=["w1", "w2"], bounds={"u": 1.0}),
}
#: Files, pictures and whole pipelines have tests of their own; these names are records of results.
LEFT_OUT = {
    "kernel_factory", "Plan", "Status", "ClosedLoop", "Trajectory", "Propagator", "Kernel", "MatrixGroup", "plot_plan", "load",
    "generate", "generate_closed_loop", "build", "group_names",
}  # fmt: skip
#: Not given again to every call: weights of a mean have another length than those of a plan, and so on.
_OPTIONAL = {"controls", "duration", "t"}


class LateError(Exception):
    """The alarm rang."""


def alarmed(seconds: float, call: Callable[[], Any]) -> Any:
    """The result of a call.

    Raises:
        LateError: it took longer; what runs in C may ring late.
    """

    def ring(number: int, frame: FrameType | None) -> None:
        raise LateError(f"over {seconds:g} s")

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        return call()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


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


def plausible_arguments(function: Any) -> dict[str, Callable[[], Any]]:
    """{parameter: maker} of a call that is nearly right."""
    chosen = {}
    for name, parameter in inspect.signature(function).parameters.items():
        if parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
            continue
        if parameter.default is parameter.empty or name in _OPTIONAL:
            chosen[name] = PLAUSIBLE.get(name, lambda: 1.0)
    return chosen


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
    return judged(seconds, lambda: function(*first, **arguments))


def hunt(share: float, seed: int = 0, seconds: float = 5.0) -> tuple[int, list[str]]:
    """(calls tried, finds) over a share of all calls of the front door."""
    rng = random.Random(seed)
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
