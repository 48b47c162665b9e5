"""Records that were found once in a process are not looked for again, and those of other sources are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest

from lie_codegen.recent import Recent
from lie_codegen.runtime import cache, records


@dataclass(frozen=True)
class Made:
    number: float


@pytest.fixture
def looked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The keys of records for which a file was looked for, none of which is there."""
    keys: list[str] = []

    def find_note(_folder: Any, key: str) -> None:
        keys.append(key)

    records.package_digest()  # once a process, from a note of its own
    monkeypatch.setattr(cache, "find_note", find_note)
    monkeypatch.setattr(cache, "store_note", lambda *_: None)
    monkeypatch.setattr(records, "_known", Recent(2))
    return keys


def test_a_value_is_made_once_for_its_source(looked: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    made = Made(0.5)
    monkeypatch.setattr(records, "value_of", lambda _: made)
    first = records.recalled("test", ["a", 1], Made, lambda: Made(1.0))
    assert records.recalled("test", ["a", 1], Made, lambda: Made(2.0)) is first
    assert len(looked) == 1
    records.recalled("test", ["a", 1.0], Made, lambda: Made(3.0))  # a float is another source
    records.recalled("other", ["a", 1], Made, lambda: Made(3.0))
    assert len(looked) == 3
    records.recalled("test", ["a", 1], Made, lambda: Made(4.0))  # the oldest went
    assert len(looked) == 4


def test_what_is_no_record_is_looked_for_again(looked: list[str]) -> None:
    assert records.find_record("test", "a") is None
    assert records.find_record("test", "a") is None
    assert len(looked) == 2
