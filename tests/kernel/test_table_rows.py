"""Rows found by time: in a table as by choices, in every arithmetic and in C, at the times where rows change and beyond all of them."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.kernel.arithmetic import Arithmetic, FloatArithmetic
from lie_codegen.kernel.casadi_arithmetic import function_of
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.table_rows import TimeTable

RNG = np.random.default_rng(4)
BEGINS = np.concatenate([[0.0], np.cumsum(RNG.uniform(0.01, 1, 39))])
ROWS = np.column_stack([BEGINS, RNG.normal(size=(40, 3)), np.ones(40)])
TIMES = [-1.0, *BEGINS, *(BEGINS + 1e-9), *RNG.uniform(0, 25, 50), 1e9]


def kernel(count: int = 40) -> Kernel:
    table = TimeTable(BEGINS[:count], ROWS[:count])

    def body(ops: Arithmetic, t: Any) -> tuple[Any, ...]:
        begin, *row = table.at(ops, t)
        return ([*row, (t - begin) * row[0]],)

    return Kernel("row", "table", (Port("t", ()),), (Port("x", (5,)),), body, sampler=lambda rng: (rng.uniform(0, 20),))


def expected(t: float, count: int = 40) -> np.ndarray:
    row = ROWS[max([0, *(k for k in range(count) if BEGINS[k] < t)])]
    return np.array([*row[1:], (t - row[0]) * row[1]])


@pytest.mark.parametrize("count", [3, 12, 13, 40])
def test_all_ways_find_the_same_row(count: int) -> None:
    made = kernel(count)
    compiled, function = lc.build([made]).row, function_of(made)
    batch = compiled.batch(np.array(TIMES))
    for t, many in zip(TIMES, batch, strict=True):
        wanted = expected(t, count)
        (plain,) = made.evaluate(FloatArithmetic(), t)
        for found in (plain, compiled(t), many, np.array(function(t)).ravel()):
            np.testing.assert_allclose(np.array(found, dtype=float), wanted, rtol=1e-14, atol=0)


def test_rows_have_no_rate() -> None:
    made = kernel()
    slope = lc.build([lc.jacobian(made, "t")])
    name = slope.kernels[0]
    for t in (3.3, 7.7, 12.1):
        row = expected(t)
        np.testing.assert_allclose(
            np.asarray(getattr(slope, name)(t)).ravel(), [0, 0, 0, 0, row[0]], rtol=1e-14, atol=0
        )


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
@pytest.mark.parametrize("real", ["double", "float"])
def test_packages_hold_the_table(real: str, tmp_path: Path) -> None:
    folder = lc.generate([kernel()], tmp_path / "package", real=real)
    strict = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-Wshadow"]
    subprocess.run(
        ["gcc", *strict, "-Iinclude", "example.c", "src/table.c", "-lm", "-o", "run"], cwd=folder, check=True
    )
    subprocess.run(["./run"], cwd=folder, check=True)
