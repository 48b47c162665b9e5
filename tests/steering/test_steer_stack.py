"""The stated stack of the C steering solver: above what gcc finds along every chain of calls, and enough for a thread."""

from __future__ import annotations

import re
import shutil
import subprocess
from functools import cache
from pathlib import Path

import pytest

import lie_codegen as lc
from lie_codegen.algebra.controllability import require_controllable
from lie_codegen.steering.shooting.package import render_steering_package
from lie_codegen.steering.shooting.source import steering_view
from lie_codegen.steering.shooting.stack import LANES, stack_bytes

COMPILER = shutil.which("gcc")
pytestmark = pytest.mark.skipif(COMPILER is None, reason="no gcc")
CASES = [("so3", ("w1", "w2")), ("se3", (0, 1, 3))]
THREAD = r"""
#define _POSIX_C_SOURCE 200112L
#include "PREFIX.h"
#include <pthread.h>
#include <stdio.h>
#include <string.h>

static PREFIX_result result;

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
    PREFIX_solve(1, target, weights, &options, &result);
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
def stated(name: str, controls: tuple[str | int, ...], lanes: int) -> int:
    group = lc.group(name)
    report = require_controllable(group.algebra, controls)
    return stack_bytes(steering_view(group, report.controls, report.depth), lanes)


def write(name: str, controls: tuple[str | int, ...], folder: Path) -> None:
    for path, text in render_steering_package(lc.group(name), controls).items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)


def deepest(graph: str) -> int:
    """Bytes of the deepest chain of calls in a graph of gcc's -fcallgraph-info=su."""
    own = {
        title: int(size) for title, size in re.findall(r'node: \{ title: "([^"]+)" label: "[^"]*?\\n(\d+) bytes', graph)
    }
    calls: dict[str, set[str]] = {}
    for source, target in re.findall(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"', graph):
        calls.setdefault(source, set()).add(target)

    @cache
    def below(title: str) -> int:
        return own.get(title, 0) + max((below(target) for target in calls.get(title, ())), default=0)

    assert own
    return max(map(below, own))


@pytest.mark.parametrize(("name", "controls"), CASES)
@pytest.mark.parametrize("lanes", [1, LANES])
@pytest.mark.parametrize(
    "level", ["-O0", "-O2", pytest.param("-O3", marks=pytest.mark.slow), pytest.param("-Os", marks=pytest.mark.slow)]
)
def test_what_gcc_says_is_below(
    name: str, controls: tuple[str | int, ...], lanes: int, level: str, tmp_path: Path
) -> None:
    write(name, controls, tmp_path)
    one = ["-DLIE_CODEGEN_ONE_LANE"] if lanes == 1 else []
    command = [
        str(COMPILER),
        "-std=c99",
        level,
        *one,
        "-Iinclude",
        "-fcallgraph-info=su",
        "-c",
        f"src/{name}_steer.c",
        "-o",
        "x.o",
    ]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    found = deepest((tmp_path / "x.ci").read_text())
    assert 0.4 * stated(name, controls, lanes) < found <= stated(name, controls, lanes)


@pytest.mark.parametrize(("name", "controls"), CASES)
@pytest.mark.parametrize("lanes", [1, LANES])
def test_a_thread_of_the_stated_stack_is_enough(
    name: str, controls: tuple[str | int, ...], lanes: int, tmp_path: Path
) -> None:
    write(name, controls, tmp_path)
    degree = lc.group(name).degree
    # a thread's own control block and the program's start lie on the same stack
    text = THREAD.replace("STACK", str(stated(name, controls, lanes) + 8192)).replace("FULL", str(degree * degree))
    (tmp_path / "thread.c").write_text(text.replace("DEGREE", str(degree)).replace("PREFIX", f"{name}_steer"))
    one = ["-DLIE_CODEGEN_ONE_LANE"] if lanes == 1 else []
    command = [
        str(COMPILER),
        "-std=c99",
        "-O1",
        *one,
        "-Iinclude",
        "thread.c",
        f"src/{name}_steer.c",
        "-lm",
        "-pthread",
        "-o",
        "thread",
    ]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    done = subprocess.run([tmp_path / "thread"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_the_readme_states_it() -> None:
    readme = render_steering_package(lc.group("so3"), ("w1", "w2"))["README.md"]
    for lanes in (1, LANES):
        assert f"{stated('so3', ('w1', 'w2'), lanes):,} bytes" in readme
