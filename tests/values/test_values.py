"""The base of results: equality is one bool, hash agrees, repr is short, pickle holds the fields alone."""

from __future__ import annotations

import copy
import pickle
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import pytest

from lie_codegen.values import Value, brief, contents, same


@dataclass(frozen=True, eq=False, repr=False)
class Run(Value):
    t: Any
    table: Any
    note: str = ""
    seconds: float = field(default=0.0, compare=False)

    @cached_property
    def squares(self) -> Any:
        return self.t**2


def run(**changes: Any) -> Run:
    return replace(Run(np.arange(4.0), {"a": np.array([np.nan, 0.0]), "b": (1, [2.0])}), **changes)


def test_equality_is_one_bool_by_value() -> None:
    assert (run() == run()) is True
    assert (run(seconds=3.0) == run()) is True
    assert (run(t=np.arange(5.0)) == run()) is False
    assert (run(table={"a": np.array([np.nan, 1.0]), "b": (1, [2.0])}) == run()) is False
    assert (run() == 3) is False
    assert (run() != run(note="x")) is True


def test_equal_values_hash_alike() -> None:
    assert hash(run()) == hash(run(seconds=1.0))
    minus = run(table={"a": np.array([float("nan"), -0.0]), "b": (1, [2.0])})
    assert minus == run()
    assert hash(minus) == hash(run())


@pytest.mark.parametrize(
    ("a", "b", "equal"),
    [
        (np.array([1, 2]), np.array([1.0, 2.0]), False),
        (np.zeros((0, 3)), np.zeros((0, 2)), False),
        (float("nan"), np.float64("nan"), True),
        (complex("nan"), float("nan"), True),
        (np.array(["a"]), np.array(["b"]), False),
        (np.array([1.0]), np.array(["b"]), False),
        ((1, 2), [1, 2], False),
        ({"a": 1}, {"a": 1, "b": 2}, False),
        (None, None, True),
        (None, 0.0, False),
    ],
)
def test_plain_values(a: Any, b: Any, equal: bool) -> None:
    assert same(a, b) is equal
    assert same(b, a) is equal


def test_the_cache_stays_at_home() -> None:
    value = run()
    assert np.array_equal(value.squares, value.t**2)
    assert "squares" in vars(value)
    for other in (pickle.loads(pickle.dumps(value)), copy.copy(value), copy.deepcopy(value), replace(value)):
        assert other == value
        assert "squares" not in vars(other)
        assert np.array_equal(other.squares, value.squares)


def test_a_repr_is_short_and_shows_no_entries() -> None:
    text = repr(run(t=np.linspace(0, 1, 1000), note="x" * 1000))
    assert "1000" in text
    assert "0.001" not in text
    assert len(text.splitlines()) <= 10
    assert max(map(len, text.splitlines())) <= 140
    many = [np.arange(100.0)] * 100
    assert len(brief(many)) < 500
    assert "\n" not in brief({"a": many, "b": np.eye(9)})


def test_contents_are_a_key_and_change_with_an_array_that_is_changed_in_place() -> None:
    one, other = run(), run()
    before = contents(one)
    assert hash(before) == hash(contents(other))
    assert before == contents(other)
    one.t[1] = 7.0
    assert contents(one) != before
    assert contents(run(t=np.arange(4))) != before  # integers
    assert contents(run(note="b")) != before
    assert len({contents(each) for each in (0, False, 0.0, -0.0, 0j, complex(0.0, -0.0), "", "0.0", None)}) == 9


@pytest.mark.parametrize("held", [lambda: 1, object(), {1, 2}, np.zeros(5000), np.array([None])])
def test_what_may_change_unseen_has_no_contents(held: Any) -> None:
    with pytest.raises(TypeError):
        contents(run(t=held))
