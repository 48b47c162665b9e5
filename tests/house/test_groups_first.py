"""Every public function that takes a group takes it first, as an object, a catalogue name or a file alike."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from importlib.resources import files
from typing import Any

import pytest

import lie_codegen as lc
from lie_codegen.errors import UnknownGroupError

#: Where the group is not first: what comes before it is what the function is about, and knows its group unless it was written by hand.
ABOUT_ANOTHER_THING = {
    "critical_points": "an error function",
    "gradient": "a kernel",
    "hessian": "a kernel",
    "jacobian": "a kernel",
    "transition_step": "a kernel",
    "read_law": "a file",
    "tangent_from": "an array",
    "tangent_to": "an array",
    "view": "a result",
    "widget": "a result",
}
#: Another argument is looked at first, whatever the group is.
OTHERS_FIRST = ("closed_loop", "gradient", "loop_margins", "read_law", "widget")
NAME = "sl2"
#: One of several ways to say the rest must be taken.
NEEDS_MORE = ("certificate", "observer", "reference", "simulate")


def parameters(function: Callable[..., Any]) -> list[inspect.Parameter]:
    return list(inspect.signature(function).parameters.values())


def taking_groups() -> list[str]:
    functions = (name for name in dir(lc) if inspect.isfunction(getattr(lc, name)))
    return [name for name in functions if "group" in inspect.signature(getattr(lc, name)).parameters]


def test_there_are_many() -> None:
    assert len(taking_groups()) > 60


@pytest.mark.parametrize("name", taking_groups())
def test_the_group_comes_first(name: str) -> None:
    first = parameters(getattr(lc, name))[0]
    assert (first.name == "group") is (name not in ABOUT_ANOTHER_THING)
    if name not in ABOUT_ANOTHER_THING:
        assert first.kind is inspect.Parameter.POSITIONAL_OR_KEYWORD


@pytest.mark.parametrize("name", taking_groups())
def test_a_name_is_looked_up(name: str) -> None:
    function = getattr(lc, name)
    if name in OTHERS_FIRST:
        return
    needed = {each.name: None for each in parameters(function) if each.default is each.empty}
    with pytest.raises(UnknownGroupError, match="no group 'no_such_group'"):
        function(**{**needed, "group": "no_such_group"})


def of_a_group_alone() -> list[str]:
    def needs(name: str) -> list[str]:
        return [each.name for each in parameters(getattr(lc, name)) if each.default is each.empty]

    return [name for name in taking_groups() if needs(name) == ["group"] and name not in NEEDS_MORE]


@pytest.mark.parametrize("name", of_a_group_alone())
def test_object_name_and_file_are_alike(name: str) -> None:
    function = getattr(lc, name)
    file = files("lie_codegen") / "groups" / "catalogue" / f"{NAME}.toml"
    group = lc.group(NAME)
    made = [function(each) for each in (group, NAME, str(file))]
    assert made[0] == made[1] == made[2]
