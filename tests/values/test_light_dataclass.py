"""Light dataclasses against those of dataclasses: the same class, made by both, does the same."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import pickle
from collections.abc import Callable
from dataclasses import dataclass as heavy
from dataclasses import field
from typing import Any

import numpy as np
import pytest

from lie_codegen.light_dataclass import dataclass as light


def point(make: Callable[..., Any]) -> Any:
    @make(frozen=True)
    class Point:
        """A place."""

        x: float
        y: float = 2.0
        names: list[str] = field(default_factory=list)
        hidden: int = field(default=7, repr=False, compare=False)
        later: float = field(init=False, default=0.0)
        unit: str = field(kw_only=True, default="m")

        def __post_init__(self) -> None:
            object.__setattr__(self, "later", self.x + self.y)

    return Point


def empty(make: Callable[..., Any]) -> Any:
    @make(frozen=True)
    class Empty:
        pass

    return Empty


def open_to_change(make: Callable[..., Any]) -> Any:
    @make
    class Open:
        x: int
        y: int = 1

        def __repr__(self) -> str:
            return "mine"

    return Open


def by_identity(make: Callable[..., Any]) -> Any:
    @make(frozen=True, eq=False)
    class Identity:
        x: int

    return Identity


KINDS = [point, empty, open_to_change, by_identity]
ARGUMENTS: list[tuple[tuple[Any, ...], dict[str, Any]]] = [
    ((), {}), ((1.0,), {}), ((1.0, 3.0), {}), ((1.0,), {"y": 5.0}), ((), {"x": 1.0}), ((1.0,), {"x": 1.0}), ((1.0,), {"z": 1.0}),
    ((1.0, 2.0, ["a"], 8), {}), ((1.0, 2.0, ["a"], 8, 9), {}), ((1.0, 2.0, ["a"], 8, 9, 10), {}), ((1.0,), {"unit": "km"}),
    ((1.0,), {"later": 1.0}), ((1.0, 2.0), {"names": [], "hidden": 1, "unit": "mm"}), ((), {"unit": "m", "y": 1.0, "x": 2.0}),
]  # fmt: skip


def made(kind: Any, given: tuple[tuple[Any, ...], dict[str, Any]]) -> Any:
    try:
        return kind(*copy.deepcopy(given[0]), **copy.deepcopy(given[1]))
    except TypeError:
        return TypeError


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_arguments_make_the_same_values_or_are_refused(kind: Any) -> None:
    new, old = kind(light), kind(heavy)
    accepted = 0
    for given in ARGUMENTS:
        mine, theirs = made(new, given), made(old, given)
        assert (mine is TypeError) == (theirs is TypeError), given
        if mine is not TypeError:
            accepted += 1
            assert list(vars(mine).items()) == list(vars(theirs).items())
            # The qualified name of a class within a function has the function's in it, the same for both.
            assert repr(mine) == repr(theirs) or kind is not point
            assert (mine == made(new, given)) == (theirs == made(old, given))
    assert accepted


@pytest.mark.parametrize("kind", KINDS)
def test_they_look_the_same(kind: Any) -> None:
    new: Any = kind(light)
    old: Any = kind(heavy)
    assert [(each.name, each.init, each.kw_only) for each in dataclasses.fields(new)] == [
        (each.name, each.init, each.kw_only) for each in dataclasses.fields(old)
    ]
    assert new.__match_args__ == old.__match_args__
    mine, theirs = inspect.signature(new), inspect.signature(old)
    assert [(p.name, p.kind, p.annotation, p.default is p.empty) for p in mine.parameters.values()] == [
        (p.name, p.kind, p.annotation, p.default is p.empty) for p in theirs.parameters.values()
    ]
    assert (new.__hash__ is None) == (old.__hash__ is None)
    assert (new.__eq__ is object.__eq__) == (old.__eq__ is object.__eq__)


@pytest.mark.parametrize("kind", [point, by_identity])
def test_a_frozen_one_refuses_to_change(kind: Any) -> None:
    value = kind(light)(1.0)
    with pytest.raises(dataclasses.FrozenInstanceError, match="x"):
        value.x = 2.0
    with pytest.raises(dataclasses.FrozenInstanceError, match="x"):
        del value.x


def test_values_compare_hash_and_replace_by_their_fields() -> None:
    kind = point(light)
    a, b = kind(1.0, names=()), kind(1.0, names=(), hidden=8)
    assert a == b
    assert hash(a) == hash(b)
    assert a != kind(2.0, names=())
    assert a != (1.0, 2.0)
    assert dataclasses.replace(a, x=4.0).later == 6.0
    assert dataclasses.asdict(a)["y"] == 2.0
    assert kind(np.nan).names is not kind(np.nan).names


@light(frozen=True)
class Root:
    """A class that others inherit from."""

    x: int


@heavy(frozen=True)
class Theirs(Root):
    y: int = 2


@light(frozen=True)
class Ours(Root):
    y: int = 2


class Plain(Root):
    pass


@pytest.mark.parametrize("kind", [Theirs, Ours])
def test_a_dataclass_may_inherit_from_one(kind: Any) -> None:
    assert kind(1, 3) == kind(x=1, y=3)
    assert [each.name for each in dataclasses.fields(kind)] == ["x", "y"]
    with pytest.raises(dataclasses.FrozenInstanceError):
        kind(1).y = 3


def test_a_plain_class_may_inherit_too_and_all_are_pickled_and_matched() -> None:
    assert Plain(1) == Plain(1)
    assert Plain(1) != Root(1)
    assert pickle.loads(pickle.dumps(Root(5))) == Root(5)
    match Root(6):
        case Root(x):
            assert x == 6
