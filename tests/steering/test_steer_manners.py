"""What lc.steer refuses before it does anything, and how groups may be named."""

from __future__ import annotations

import io
import sys
import time
from typing import Any

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.runtime import patience
from lie_codegen.steering.choice import asks_direct
from lie_codegen.steering.methods import OPEN_LOOP, solver_of

TASK = ("so3", [0.1, 0.2, 0.3], ("w1", "w2"), 1.0)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"bounds": -0.6}, "positive number"),
        ({"bounds": (0.5, -0.5)}, "not below"),
        ({"bounds": {"w1": (1, -1)}}, "not below"),
        ({"intervals": 2.5}, "whole number"),
        ({"starts": True}, "whole number"),
        ({"rest": "no"}, "True or False"),
        ({"solver": 3}, "is a text"),
        ({"method": "transcription", "drift": lambda t: [0, 0, 0]}, "constant drift"),
        ({"obstacles": lc.Cone((0, 0, 1), (1, 0, 0), 0.3)}, r"obstacles=\[Cone"),
        ({"longest": 2}, 'longest is the longest duration of objective="time"'),
        ({"objective": "energy", "vertices": [(1, 1)]}, "vertices is"),
        ({"method": "transcription", "classes": 2}, "classes is the number of ways between"),
        ({"objective": "time", "bounds": 1, "pieces": 8, "polish": True}, "pieces, polish has no effect on least time"),
        ({"bounds": 1, "objective": "fuel", "spread": [{"gain": 1.1}]}, "objective has no effect beside spread="),
    ],
)
def test_options_of_the_wrong_kind_or_without_effect_are_named(options: dict[str, object], words: str) -> None:
    with pytest.raises(lc.errors.SteeringInputError, match=words):
        lc.steer(*TASK, **options)  # type: ignore[arg-type]


def test_a_guess_of_least_time_is_followed() -> None:
    """By the transcription: arcs of least time start from words."""
    guess = lc.steer(*TASK)
    plan = lc.steer(*TASK, objective="time", bounds=1, guess=guess, intervals=12, starts=1)
    assert plan.method == "transcription"
    assert plan.error < 1e-6
    with pytest.raises(lc.errors.SteeringInputError, match="follows a guess"):
        lc.steer(*TASK, method="direct", objective="time", bounds=1, guess=guess)


def test_a_law_is_a_kernel() -> None:
    with pytest.raises(lc.errors.InputError, match="law is a Kernel"):
        lc.closed_loop("so3", inertia=[1, 2, 3], law=[1], t=[0, 1])  # type: ignore[arg-type]


def test_a_picture_has_the_ending_of_one() -> None:
    with pytest.raises(lc.errors.InputError, match="ends in"):
        lc.plot_plan(lc.steer(*TASK), "plan.xyz")


def test_a_name_does_what_the_group_does() -> None:
    so3 = lc.group("so3")
    t = np.linspace(0, 1, 3)
    assert lc.controllability("SO(3)", ("w1", "w2")) == lc.controllability(so3, ("w1", "w2"))
    np.testing.assert_array_equal(lc.simulate("so3", [1, 0, 0], t=t).X, lc.simulate(so3, [1, 0, 0], t=t).X)
    assert lc.tracking_law("so3", inertia=[1, 2, 3], error="so3_right", gains={"K_p": 1, "K_d": 1}) == lc.tracking_law(
        so3, inertia=[1, 2, 3], error="so3_right", gains={"K_p": 1, "K_d": 1}
    )
    assert lc.steer(*TASK).cost == lc.steer(so3, *TASK[1:]).cost


def test_long_work_says_so_where_somebody_watches(monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    seen = Terminal()
    monkeypatch.setattr(sys, "stderr", seen)
    monkeypatch.setattr(patience, "_FIRST", 0.01)
    patience.shows_progress(lambda: time.sleep(0.2))()
    assert "0 s" in seen.getvalue()
    assert seen.getvalue().endswith("\r")


@pytest.mark.parametrize("torques", [False, True])
@pytest.mark.parametrize(
    "option", [{"rest": True}, {"via": [(0.5, (0.1, 0.1, 0.3))]}, {"periodic": True}, {"velocity_bounds": 0.9}]
)
def test_what_direct_has_not_is_refused_with_the_method_that_has_it_and_auto_asks_that(
    option: dict[str, Any], torques: bool
) -> None:
    asked = {"bounds": 2.0, **({"dynamics": "second_order", "inertia": (1.0, 2.0, 3.0)} if torques else {}), **option}
    controls, (name,) = ("w1", "w2", "w3"), option
    with pytest.raises(lc.errors.SteeringInputError, match=f'"transcription" takes {name}, as method="auto" does here'):
        lc.steer("so3", (0.1, 0.2, 0.3), controls, 3.0, "direct", **asked)
    assert not asks_direct("auto", np.eye(3), controls, asked)
    assert solver_of(OPEN_LOOP, "auto", asked) is OPEN_LOOP["transcription"]
    with pytest.raises(lc.errors.SteeringInputError, match=f'"transcription" takes {name}, without seed'):
        lc.steer("so3", (0.1, 0.2, 0.3), controls, 3.0, "direct", **asked, seed=3)
