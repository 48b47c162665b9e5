"""When lc.steer takes the direct method: asked for by name, or by what no other method can do, or where it is the surer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

from lie_codegen.errors import SteeringInputError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.direct.method import direct
from lie_codegen.steering.plan import Plan

#: Options of the direct method that a way of it does not read.
_IDLE = {
    "time": (
        ("weights", "guess", "spread", "pieces", "polish"),
        'on least time by arcs of method="direct"; leave it away (method="transcription" follows a guess)',
    ),
    "spread": (
        ("weights", "objective", "rounds", "polish"),
        "beside spread=, whose controls have least squared errors; leave it away",
    ),
    "obstacles": (
        ("spread", "pieces", "polish", "vertices"),
        "beside obstacles=, around which there are 64 pieces; leave it away",
    ),
}


def direct_plan(
    group: MatrixGroup,
    target: Any,
    controls: Sequence[Any],
    duration: float,
    tolerance: float,
    options: Mapping[str, Any],
) -> Plan:
    """The plan of the direct method.

    Raises:
        SteeringInputError: an option it does not have.
        Others as `direct`.
    """
    if options.get("dynamics") == "second_order":
        return _torques(group, target, controls, duration, tolerance, options)
    known = direct_options()
    _refuse_others("direct", known, options)
    _refuse_idle(f"steer({group.name})", options)
    return direct(group, target, controls, duration, tolerance=tolerance, **options)


def _torques(
    group: MatrixGroup,
    target: Any,
    controls: Sequence[Any],
    duration: float,
    tolerance: float,
    options: Mapping[str, Any],
) -> Plan:
    if options.get("obstacles"):
        from lie_codegen.steering.direct.torque_around import torques_around

        _refuse_others("direct, with torques among obstacles,", torque_options(), options)
        if "longest" in options and options.get("objective") != "time":
            raise SteeringInputError(f'steer({group.name}): longest is of objective="time"; leave it away')
        return torques_around(group, target, controls, duration, tolerance, **options)
    from lie_codegen.steering.direct.torque_time import least_time_torques

    _refuse_others("direct, with torques,", set(least_time_torques.__kwdefaults__ or {}) | {"dynamics"}, options)
    return least_time_torques(group, target, controls, duration, tolerance, **options)


def torque_options() -> set[str]:
    """Names of the options that the direct method has under torques among obstacles."""
    from lie_codegen.steering.direct.torque_around import torques_around

    return set(torques_around.__kwdefaults__ or {}) | {"obstacles"}


def _refuse_others(what: str, known: set[str], options: Mapping[str, Any]) -> None:
    unknown = sorted(set(options) - known)
    if unknown:
        raise SteeringInputError(
            f"{what} has no option {', '.join(unknown)}; it has {', '.join(sorted(known))}{_elsewhere(options, unknown)}"
        )


def _elsewhere(options: Mapping[str, Any], unknown: Sequence[str]) -> str:
    """Where options are that the direct method has not, if it is one place."""
    from lie_codegen.steering.transcription.numbers import Options

    has = {each.name for each in fields(Options)} | {"progress"}
    if not has.issuperset(unknown):
        return ""
    others = sorted(set(options) - has)
    beside = f", without {', '.join(others)}" if others else ', as method="auto" does here'
    return f'. method="transcription" takes {", ".join(unknown)}{beside}'


def _refuse_idle(where: str, options: Mapping[str, Any]) -> None:
    """Least time starts from words of arcs, and a spread has one sum of squares: what only the other searches read is refused."""
    timed, among = options.get("objective") == "time", bool(options.get("obstacles"))
    there = {"time": timed and not among, "spread": "spread" in options, "obstacles": among}
    for asked, (idle, instead) in _IDLE.items():
        stray = [name for name in idle if name in options]
        if among and asked == "obstacles" and ("weights" if timed else "longest") in options:
            stray.append("weights" if timed else "longest")
        if stray and there[asked]:
            raise SteeringInputError(f"{where}: {', '.join(stray)} has no effect {instead}")


def direct_options() -> set[str]:
    """Names of the options that the direct method has."""
    return set(direct.__kwdefaults__ or {}) - {"tolerance"}
