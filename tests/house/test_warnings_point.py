"""A warning points at the line of the caller's that caused it, whatever lies between; no module of ours warns in another way."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.door import on_behalf, warn_caller
from lie_codegen.errors import (
    AssumptionWarning,
    DegradedWarning,
    InertiaWarning,
    NoCompilerWarning,
    SlowWarning,
    SpreadWarning,
)
from lie_codegen.groups.group_library import GroupLibrary
from lie_codegen.runtime.compiler import warn_no_compiler
from lie_codegen.runtime.degraded import warn_degraded
from lie_codegen.runtime.threads import interruptible

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


def _pool_of_ours(warn: Callable[[], None]) -> None:
    with ThreadPoolExecutor(1) as pool:
        pool.submit(on_behalf(warn)).result()


def _threads_in_a_thread(warn: Callable[[], None]) -> None:
    _pool_of_ours(partial(_pool_of_ours, warn))


def _compiled_of_a_group(warn: Callable[[], None]) -> None:
    library = lc.build("so3")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(GroupLibrary, "__getattr__", lambda library, name: warn())
        library.compile(["exp"])


THREADS = {
    "call": lambda warn: interruptible(warn),
    "pool": lambda warn: _pool_of_ours(warn),
    "nested": lambda warn: _threads_in_a_thread(warn),
    "group": lambda warn: _compiled_of_a_group(warn),
}


@pytest.mark.parametrize("call", THREADS.values(), ids=list(THREADS))
def test_a_thread_of_ours_names_the_line_that_started_it(call: Callable[[Callable[[], None]], None]) -> None:
    """No frame of such a thread is the user's: without the line that is carried there the warning named threading.py."""
    with pytest.warns(DegradedWarning) as caught:
        call(partial(warn_caller, "slower", DegradedWarning))
    assert {each.filename for each in caught if each.category is DegradedWarning} == {__file__}


def test_no_module_warns_past_the_door() -> None:
    for path in PACKAGE.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        assert path.name == "door.py" or not re.search(r"warnings\.warn|stacklevel", text), path
