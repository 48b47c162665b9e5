"""A closed loop as a unit of FMI: one state, the reference and the law called inside at their times, numbers as tunable parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

#: What a simulator need not give: the loop itself knows them.
_OWN = ("state", "t", "h")


def loop_unit(
    schedule: Mapping[str, Any], functions: Sequence[Any], variable: Callable[..., dict[str, Any]]
) -> tuple[list[dict[str, Any]], dict[str, Any], int]:
    """The unit's variables, what its C needs to know, and the doubles of its record.

    Args:
        schedule: as in `PackageParts.schedule`.
        functions: those of the package.
        variable: (name, reference, port, place, start, causality) -> the variable's record.
    """
    by_symbol = {each.symbol: each for each in functions}
    step = by_symbol[schedule["step"]]
    control, reference = by_symbol.get(schedule["control"]), by_symbol.get(schedule["reference"])
    variables: list[dict[str, Any]] = []
    places: dict[str, int] = {}
    total = 0

    def put(port: Any, start: list[str] | None, causality: str) -> None:
        nonlocal total
        places[port.name] = total
        variables.append(variable(port.name, len(variables) + 1, port, total, start, causality))
        total += port.size

    wanted = [port for port in reference.outputs if not port.name.endswith("_next")] if reference else []
    shown = {port.name for port in wanted}
    put(next(port for port in step.inputs if port.name == "state"), step.start["state"], "output")
    for function in (each for each in (step, control) if each is not None):
        for port in function.inputs:
            if port.name in (*_OWN, *shown, *places):
                continue
            put(port, function.start[port.name], "input" if port.name == schedule["input"] else "parameter")
    for port in wanted:
        put(port, None, "output")

    def call(function: Any, t: str, h: str) -> str:
        told = {"state": "x", "t": t, "h": h, **{name: f"c_{name}" for name in shown}}
        arguments = [
            told.get(port.name) or (f"x[{places[port.name]}]" if port.scalar else f"x + {places[port.name]}")
            for port in function.inputs
        ]
        return f"{function.symbol}({', '.join([*arguments, 'x'])})"

    stages = schedule["stages"]
    unit = {
        **schedule,
        "reference": None
        if reference is None
        else {
            "symbol": reference.symbol,
            "arrays": [(f"c_{port.name}", stages * port.size) for port in wanted],
            "stages": [", ".join(f"c_{port.name} + {stage * port.size}" for port in wanted) for stage in range(stages)],
            "shown": ", ".join(f"x + {places[port.name]}" for port in wanted),
        },
        "control": None if control is None else call(control, "now", repr(float(schedule["sample"]))),
        "step": call(step, "now", "part"),
        "size": step.outputs[0].size,
    }
    return variables, unit, total
