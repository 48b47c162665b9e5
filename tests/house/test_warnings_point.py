"""A warning points at the line of the caller's that caused it, whatever lies between; no module of ours warns in another way."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.errors import (
    AssumptionWarning,
    DegradedWarning,
    InertiaWarning,
    NoCompilerWarning,
    SlowWarning,
    SpreadWarning,
)
from lie_codegen.runtime.compiler import warn_no_compiler
from lie_codegen.runtime.degraded import warn_degraded

PACKAGE = Path(lc.__file__).parent


CASES = {
    "inertia": (InertiaWarning, lambda: lc.attitude_law("pd", inertia=(1, 3, 6), k_p=4, k_d=6)),
    "jumps": (
        AssumptionWarning,
        lambda: lc.average("so3", lc.PeriodicInput.from_pieces([(1, [1, 0, 0]), (2, [0, 1, 0])])),
    ),
    "spin": (AssumptionWarning, lambda: lc.free_rotation((3, 4, 5), np.eye(3), (0, 1, 0))),
    "spread": (SpreadWarning, lambda: lc.Uncertain("so3", np.eye(3), 4 * np.eye(3))),
    "slow": (SlowWarning, lambda: lc.simulate("so3", lambda t, g: [-g[0], -g[1], 0.0], t=[0, 0.1], rtol=1e-3)),
    "degraded": (DegradedWarning, lambda: warn_degraded.__wrapped__("this", "of a test")),
    "compiler": (NoCompilerWarning, lambda: warn_no_compiler.__wrapped__()),
}


@pytest.mark.parametrize(("category", "call"), CASES.values(), ids=list(CASES))
def test_the_line_of_the_caller_is_named(category: type[Warning], call: Callable[[], Any]) -> None:
    with pytest.warns(category) as caught:
        call()
    place = next(each for each in caught if each.category is category)
    assert place.filename == __file__
    assert place.lineno == inspect.getsourcelines(call)[1]


def test_no_module_warns_past_the_door() -> None:
    for path in PACKAGE.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        assert path.name == "door.py" or not re.search(r"warnings\.warn|stacklevel", text), path
