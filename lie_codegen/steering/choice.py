"""Which kind of steering is meant, before the code of any is imported: a first plan by shooting needs no other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lie_codegen.steering.constraints import Ball
from lie_codegen.steering.goals import GoalSet

#: Options that no other method than "ocp" has, and none other than "direct".
_OPEN = {"cost", "terminal_cost", "constraints", "parameters"}
_DIRECT = {"equation", "spread", "rounds", "pieces", "iterations", "seed", "polish", "vertices"}
#: Options with which "auto" is surer by reaching first, and a call by itself soonest answered (decision 23).
_SURER = {"bounds", "drift"}
#: Obstacles in space up to which "auto" asks the transcription before the direct method.
_FEW = 4


def asks_open(method: str, options: Mapping[str, Any]) -> bool:
    """Whether a problem of one's own is meant."""
    return method == "ocp" or (method == "auto" and any(options.get(name) is not None for name in _OPEN))


def asks_direct(method: str, target: Any, controls: Sequence[Any], options: Mapping[str, Any]) -> bool:
    """Whether the direct method is meant."""
    if method != "auto":
        return method == "direct"
    given = {name for name, value in options.items() if value is not None}
    if _avoids(options):
        # a few obstacles are the transcription's first, where it has all that is asked for; it is compiled for their number (decision 24)
        unusual = bool(given & _DIRECT) or callable(options.get("drift")) or not _plain(controls)
        unusual = unusual or options.get("objective") == "fuel"
        return unusual or (
            _only_direct(given) and len(options["obstacles"]) > _FEW and not _discs(options["obstacles"])
        )
    if given & _DIRECT or options.get("objective") == "fuel":
        return True
    if options.get("objective") == "time" and "guess" in given:
        return False  # arcs of least time start from words; the transcription follows the guess
    if isinstance(target, GoalSet):
        return _only_direct(given)  # what it has no option for goes to a method that moves along the set
    if given & {"start", "guess"} and _only_direct(given):
        return True
    if not _plain(controls) or callable(options.get("drift")):
        return True
    if not given & _SURER or not _only_direct(given):
        return False
    objective = options.get("objective", "energy")
    if objective == "time" and options.get("vertices") is not None:
        return True
    return objective == "energy" or (objective == "time" and _bounded(options.get("bounds"), controls))


def goes_around(method: str, controls: Sequence[Any], options: Mapping[str, Any]) -> bool:
    """Whether "auto" may ask the direct method where the transcription found no way among obstacles."""
    given = {name for name, value in options.items() if value is not None}
    if method != "auto" or not _avoids(options) or not _plain(controls):
        return False
    if options.get("dynamics") == "second_order":
        from lie_codegen.steering.direct.front import torque_options

        return given <= torque_options()
    return _only_direct(given)


def _avoids(options: Mapping[str, Any]) -> bool:
    """Whether there are obstacles."""
    obstacles = options.get("obstacles")
    return isinstance(obstacles, list | tuple) and len(obstacles) > 0


def _plain(controls: Sequence[Any]) -> bool:
    return all(isinstance(each, str | int | np.integer) for each in controls)


def _discs(obstacles: Any) -> bool:
    return all(isinstance(each, Ball) and len(each.center) == 2 for each in obstacles)


def _only_direct(given: set[str]) -> bool:
    """Whether the direct method has all these options."""
    from lie_codegen.steering.direct.front import direct_options

    return given <= direct_options()


def _bounded(bounds: Any, controls: Sequence[Any]) -> bool:
    """Whether every one of few controls is bounded, as words of arcs need it."""
    from lie_codegen.steering.direct.arc_words import MOST_CONTROLS

    some = not isinstance(bounds, Mapping) or len(bounds) == len(controls)
    return bounds is not None and some and len(controls) <= MOST_CONTROLS
