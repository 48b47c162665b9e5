"""The open-loop steering methods by name, with the options each takes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from importlib import import_module
from typing import Any

from lie_codegen.errors import SteeringInputError
from lie_codegen.steering.plan import Plan
from lie_codegen.steering.shooting.method import optimal
from lie_codegen.steering.task import Task

Method = Callable[..., Plan]


class _Planner:
    """A method that is imported when it is asked for: the first plan by shooting needs no other.

    Args:
        home: its module below lie_codegen.steering.
        name: the function's name there.
    """

    def __init__(self, home: str, name: str) -> None:
        self.home, self.name = home, name

    @property
    def method(self) -> Method:
        found: Method = getattr(import_module(f"lie_codegen.steering.{self.home}"), self.name)
        return found

    @property
    def __kwdefaults__(self) -> dict[str, Any]:
        return self.method.__kwdefaults__ or {}

    def __call__(self, task: Task, **options: Any) -> Plan:
        return self.method(task, **options)


class _Transcription(_Planner):
    """Its options are a record's fields: they are known before CasADi is imported."""

    @property
    def __kwdefaults__(self) -> dict[str, Any]:
        from lie_codegen.steering.transcription.numbers import Options

        return {**{each.name: each.default for each in fields(Options)}, "progress": None}


OPEN_LOOP: Mapping[str, Method] = {
    **{
        name: _Planner(f"closed_form.{name}", name)
        for name in ("four_phase", "circle", "swing_twist", "sinusoids", "area_rule", "loops")
    },
    "optimal": optimal,
    "transcription": _Transcription("transcription.transcribe", "transcription"),
}


def plan_by(methods: Mapping[str, Method], method: str, task: Task, options: Mapping[str, Any]) -> Plan:
    """The plan of one of the methods; "auto" is "transcription" if an option asks for it, else "optimal".

    Raises:
        SteeringInputError: an unknown method or option.
    """
    return solver_of(methods, method, options)(task, **options)


def solver_of(methods: Mapping[str, Method], method: str, options: Mapping[str, Any]) -> Method:
    """The method of that name, which has these options.

    Raises:
        SteeringInputError: an unknown method or option.
    """
    if method == "auto":
        method = "transcription" if set(options) - _options_of(optimal) else "optimal"
    solver = methods.get(method)
    if solver is None:
        raise SteeringInputError(
            f"no method {method!r}; there are auto, {', '.join(sorted([*methods, 'direct', 'symmetric_product']))}"
        )
    known = _options_of(solver)
    unknown = sorted(set(options) - known)
    if unknown:
        has = ", ".join(sorted(known)) or "none"
        raise SteeringInputError(f"{method} has no option {', '.join(unknown)}; it has {has}")
    return solver


def _options_of(solver: Method) -> set[str]:
    return set(solver.__kwdefaults__ or {})
