"""A few samples are calls: to the last bit, and without the compilation of lanes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import toy_kernels

from lie_codegen.errors import ShapeError
from lie_codegen.runtime import rows
from lie_codegen.runtime.build import build_kernels
from lie_codegen.runtime.compiler import find_compilers
from lie_codegen.runtime.library import Library
from lie_codegen.runtime.rows import row_by_row


@pytest.fixture
def lib(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Library:
    """In a cache in which nothing has been compiled yet."""
    monkeypatch.setenv("LIE_CODEGEN_CACHE", str(tmp_path))
    return build_kernels(lambda: [toy_kernels.RATE, toy_kernels.EXP, toy_kernels.TURN])


def test_they_are_calls_and_compile_nothing(lib: Library, compiles: list[str]) -> None:
    rng = np.random.default_rng(0)
    for function in (lib.rate, lib.exp, lib.turn):
        arrays = [rng.uniform(0.1, 1, (9, *port.shape)) for port in function.inputs]
        made = row_by_row(function, *arrays)
        for k in range(9):
            one = function(*(each[k] for each in arrays))
            for each, expected in zip(made, one if isinstance(one, tuple) else (one,), strict=True):
                np.testing.assert_array_equal(each[k], expected)
    assert not compiles
    if find_compilers():
        lib.exp.batch(np.zeros((2, 3)))
        assert len(compiles) == 1  # what a batch compiles is seen here


def test_an_input_may_be_the_same_for_all_and_many_are_a_batch(lib: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(1)
    first, *rest = [rng.uniform(0.1, 1, (5, *port.shape)) for port in lib.rate.inputs]
    given = {port.name: each[0] for port, each in zip(lib.rate.inputs[1:], rest, strict=True)}
    few = row_by_row(lib.rate, first, **given)
    monkeypatch.setattr(rows, "FEW", 4)
    many = row_by_row(lib.rate, first, **given)
    assert [each.shape for each in few] == [(5, *port.shape) for port in lib.rate.outputs]
    for a, b in zip(few, many, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-14)
    with pytest.raises(ShapeError, match="no input has a leading axis"):
        row_by_row(lib.exp, np.zeros(3))
