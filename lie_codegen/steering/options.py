"""The kinds of the options of lc.steer, checked before anything is done."""

from __future__ import annotations

import operator
from collections.abc import Mapping
from typing import Any

import numpy as np

from lie_codegen.errors import SteeringInputError

_WHOLE = (
    "intervals", "pieces", "starts", "rounds", "iterations", "seed", "classes", "q", "harmonics", "order", "threads", "steps",
)  # fmt: skip
_MOST = 1_000_000
_YES_OR_NO = ("rest", "periodic", "polish", "exact", "compare")
_TEXTS = ("objective", "dynamics", "equation", "solver", "quadrature", "integrator", "form", "amplitude", "planner")
#: Options that mean something only beside another one: that one, and what to give.
_BESIDE = {
    "longest": ("objective", "time", 'the longest duration of objective="time"'),
    "vertices": ("objective", "time", 'the controls of arcs of objective="time"'),
    "classes": ("obstacles", None, "the number of ways between obstacles="),
}
#: Methods that take a drift that depends on time.
_TIMED_DRIFT = ("auto", "direct")


def check_options(where: str, method: str, options: Mapping[str, Any]) -> None:
    """Whole numbers are whole, switches are True or False, names are texts; a drift of time is for the direct method; none is without effect.

    Raises:
        SteeringInputError: naming the option and what it takes.
    """
    for name, (other, wanted, meaning) in _BESIDE.items():
        if name in options and (other not in options or (wanted is not None and options[other] != wanted)):
            raise SteeringInputError(f"{where}: {name} is {meaning}; give that too, or leave {name} away")
    for name, value in options.items():
        if name in _WHOLE and not _is_whole(value):
            raise SteeringInputError(f"{where}: {name} is a whole number, got {value!r:.60}")
        if name in _WHOLE and name != "seed" and not abs(operator.index(value)) <= _MOST:
            raise SteeringInputError(f"{where}: {name} is a whole number of at most {_MOST}")
        if name in _YES_OR_NO and not isinstance(value, bool | np.bool_):
            raise SteeringInputError(f"{where}: {name} is True or False, got {value!r:.60}")
        if name in _TEXTS and not isinstance(value, str):
            raise SteeringInputError(f"{where}: {name} is a text, got {value!r:.60}")
        if name == "drift" and callable(value) and method not in _TIMED_DRIFT:
            raise SteeringInputError(
                f"{where}: method {method!r} takes a constant drift, (n,) numbers; a function of time is for method='direct'"
            )


def _is_whole(value: Any) -> bool:
    try:
        operator.index(value)
    except TypeError:
        return False
    return not isinstance(value, bool)
