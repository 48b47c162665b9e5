"""What the hunt found and was mended: over-budget requests end with a named error in little time of the processor."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import lie_codegen as lc
from lie_codegen.errors import LieCodegenError
from tests.hunt import hostile, plausible

HUGE = 2**63
CALLS: dict[str, Callable[[], Any]] = {
    "levels of brackets": lambda: lc.accessibility_rank("so3", ["1", "2", "3"], [[1, 0, 0]], depth=HUGE),
    "degree of products": lambda: lc.second_order_controllability("so3", ["1", "2", "3"], [[1, 0, 0]], degree=10**5000),
    "derivatives": lambda: lc.direction_observability([1, 2, 3], [0, 0, 1], [1, 2, 3], derivatives=HUGE),
    "a text as a basis": lambda: lc.adaptive_law(
        "so3", error="so3_right", gains={"K_p": [4, 5, 6], "K_d": 4}, basis="9" * 20_000
    ),
    "a period": lambda: lc.floquet(["v", "-x + 0.5*(1 - x^2)*v"], ("x", "v"), (2, 0), period=1e300),
    "steps of a gait": lambda: lc.gait(plausible.BY_NAME["gait"]["connection"](), steps=True),
    "two steps of a gait": lambda: lc.gait(plausible.BY_NAME["gait"]["connection"](), steps=2),
    "coordinates": lambda: lc.manifold(10**5000),
    "a spin": lambda: lc.solve_actual(plausible.PLAUSIBLE["flow"](), HUGE, [0.0, 0.5, 1.0], 0.1),
}


@pytest.mark.parametrize("name", CALLS)
def test_it_is_refused_soon(name: str) -> None:
    with pytest.raises(LieCodegenError):
        hostile.alarmed(4.0, CALLS[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", plausible.BY_NAME)
def test_the_arguments_from_which_the_hunt_departs_are_answered(name: str) -> None:
    """One hostile argument beside another that is refused first would try nothing."""
    function = getattr(lc, name, None) or getattr(lc.studies, name)
    arguments = {each: make() for each, make in plausible.plausible_arguments(function).items()}
    if str(arguments.get("path", "")).startswith("/proc/none"):
        with pytest.raises(LieCodegenError, match="cannot be written"):
            function(**arguments)
    else:
        function(**arguments)
