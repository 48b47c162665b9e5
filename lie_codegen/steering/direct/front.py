"""When lc.steer takes the direct method: asked for by name, or by what no other method can do, or where it is the surer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lie_codegen.errors import SteeringInputError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.direct.least_time import MOST_CONTROLS
from lie_codegen.steering.direct.method import direct
from lie_codegen.steering.goals import GoalSet
from lie_codegen.steering.plan import Plan

#: Options that no other method has.
_OWN = {"equation", "spread", "rounds", "pieces", "iterations", "seed", "polish", "vertices"}
#: Options with which "auto" is surer by reaching first.
_SURER = {"bounds", "drift"}


def asks_direct(method: str, target: Any, controls: Sequence[Any], options: Mapping[str, Any]) -> bool:
    """Whether the direct method is meant."""
    if method != "auto":
        return method == "direct"
    given = {name for name, value in options.items() if value is not None}
    if given & _OWN or options.get("objective") == "fuel":
        return True
    if isinstance(target, GoalSet):
        return given <= _options()  # what it has no option for goes to a method that moves along the set
    if given & {"start", "guess"} and given <= _options():
        return True
    if any(not isinstance(each, str | int | np.integer) for each in controls) or callable(options.get("drift")):
        return True
    if not given & _SURER or not given <= _options():
        return False
    objective = options.get("objective", "energy")
    if objective == "time" and options.get("vertices") is not None:
        return True
    return objective == "energy" or (objective == "time" and _bounded(options.get("bounds"), controls))


def _bounded(bounds: Any, controls: Sequence[Any]) -> bool:
    """Whether every one of few controls is bounded, as words of arcs need it."""
    some = not isinstance(bounds, Mapping) or len(bounds) == len(controls)
    return bounds is not None and some and len(controls) <= MOST_CONTROLS


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
    known = _options()
    unknown = sorted(set(options) - known)
    if unknown:
        raise SteeringInputError(f"direct has no option {', '.join(unknown)}; it has {', '.join(sorted(known))}")
    return direct(group, target, controls, duration, tolerance=tolerance, **options)


def _options() -> set[str]:
    return set(direct.__kwdefaults__ or {}) - {"tolerance"}
