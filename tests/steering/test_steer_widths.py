"""The C searches with vectors of one, two, four and eight doubles: the same plans to rounding, within the memory that they ask for."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.algebra.controllability import require_controllable
from lie_codegen.codegen.templates import template_folder
from lie_codegen.steering.direct.assemble import constant_pieces
from lie_codegen.steering.direct.compiled import CompiledSearch
from lie_codegen.steering.direct.problem import manoeuvre
from lie_codegen.steering.direct.programme import Settings
from lie_codegen.steering.direct.starts import starts
from lie_codegen.steering.shooting.source import render_steering, steering_view

COMPILER = shutil.which("gcc") or shutil.which("clang")
pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler")
WIDTHS = (1, 2, 4, 8)
#: What no search writes; a search that writes past its memory replaces it.
CANARY = 0x5EA1
#: Solves in memory of exactly the size asked for; says whether what lies behind it is as before.
SOLVE_IN = r"""
#include "so3_steer.c"
int guarded(int count, const double *targets, steering_result *results);
int guarded(int count, const double *targets, steering_result *results)
{
    static unsigned char memory[SO3_STEER_WORKSPACE + 64];
    const double weights[M] = {1.0, 1.0};
    const steering_options options = steering_defaults();
    int i, kept = 1;
    memset(memory, 0xA5, sizeof memory);
    steering_solve_in(memory, count, targets, weights, &options, results);
    for (i = 0; i < 64; ++i) {
        kept = kept && memory[SO3_STEER_WORKSPACE + i] == 0xA5;
    }
    return kept;
}
"""


def compiled(folder: Path, source: str, width: int) -> ctypes.CDLL:
    library = folder / f"wide{width}.so"
    options = ["-std=c99", "-O1", "-w", "-fPIC", "-shared", f"-DLIE_CODEGEN_LANES={width}"]
    places = [f"-I{folder}", f"-I{template_folder()}", str(folder / source), "-o", str(library), "-lm"]
    subprocess.run([str(COMPILER), *options, *places], check=True)
    return ctypes.CDLL(str(library))


@pytest.mark.parametrize("count", [1, 3, 11])
def test_shooting_finds_the_same_whatever_the_width(count: int, tmp_path: Path) -> None:
    group = lc.group("so3")
    report = require_controllable(group.algebra, ("w1", "w2"))
    for name, text in render_steering(steering_view(group, report.controls, report.depth)).items():
        (tmp_path / name).write_text(text)
    (tmp_path / "guarded.c").write_text(SOLVE_IN)
    rng = np.random.default_rng(4)
    targets = np.array([expm(group.hat(x)) for x in rng.uniform(-1.5, 1.5, (count, 3))])
    counts = [(name, np.intc) for name in ("status", "starts", "converged", "agreeing", "linearisations")]
    record = np.dtype(
        [("mu0", float, 3), ("cost", float), ("residual", float), ("jacobian", float, (3, 3)), *counts], align=True
    )
    found = []
    for width in WIDTHS:
        results = np.zeros(count, record)
        kept = compiled(tmp_path, "guarded.c", width)["guarded"](
            count, ctypes.c_void_p(targets.ctypes.data), ctypes.c_void_p(results.ctypes.data)
        )
        assert kept, width
        found.append(results)
    assert np.all(found[0]["status"] == 1)
    for other in found[1:]:
        for name, _ in counts:
            np.testing.assert_array_equal(other[name], found[0][name])
        np.testing.assert_allclose(other["cost"], found[0]["cost"], rtol=1e-10)
        np.testing.assert_allclose(other["mu0"], found[0]["mu0"], rtol=0, atol=1e-9)


@pytest.mark.parametrize("fuel", [False, True])
@pytest.mark.parametrize("lanes", [1, 5, 19])
def test_bounded_plans_are_the_same_whatever_the_width(lanes: int, fuel: bool, tmp_path: Path) -> None:
    """Reached, then descended: a group waits for its slowest and forgets those that fall behind, however it is cut into vectors."""
    group = lc.group("su2")
    gate = -1j * np.array([[1, 1], [1, -1]]) / np.sqrt(2)
    bounds = {"sx": 1, "sy": 0.5}
    task = manoeuvre(group, gate, ("sx", "sy"), 6.0, [0, 0, 1], bounds, None, None, "left")
    programme, goal = constant_pieces(task, 20), task.goal(np.zeros(lanes, int))
    (tmp_path / "direct_sizes.h").write_text("#define PARTS 2\nenum { D = 2, N = 3, M = 2 };\n")
    u = starts(task, 20, lanes, 2, 0)
    found = []
    for width in WIDTHS:
        search = CompiledSearch(compiled(tmp_path, str(template_folder() / "direct_core.c"), width), group, 2)
        for name, function in search._functions.items():
            search._functions[name] = guarded(search, function)
        reached = search.reach(programme, goal, u, Settings())
        found.append((reached, search.descend(programme, goal, reached.u, Settings(fuel=fuel))))
    for reached, descended in found[1:]:
        first, cheapest = found[0]
        np.testing.assert_array_equal(reached.used, first.used)
        np.testing.assert_allclose(reached.u, first.u, rtol=0, atol=1e-9)
        np.testing.assert_array_equal(descended.used, cheapest.used)
        np.testing.assert_allclose(descended.cost, cheapest.cost, rtol=1e-9)


def guarded(search: CompiledSearch, function: Any) -> Any:
    """The function, with a number behind the memory that it is lent."""

    def run(programme: int, *others: int) -> None:
        behind = ctypes.c_double.from_address(others[-1] + 8 * search._memory(programme))
        behind.value = CANARY
        function(programme, *others)
        assert behind.value == CANARY

    return run
