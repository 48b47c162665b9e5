"""The generated solver as C: strict compilation, sanitizers, one core for all, no allocation."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from ocp_systems import car, planar, quadrotor, satellite

import lie_codegen as lc
from lie_codegen.steering.ocp.source import CORE, render_solver, solver_view

STRICT = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror")
COMPILER = shutil.which("gcc") or shutil.which("cc")

DRIVER = """
#include "{name}.h"
#include <stdio.h>
static {name}_workspace w;
int main(void)
{{
    static const {real} p[] = {{ {parameters} }};
    {real} X[16] = {{0}}, z[16] = {{0}}, u[8];
    int i, status;
    for (i = 0; i < {degree}; ++i) X[i * {degree} + i] = 1;
    for (i = 0; i < {stored}; ++i) w.x[0][i] = ({real})((int[]){{ {first} }})[i];
    w.rho = 10;
    w.curvature = 1;
    {name}_first_guess(&w, p, 0);
    status = {name}_solve(&w, p, 0, 0, ({real}){tolerance}, ({real}){allowed}, 25, 300);
    printf("%d %.12f %.3e %d\\n", status, (double)w.cost, (double)w.violation, (int)sizeof w);
    {name}_gains(&w, p, 0, 0);
    w.rho = 300;
    w.fresh = 1;
    for (i = 0; i < 5; ++i) status = {name}_step(&w, X, z, p, 0, 0, 1, u);
    z[0] /= 0 * z[0];
    status += {name}_step(&w, X, z, p, 0, 0, 1, u);
    return status;
}}
"""


def run(problem: Any, folder: Path, real: str, parameters: str, *flags: str) -> list[str]:
    """What the driver prints: status, cost, violation, bytes."""
    view, _ = solver_view(problem.data, second_order=True, real=real)
    for path, text in render_solver(view).items():
        (folder / path).write_text(text)
    first = ", ".join(str(int(i % (view.degree + 1) == 0)) for i in view.packed_from) + ", 0" * view.q
    tolerance, allowed = ("1e-10", "1e-8") if real == "double" else ("1e-5", "1e-3")
    values = {"name": view.prefix, "degree": view.degree, "stored": view.stored, "first": first, "real": real}
    driver = DRIVER.format(parameters=parameters, tolerance=tolerance, allowed=allowed, **values)
    (folder / "driver.c").write_text(driver)
    command = [str(COMPILER), "-O1", *flags, "driver.c", f"{view.prefix}.c", "-lm", "-o", "driver"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    done = subprocess.run([folder / "driver"], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert done.returncode in (4 + 6, 5 + 6)
    assert view.bytes == int(done.stdout.split()[3])
    return done.stdout.split()


SANITIZERS = (
    "-fsanitize=address,undefined,float-cast-overflow",
    "-fno-sanitize-recover=undefined",
    "-fno-sanitize=float-divide-by-zero",
)
SYSTEMS = {
    "car": (car, ", ".join(map(repr, planar(0.8, 3, 1).ravel().tolist())), 0.277507734),
    "quadrotor": (quadrotor, "2, 0, 1, 1, 0.05, 0.4", 6.119001823),
}


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.parametrize("name", ["car", pytest.param("quadrotor", marks=pytest.mark.slow)])
def test_the_solver_is_strict_c99_and_clean_under_the_sanitizers(name: str, tmp_path: Path) -> None:
    make, parameters, expected = SYSTEMS[name]
    status, cost, _, _ = run(make(), tmp_path, "double", parameters, *STRICT, *SANITIZERS)
    assert status == "0"
    assert float(cost) == pytest.approx(expected, rel=2e-8)


SHAPES: dict[str, dict[str, Any]] = {
    "bare": {},
    "one": {"intervals": 1},
    "path": {"constraints": ("u1 <= 1",)},
    "end": {"target": "Xd"},
    "lasting": {"constraints": ("X11 <= 2",)},
    "free": {"duration": (0.2, 3.0), "target": "Xd"},
}


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("plans", [True, False])
def test_problems_of_every_shape_are_strict_c99(shape: str, plans: bool, tmp_path: Path) -> None:
    """With and without conditions on the way and at the end: what one of them needs, another has no use for."""
    options: dict[str, Any] = {
        "duration": 1.0,
        "intervals": 5,
        "parameters": {"Xd": "X"},
        "name": "shape",
        **SHAPES[shape],
    }
    problem = lc.ocp("so3", controls=("w1", "w2"), stage_cost=("3*(X - Xd)", "u"), **options)
    view, _ = solver_view(problem.data, second_order=False, plans=plans)
    for path, text in render_solver(view).items():
        (tmp_path / path).write_text(text)
    subprocess.run([str(COMPILER), *STRICT, "-O1", "-c", "shape.c"], cwd=tmp_path, check=True, capture_output=True)


@pytest.mark.slow
@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_in_single_precision_it_finds_the_same_optimum(tmp_path: Path) -> None:
    status, cost, violation, _ = run(quadrotor(), tmp_path, "float", "2, 0, 1, 1, 0.05f, 0.4f", *STRICT)
    assert status in "01"
    assert float(cost) == pytest.approx(6.119, rel=2e-3)
    assert float(violation) < 1e-3


def test_the_core_is_one_text_and_neither_allocates_nor_keeps_state() -> None:
    texts = [render_solver(solver_view(make().data, second_order=False)[0]) for make in (car, satellite)]
    assert texts[0][CORE] == texts[1][CORE]
    for files in texts:
        for text in files.values():
            assert "malloc" not in text

        assert [line for line in files[CORE].splitlines() if line.startswith("static") and "(" not in line] == []
