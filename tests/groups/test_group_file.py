"""Group files: what they may hold, and errors that name file, key and column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lie_codegen as lc
from lie_codegen.errors import (
    AlgebraError,
    DependentBasisError,
    ExpressionError,
    GroupFileError,
    IdentifierError,
    InputError,
    JacobiError,
    LieCodegenError,
    NotClosedError,
    ShapeError,
)
from lie_codegen.groups.group_file import group_from_table, parse_group_file
from lie_codegen.groups.matrix_group import MatrixGroup

OSC4 = """
name = "mine"
description = "oscillator"
source = "a book"
labels = ["J", "P", "Q", "Z"]
units = ["rad", "m", "m", "m^2"]
[brackets]
"J,P" = { Q = 1 }
"J, Q" = { P = "-1" }
"P,Q" = { Z = 1.0 }
[metadata]
author = "me"
"""
HEAD = 'name = "g"\nlabels = ["a", "b"]\n'


def parse(text: str) -> object:
    return parse_group_file(text.encode(), "g.toml")


def test_brackets_units_and_metadata(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(OSC4)
    group = lc.group(path)
    assert (group.name, group.dim, group.units[3], group.description) == ("mine", 4, "m^2", "oscillator")
    assert group.algebra.table == lc.group("osc4").algebra.table
    assert lc.group(str(path)) is group


def test_units_may_be_a_table_and_numbers_decimal_fractions() -> None:
    text = 'name="g"\nlabels=["a"]\nunits={a="rad"}\n[matrices]\na=[[0, 0.25], ["sqrt(3)/2", "1e-3"]]\n'
    group = parse(text)
    assert group.units == ("rad",)
    np.testing.assert_allclose(group.basis[0], [[0, 0.25], [np.sqrt(3) / 2, 1e-3]])
    assert str(group.exact_basis[0][1, 1]) == "1/1000"


M = "[matrices]\n"
ONE = 'name="g"\nlabels=["a"]\n'


@pytest.mark.parametrize(
    ("text", "error", "parts"),
    [
        ("name = ", GroupFileError, ["g.toml", "not a TOML"]),
        ('labels=["a"]\n[brackets]\n', GroupFileError, ["'name' is missing"]),
        ('name="g"\n[brackets]\n', GroupFileError, ["'labels' is missing"]),
        (HEAD, GroupFileError, ["either [matrices] or [brackets]"]),
        (HEAD + "[brackets]\n[matrices]\na=[[0]]\n", GroupFileError, ["exactly one"]),
        ("color=1\n" + HEAD + "[brackets]\n", GroupFileError, ["unknown key 'color'", "known keys"]),
        ('name=3\nlabels=["a"]\n[brackets]\n', GroupFileError, ["'name' must be a text"]),
        ('name="g"\nlabels="ab"\n[brackets]\n', GroupFileError, ["'labels'", "list of texts"]),
        ('name="g"\nlabels=[]\n[brackets]\n', GroupFileError, ["'labels'"]),
        ('name="g"\nlabels=["a"]\nunits=["m","s"]\n[brackets]\n', GroupFileError, ["'units'", "1 texts"]),
        ('name="g"\nlabels=["a"]\nunits={q="m"}\n[brackets]\n', GroupFileError, ["'q' is not one of"]),
        ('name="g"\nlabels=["a"]\nmetadata=3\n[brackets]\n', GroupFileError, ["'metadata'"]),
        ('name="g"\nlabels=["a"]\nbrackets=3\n', GroupFileError, ["'brackets' must be a table"]),
        ('name="g"\nlabels=["a"]\nmatrices=3\n', GroupFileError, ["'matrices' must be a table"]),
        (HEAD + M + "a=[[0]]\n", GroupFileError, ["'matrices.b' is missing"]),
        (HEAD + M + "a=[[0]]\nc=[[0]]\n", GroupFileError, ["'c' is not one of the labels"]),
        (ONE + M + "a=[[0,1],[1]]\n", ShapeError, ["matrices.a", "row 2 has 1 entries", "ragged"]),
        (ONE + M + "a=7\n", GroupFileError, ["matrices.a", "list of rows"]),
        (ONE + M + 'a=[["1/0"]]\n', GroupFileError, ["matrices.a[1][1]", "column 3", "division by zero"]),
        (ONE + M + 'a=[[0,"1+"],[0,0]]\n', GroupFileError, ["matrices.a[1][2]", "ends too soon"]),
        (ONE + M + 'a=[["x"]]\n', GroupFileError, ["matrices.a[1][1]", "no name 'x'", "column 1"]),
        (ONE + M + "a=[[true]]\n", GroupFileError, ["matrices.a[1][1]", "not a number"]),
        (ONE + M + "a=[[nan]]\n", GroupFileError, ["matrices.a[1][1]", "not finite"]),
        (ONE + M + "a=[[inf]]\n", GroupFileError, ["not finite"]),
        (ONE + M + "a=[[1979-05-27]]\n", GroupFileError, ["not a number"]),
        (HEAD + '[brackets]\n"a"={b=1}\n', GroupFileError, ["must name two labels"]),
        (HEAD + '[brackets]\n"a,q"={b=1}\n', GroupFileError, ["'q' is not one of the labels"]),
        (HEAD + '[brackets]\n"a,b"=1\n', GroupFileError, ["table of label = coefficient"]),
        (HEAD + '[brackets]\n"a,b"={b=1}\n"a, b"={b=1}\n', GroupFileError, ["given twice"]),
        (HEAD + '[brackets]\n"a,a"={b=1}\n', AlgebraError, ["g.toml", "must be 0"]),
        ('name="for"\nlabels=["a"]\n[brackets]\n', IdentifierError, ["g.toml", "keyword"]),
        ('name="g"\nlabels=["a-b"]\n[brackets]\n', IdentifierError, ["a-b"]),
        (HEAD + M + "a=[[0,1],[0,0]]\nb=[[0,2],[0,0]]\n", DependentBasisError, ["g.toml", "drop one"]),
        (HEAD + M + "a=[[0,1],[0,0]]\nb=[[0,0],[1,0]]\n", NotClosedError, ["[a, b]", "missing direction"]),
        (
            'name="g"\nlabels=["x","y","z"]\n[brackets]\n"x,y"={x=1}\n"y,z"={z=1}\n"x,z"={z=1}\n',
            JacobiError,
            ["g.toml", "(x, y, z)"],
        ),
    ],
)
def test_errors_name_file_key_and_column(text: str, error: type[Exception], parts: list[str]) -> None:
    with pytest.raises(error) as caught:
        parse(text)
    assert isinstance(caught.value, InputError)
    for part in parts:
        assert part in str(caught.value)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(GroupFileError, match="cannot be read"):
        lc.group(tmp_path / "absent.toml")
    (tmp_path / "folder.toml").mkdir()
    with pytest.raises(GroupFileError, match="cannot be read"):
        lc.group(tmp_path / "folder.toml")
    with pytest.raises(GroupFileError, match="at most"):
        parse_group_file(b"#" * 1_000_001, "big.toml")
    with pytest.raises(GroupFileError, match="not a TOML"):
        parse_group_file(b"\xff\xfe", "binary.toml")
    with pytest.raises(GroupFileError, match="not a TOML"):
        parse_group_file(b"a = " + b"[" * 100_000, "deep.toml")


VALUES = st.recursive(
    st.one_of(st.integers(-3, 3), st.text(max_size=6), st.booleans(), st.floats(), st.none()),
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=4), inner, max_size=3)),
    max_leaves=8,
)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.dictionaries(st.sampled_from(["name", "labels", "units", "matrices", "brackets", "metadata", "x"]), VALUES))
def test_any_table_is_a_group_or_a_named_error(table: dict) -> None:
    found = table_or_error(table)
    assert isinstance(found, MatrixGroup) or "fuzz.toml" in str(found)


def table_or_error(table: dict) -> MatrixGroup | LieCodegenError:
    try:
        return group_from_table(table, "fuzz.toml")
    except LieCodegenError as error:
        return error


@settings(max_examples=100, deadline=None, derandomize=True)
@given(st.text(alphabet='ab01="[]{},.\n -/sqrt()i', max_size=120))
def test_any_text_is_a_group_or_a_named_error(text: str) -> None:
    with pytest.raises((GroupFileError, ExpressionError, InputError)):
        parse(text)
