"""Hostile arguments to the methods of what the front door returns: plans, runs, controllers, studies, propagators, observers, libraries.

A call may succeed, or raise an error of ours, soon. Beside that: what is asked at no time or of no number has no finite answer.
"""

from __future__ import annotations

import contextlib
import inspect
import random
import tempfile
import warnings
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import numpy as np

import lie_codegen as lc
from tests.hunt import hostile, plausible

Makers = dict[str, Callable[[], Any]]


@cache
def _controller() -> Any:
    problem = lc.ocp(
        "so3", controls=("w1", "w2", "w3"), duration=1.0, intervals=5, parameters={"Xd": (3, 3)}, bounds=1.5,
        stage_cost=("X - Xd", "u"), terminal_cost=("2*(X - Xd)",), name="hunted",
    )  # fmt: skip
    controller = lc.mpc(problem)
    controller.reset(X0=np.eye(3), Xd=np.eye(3))
    return controller


@cache
def _study() -> Any:
    return lc.study(lc.studies.each(lambda a: {"b": a * a}), {"a": lc.Uniform(0, 1)}, n=8, seed=1, store=None)


@cache
def _library() -> Any:
    return lc.build("so3")


#: What is made once and asked often.
OBJECTS: Makers = {
    "plan": plausible._plan,
    "plan of optimal": cache(lambda: lc.steer("so3", (0.1, 0.2, 0.3), ("w1", "w2"), 2.0)),
    "controller": _controller,
    "problem": lambda: _controller().problem,
    "study": _study,
    "loop": plausible._loop,
    "run": cache(lambda: lc.simulate("so3", ["cos(t)", "sin(t)", "0"], t=[0, 0.5, 1.0])),
    "propagator": cache(lambda: lc.propagator("so3", lc.ParametricInput(["k*cos(t)", "0", "0"], ["k"]), duration=1.0)),
    "propagation": cache(lambda: OBJECTS["propagator"]()(k=1.0)),
    "exp": lambda: _library().exp,
    "wei_norman_rate": lambda: _library().wei_norman_rate,
    "step": cache(lambda: lc.build(lc.rkmk4_step("so3")).rkmk4_step),
    "group": lambda: lc.group("so3"),
    "input": lambda: lc.PeriodicInput(["cos(t)", "sin(t)", "0"]),
    "samples": lambda: lc.SampledInput([0.0, 0.5, 1.0], np.ones((2, 3))),
    "parametric": lambda: lc.ParametricInput(["k*cos(t)", "0", "0"], ["k"]),
    "reference": lambda: lc.reference("so3", ["sin(t)", "0", "0"]),
    "observer": lambda: lc.observer("so3", directions=[[0, 0, 1], [0.6, 0, 0.8]]),
    "margins": lambda: lc.loop_margins(
        "so3", inertia=[1, 2, 2.5], error="so3_right", gains={"K_p": [4, 5, 6], "K_d": 4}
    ),
    "average": cache(lambda: lc.average("so3", lc.PeriodicInput(["cos(t)", "sin(t)", "0"]), 2)),
    "estimate": lambda: lc.Uncertain("so3", np.eye(3), np.eye(3) * 1e-4),
    "body": plausible._body,
    "flow": plausible._flow,
    "law": cache(lambda: lc.build(plausible._law()).tracking_law),
    "uniform": lambda: lc.Uniform(0.0, 1.0),
    "normal": lambda: lc.Normal(0.0, 1.0),
}
#: Arguments of a method by the name of the parameter, where those of the front door do not do.
PLAUSIBLE: Makers = {
    "Xd": lambda: np.eye(3),
    "k": lambda: 2,
    "n": lambda: 2,
    "q": lambda: (0.1, 0.5),
    "index": lambda: 1,
    "t": lambda: 0.5,
    "steps": lambda: 3,
    "step": lambda: 0.01,
    "uniform": lambda: np.full((4, 1), 0.5),
    "cotangent": lambda: np.eye(3),
    "g": lambda: [0.1, 0.2, 0.3],
    "u": lambda: [0.1, 0.2, 0.3],
    "timeout": lambda: 1.0,
    "order": lambda: ("w3", "w1", "w2"),
    "A": lambda: np.zeros((3, 3)),
    "xi": lambda: [0.1, 0.2, 0.3],
}
_AT_REST: Makers = {
    "X": lambda: np.eye(3), "xi": lambda: np.zeros(3), "X_d": lambda: np.eye(3), "xi_d": lambda: np.zeros(3), "xi_d_dot": lambda: np.zeros(3),
}  # fmt: skip
#: Arguments that a method takes by **, and every optional one that is worth a try.
BY_METHOD: dict[tuple[str, str], Makers] = {
    ("controller", "step"): {"X": lambda: np.eye(3), "t": lambda: 0.1, "Xd": lambda: np.eye(3)},
    ("controller", "reset"): {"X0": lambda: np.eye(3), "Xd": lambda: np.eye(3)},
    ("controller", "simulate"): {
        "X0": lambda: np.eye(3), "steps": lambda: 2, "values": lambda: {"Xd": np.eye(3)}, "duration": lambda: None,
    },
    ("problem", "solve"): {"X0": lambda: np.eye(3), "Xd": lambda: np.eye(3)},
    ("propagator", "__call__"): {"k": lambda: 1.0},
    ("propagator", "batch"): {"k": lambda: [1.0, 2.0]},
    ("propagator", "power"): {"n": lambda: 3, "k": lambda: 1.0},
    ("propagator", "gradient"): {"k": lambda: 1.0},
    ("law", "__call__"): _AT_REST,
    ("law", "batch"): {**_AT_REST, "xi": lambda: np.zeros((3, 3))},
    ("exp", "__call__"): {"x": lambda: [0.1, 0.2, 0.3]},
    ("exp", "batch"): {"x": lambda: np.ones((3, 3))},
    ("wei_norman_rate", "__call__"): {"g": lambda: [0.1, 0.2, 0.3], "u": lambda: [0.1, 0.2, 0.3]},
    ("wei_norman_rate", "batch"): {"g": lambda: np.ones((3, 3)), "u": lambda: np.ones((3, 3))},
}  # fmt: skip
#: Met with the plan's own control by contract; the second gives the time, not what is asked at it.
ANSWERED = {("controller", "step"), ("study", "wait")}
NO_NUMBER = ("NaN", "a list of NaN", "an array of NaN")
#: Not for users: parts of packages, what the machine asks; a text and a path that would be read or written.
LEFT_OUT = {
    "package_parts", "render_package", "made_by", "compiled_from", "belongs_to", "reduced", "of", "evaluate", "sampler", "sample", "defined_by",
    "restored", "recorded", "machine", "start", "kernels", "averaged_kernel", "stacked", "result_type", "variational", "quadrature", "slow_field",
}  # fmt: skip


def methods(kind: str, thing: Any) -> Iterator[tuple[str, Any]]:
    """(name, bound method) of the public methods of a class of ours, of its call, and of functions that it holds."""
    for name in sorted({*dir(thing), "__call__"}):
        if name.startswith("_") and name != "__call__":
            continue
        if (
            name in LEFT_OUT
            or (name == "save" and kind != "plan")
            or isinstance(inspect.getattr_static(type(thing), name, None), property)
        ):
            continue
        with contextlib.suppress(Exception):
            method = getattr(thing, name)
            if callable(method) and not (name == "body" and hasattr(thing, "sampler")):
                inspect.signature(method)
                yield name, method


def arguments(kind: str, name: str, method: Any) -> Makers:
    """Plausible arguments of a method, by name; the required ones, and those of `BY_METHOD`."""
    chosen: Makers = dict(BY_METHOD.get((kind, name), {}))
    for parameter in inspect.signature(method).parameters.values():
        if parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD) or parameter.name in chosen:
            continue
        if parameter.default is parameter.empty:
            known = PLAUSIBLE.get(parameter.name) or plausible.PLAUSIBLE.get(parameter.name)
            chosen[parameter.name] = known or (lambda: 1.0)
    return chosen


def parameters(kind: str, name: str, method: Any) -> list[str]:
    """Every parameter that can be named, optional ones too."""
    own = [
        p.name for p in inspect.signature(method).parameters.values() if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)
    ]
    return list(dict.fromkeys([*own, *BY_METHOD.get((kind, name), {})]))


def attempt(kind: str, name: str, method: Any, parameter: str, value: str, seconds: float = 5.0) -> str | None:
    """The verdict on one call."""
    given = {each: make() for each, make in arguments(kind, name, method).items()}
    given[parameter] = hostile.HOSTILE[value]()
    known = inspect.signature(method).parameters
    first = [given.pop(each) for each in known if known[each].kind is known[each].POSITIONAL_ONLY and each in given]
    answer: list[Any] = []
    verdict = hostile.judged(seconds, lambda: answer.append(method(*first, **given)))
    if answer and value in hostile.NEVER_TAKEN:
        return "masked entries were taken"
    if verdict is None and answer and value in NO_NUMBER and (kind, name) not in ANSWERED and _is_finite(answer[0]):
        return f"a finite answer: {answer[0]!r:.100}"
    return verdict


def _is_finite(answer: Any) -> bool:
    """Whether it is numbers, and every one is finite."""
    if isinstance(answer, float | complex | np.ndarray):
        entries = np.asarray(answer)
        return entries.dtype.kind in "fc" and entries.size > 0 and bool(np.isfinite(entries).all())
    return isinstance(answer, tuple) and bool(answer) and all(_is_finite(each) for each in answer)


def hunt(share: float, seed: int = 0, seconds: float = 5.0, only: str = "") -> tuple[int, list[str]]:
    """(calls tried, finds) over a share of all calls."""
    rng, tried, found = random.Random(seed), 0, []
    with tempfile.TemporaryDirectory(prefix="hunt-") as folder, contextlib.chdir(folder), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for kind, make in OBJECTS.items():
            if only and kind != only:
                continue
            for name, method in methods(kind, make()):
                for parameter in parameters(kind, name, method):
                    if parameter == "out":  # what lies there is written over
                        continue
                    for value in hostile.HOSTILE:
                        if rng.random() < share:
                            tried += 1
                            verdict = attempt(kind, name, method, parameter, value, seconds)
                            if verdict is not None and "LateError" in verdict:
                                verdict = attempt(kind, name, method, parameter, value, 4 * seconds)
                            if verdict is not None:
                                found.append(f"{kind}.{name}({parameter}={value}): {verdict}")
    return tried, found
