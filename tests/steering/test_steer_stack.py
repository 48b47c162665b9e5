"""The stated stack of the C steering solver, with and without memory of the caller's: above what gcc finds along every chain of calls, enough for a thread."""

from __future__ import annotations

import shutil
import subprocess
from functools import cache
from pathlib import Path

import pytest
from call_chains import deepest

import lie_codegen as lc
from lie_codegen.algebra.controllability import require_controllable
from lie_codegen.codegen.frames import LIBRARY
from lie_codegen.steering.shooting.package import render_steering_package
from lie_codegen.steering.shooting.source import steering_view
from lie_codegen.steering.shooting.stack import LANES, stack_bytes, workspace_bytes
from lie_codegen.steering.shooting.views import SteeringView

COMPILER = shutil.which("gcc")
pytestmark = pytest.mark.skipif(COMPILER is None, reason="no gcc")
CASES = [("so3", ("w1", "w2")), ("se3", (0, 1, 3))]
#: Compiling SE(3) on lanes takes ten seconds: for the slow job.
WIDTHS = [
    pytest.param(name, controls, lanes, marks=[pytest.mark.slow] if (name, lanes) == ("se3", LANES) else [])
    for name, controls in CASES
    for lanes in (1, LANES)
]
THREAD = r"""
#define _POSIX_C_SOURCE 200112L
#include "PREFIX.h"
#include <pthread.h>
#include <stdio.h>
#include <string.h>

static PREFIX_result result;
#ifdef OWN
static char memory[UPPER_WORKSPACE + 1];
#endif

static void *work(void *unused)
{
    static const double weights[] = {1.0, 1.0, 1.0};
    static double target[FULL];
    const PREFIX_options options = PREFIX_defaults();
    int i;
    for (i = 0; i < DEGREE; ++i) {
        target[(DEGREE + 1) * i] = 1.0;
    }
    target[0] = target[DEGREE + 1] = 0.955336489125606;
    target[1] = -0.295520206661340;
    target[DEGREE] = 0.295520206661340;
#ifdef OWN
    PREFIX_solve_in(memory + 1, 1, target, weights, &options, &result);
#else
    PREFIX_solve(1, target, weights, &options, &result);
#endif
    return unused;
}

int main(void)
{
    pthread_attr_t attributes;
    pthread_t thread;
    if (pthread_attr_init(&attributes) || pthread_attr_setstacksize(&attributes, STACK) || pthread_create(&thread, &attributes, work, NULL)
        || pthread_join(thread, NULL)) {
        return 2;
    }
    printf("status %d residual %g\n", result.status, result.residual);
    return result.status != 1;
}
"""


@cache
def view_of(name: str, controls: tuple[str | int, ...]) -> SteeringView:
    group = lc.group(name)
    report = require_controllable(group.algebra, controls)
    return steering_view(group, report.controls, report.depth)


def stated(name: str, controls: tuple[str | int, ...], lanes: int, *, own: bool = False) -> int:
    return stack_bytes(view_of(name, controls), lanes, in_workspace=own)


def write(name: str, controls: tuple[str | int, ...], folder: Path) -> None:
    for path, text in render_steering_package(lc.group(name), controls).items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)


def compile_core(name: str, controls: tuple[str | int, ...], lanes: int, level: str, folder: Path) -> str:
    """The solver as the object core.o, with what gcc says of every function's stack."""
    write(name, controls, folder)
    source = [f"src/{name}_steer.c", "-o", "core.o"]
    gcc("-std=c99", level, *width(lanes), "-Iinclude", "-fcallgraph-info=su", "-c", *source, folder=folder)
    return (folder / "core.ci").read_text()


def width(lanes: int) -> list[str]:
    return ["-DLIE_CODEGEN_ONE_LANE" if lanes == 1 else f"-DLIE_CODEGEN_LANES={lanes}"]


def gcc(*arguments: str, folder: Path) -> None:
    subprocess.run([str(COMPILER), *arguments], cwd=folder, check=True, capture_output=True)


@pytest.mark.parametrize(("name", "controls", "lanes"), WIDTHS)
@pytest.mark.parametrize(
    "level", ["-O0", "-O2", pytest.param("-O3", marks=pytest.mark.slow), pytest.param("-Os", marks=pytest.mark.slow)]
)
def test_what_gcc_says_is_below_and_a_thread_of_that_stack_is_enough(
    name: str, controls: tuple[str | int, ...], lanes: int, level: str, tmp_path: Path
) -> None:
    graph = compile_core(name, controls, lanes, level, tmp_path)
    degree = lc.group(name).degree
    for entry, own in (("solve", False), ("solve_in", True)):
        found, said = deepest(graph, f"{name}_steer_{entry}"), stated(name, controls, lanes, own=own)
        # gcc does not see libm, for which the bound has a place too
        assert 0.25 * (said - LIBRARY) < found <= said, entry
        # a thread's own control block and the program's start lie on the same stack
        text = THREAD.replace("STACK", str(max(said + 8192, 16384))).replace("FULL", str(degree * degree))
        (tmp_path / "thread.c").write_text(
            text.replace("DEGREE", str(degree))
            .replace("PREFIX", f"{name}_steer")
            .replace("UPPER", f"{name}_steer".upper())
        )
        options = ["-std=c99", *width(lanes), *(["-DOWN"] if own else []), "-Iinclude"]
        gcc(*options, "thread.c", "core.o", "-lm", "-pthread", "-o", "thread", folder=tmp_path)
        done = subprocess.run([tmp_path / "thread"], capture_output=True, text=True, check=False)
        assert done.returncode == 0, (entry, done.stdout)


def test_the_readme_states_it() -> None:
    readme = render_steering_package(lc.group("so3"), ("w1", "w2"))["README.md"]
    for lanes in (1, LANES):
        assert f"{stated('so3', ('w1', 'w2'), lanes):,} bytes" in readme
        for bytes_of in (
            workspace_bytes(view_of("so3", ("w1", "w2")), lanes),
            stated("so3", ("w1", "w2"), lanes, own=True),
        ):
            assert f"{bytes_of:,}" in readme
