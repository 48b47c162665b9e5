"""Second derivatives of the direct search's C text against second differences of the end, which numpy computes."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg

import lie_codegen as lc
from lie_codegen.codegen.templates import template_folder
from lie_codegen.steering.direct.assemble import constant_pieces, linear_pieces
from lie_codegen.steering.direct.chain import end
from lie_codegen.steering.direct.compiled import CompiledSearch
from lie_codegen.steering.direct.problem import manoeuvre
from lie_codegen.steering.direct.programme import Settings

#: z = second derivatives of <R, L X(u) R'> times d, in the first lane.
_CALLED = r"""
#include "direct_core.c"
void bent(const programme *p, int lanes, double *u, const double *row, const double *d, double *z, double *memory);
void bent(const programme *p, int lanes, double *u, const double *row, const double *d, double *z, double *memory)
{
    task w;
    V rows[ENTRIES];
    int e, c;
    begin(&w, p, lanes, 0, memory);
    read_lanes(&w, u, w.at.u);
    linearise(&w, &w.at);
    for (e = 0; e < ENTRIES; ++e) {
        rows[e] = spread(row[e]);
    }
    for (c = 0; c < w.columns; ++c) {
        w.d[c] = spread(d[c]);
    }
    curvature(&w, rows);
    bend(&w, w.d, w.t);
    for (c = 0; c < w.columns; ++c) {
        z[c] = LANE(w.t[c], 0);
    }
}
"""


def _search(group: lc.MatrixGroup, folder: Path) -> tuple[CompiledSearch, Any]:
    compiler = shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        pytest.skip("no compiler")
    parts = 2 if group.is_complex else 1
    (folder / "direct_sizes.h").write_text(
        f"#define PARTS {parts}\nenum {{ D = {group.degree}, N = {group.dim}, M = 2 }};\n"
    )
    (folder / "called.c").write_text(_CALLED)
    command = (compiler, "-std=c99", "-O1", "-w", "-fPIC", "-shared", f"-I{folder}", f"-I{template_folder()}")
    subprocess.run([*command, str(folder / "called.c"), "-o", str(folder / "called.so"), "-lm"], check=True)
    library = ctypes.CDLL(str(folder / "called.so"))
    function = library["bent"]
    function.argtypes, function.restype = (ctypes.c_void_p, ctypes.c_int, *[ctypes.c_void_p] * 5), None
    search = CompiledSearch(library, group, 2)
    search._functions["bent"] = function
    return search, function


@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("name", ["so3", "se3", "su3"])
def test_second_derivatives_are_those_of_the_end(name: str, linear: bool, tmp_path: Path) -> None:
    """Across pieces and within one, of pieces that turn by about 1 rad."""
    group, rng = lc.group(name), np.random.default_rng(7)
    drift = 0.5 * rng.uniform(-1, 1, group.dim)
    start = scipy.linalg.expm(group.hat(rng.uniform(-1, 1, group.dim)))
    task = manoeuvre(
        group, np.eye(group.degree), list(rng.uniform(-1, 1, (2, group.dim))), 4.0, drift, 9, None, start, "left"
    )
    programme = linear_pieces(task, 4, 0.3) if linear else constant_pieces(task, 4)
    goal = task.goal(np.zeros(1, int))
    search, _ = _search(group, tmp_path)
    shape = (1, *programme.low.shape)
    u, d = rng.uniform(-1, 1, shape), rng.uniform(-1, 1, shape)
    row = rng.uniform(-1, 1, (group.degree, group.degree)).astype(group.basis.dtype)
    if group.is_complex:
        row = row + 1j * rng.uniform(-1, 1, row.shape)
    z = np.empty(u.size)
    search._run("bent", programme, goal, Settings(), u.copy(), row, d.copy(), z)

    def told(at: np.ndarray) -> float:
        return float(np.real(np.vdot(row, goal.left @ end(programme, at)[0] @ goal.right)))

    h = 1e-3
    for place in range(u.size):
        e = h * np.eye(u.size)[place].reshape(shape)
        twice = told(u + h * d + e) - told(u + h * d - e) - told(u - h * d + e) + told(u - h * d - e)
        assert z[place] == pytest.approx(twice / (4 * h * h), abs=2e-5)
