"""The open-loop steering methods by name, with the options each takes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

from lie_codegen.errors import SteeringInputError
from lie_codegen.steering.closed_form.area_rule import area_rule
from lie_codegen.steering.closed_form.circle import circle
from lie_codegen.steering.closed_form.four_phase import four_phase
from lie_codegen.steering.closed_form.loops import loops
from lie_codegen.steering.closed_form.sinusoids import sinusoids
from lie_codegen.steering.closed_form.swing_twist import swing_twist
from lie_codegen.steering.optimal import optimal
from lie_codegen.steering.plan import Plan
from lie_codegen.steering.task import Task
from lie_codegen.steering.transcription.numbers import Options

Method = Callable[..., Plan]


class _Transcription:
    """The method "transcription", whose module, and with it CasADi, is imported when it is asked for: shooting needs none."""

    @property
    def method(self) -> Method:
        from lie_codegen.steering.transcription.transcribe import transcription

        return transcription

    @property
    def __kwdefaults__(self) -> dict[str, Any]:
        return {**{each.name: each.default for each in fields(Options)}, "progress": None}

    def __call__(self, task: Task, **options: Any) -> Plan:
        return self.method(task, **options)


OPEN_LOOP: Mapping[str, Method] = {
    "four_phase": four_phase,
    "circle": circle,
    "swing_twist": swing_twist,
    "sinusoids": sinusoids,
    "area_rule": area_rule,
    "loops": loops,
    "optimal": optimal,
    "transcription": _Transcription(),
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
