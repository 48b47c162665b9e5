"""Kernels and groups from their records in the cache are those that were made: equal, with the same values, warnings and refusals."""

from __future__ import annotations

import json
import pickle
import random
from pathlib import Path

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.errors import InertiaWarning, InputError
from lie_codegen.groups.catalogue_names import definition_source
from lie_codegen.groups.families import family
from lie_codegen.groups.group_file import parse_group_file
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.numpy_arithmetic import NumpyArithmetic
from lie_codegen.runtime import recorded_kernels

LAWS = {
    "pd": lambda: lc.attitude_law("pd", inertia=(1, 2, "5/2"), k_p=0.1, k_d="sqrt(2)"),
    "hybrid": lambda: lc.hybrid_law(inertia=(1, 2, 3), K_p=(4, 5, 6), K_d=6),
}


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LIE_CODEGEN_CACHE", str(tmp_path / "cache"))


@pytest.mark.parametrize("name", LAWS)
def test_a_recorded_law_is_the_law(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    first = LAWS[name]()
    made: list[object] = []
    monkeypatch.setattr(recorded_kernels, "store_record", lambda *each: made.append(each))
    second = LAWS[name]()
    assert not made, "it was derived again"
    assert first == second
    assert hash(first) == hash(second)
    assert repr(first) == repr(second)
    assert pickle.loads(pickle.dumps(second)) == first
    given = first.sample(random.Random(3))
    assert second.sample(random.Random(3)) == given
    ops = NumpyArithmetic()
    for a, b in zip(first.evaluate(ops, *given), second.evaluate(ops, *given), strict=True):
        np.testing.assert_array_equal(a, b)


def test_what_was_warned_of_is_warned_of_again() -> None:
    for _ in range(2):
        with pytest.warns(InertiaWarning):
            lc.attitude_law("pd", inertia=(6, 3, 1), k_p=1, k_d=1)


def test_a_damaged_record_is_made_again(tmp_path: Path) -> None:
    law = LAWS["pd"]()
    for file in (tmp_path / "cache").rglob("*.json"):
        file.write_text(json.dumps({"class": ["os", "system"], "name": 3}))
    assert LAWS["pd"]() == law


def test_a_number_of_a_huge_exponent_is_refused_before_it_fills_the_memory() -> None:
    with pytest.raises(InputError):
        lc.attitude_law("pd", inertia=(1, 2, 2), k_p="1e9999999999", k_d=1)


@pytest.mark.parametrize("name", ["se3", "su3", "sl4", "h3"])
def test_a_recorded_group_is_the_group(name: str) -> None:
    source = definition_source(name)
    made = family(name) if source.startswith(b"family") else parse_group_file(source, name)
    again = MatrixGroup.recorded(json.loads(json.dumps(made.record)))
    assert made == again
    assert hash(made) == hash(again)
    assert again.definition_text == made.definition_text
    assert again.description == made.description
    np.testing.assert_array_equal(again.basis, made.basis)
    np.testing.assert_array_equal(again.algebra.structure_constants, made.algebra.structure_constants)
    assert hash(again.algebra) == hash(made.algebra)
    assert again.algebra == made.algebra
    assert again.exact_basis == made.exact_basis
    assert pickle.loads(pickle.dumps(again)) == made
    assert repr(again) == repr(made)
    with pytest.raises(AttributeError):
        again.basos  # noqa: B018
