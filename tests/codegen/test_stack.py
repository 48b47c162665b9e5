"""The stated stack of generated functions: above what compilers say of every function, and what a painted stack shows of a run; enough for a thread."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from call_chains import deepest

import lie_codegen as lc
from lie_codegen.codegen.frames import LIBRARY

COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]
pytestmark = pytest.mark.skipif(not COMPILERS, reason="needs a C compiler")
#: Without optimisation a function takes most.
LEVELS = ["-O0", pytest.param("-O2", marks=pytest.mark.slow)]
#: Runs main of example.c in a thread; first with all the stack there is, which resolves the functions of libm and opens stdout.
THREAD = r"""
#define _POSIX_C_SOURCE 200112L
#define main example
#include "example.c"
#undef main
#include <limits.h>
#include <pthread.h>

static int failed = 1;

static void *work(void *unused)
{
    failed = example();
    return unused;
}

int main(void)
{
    pthread_attr_t attributes;
    pthread_t thread;
    if (example() || pthread_attr_init(&attributes) || pthread_attr_setstacksize(&attributes, STACK + PTHREAD_STACK_MIN)
        || pthread_create(&thread, &attributes, work, NULL) || pthread_join(thread, NULL)) {
        return 2;
    }
    return failed;
}
"""
#: Bytes of a painted stack that each call changed, less those of a thread that does nothing.
PAINTED = r"""
#define _GNU_SOURCE
#include "NAMESPACE.h"
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>

#define SIZE 1048576
DATA

static void nothing(void) {}
CALLS

static void *work(void *function)
{
    (*(void (**)(void))function)();
    return NULL;
}

static long used(void (*function)(void))
{
    unsigned char *stack = mmap(NULL, SIZE, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    pthread_attr_t attributes;
    pthread_t thread;
    long untouched = 0;
    if (stack == MAP_FAILED) {
        return -1;
    }
    memset(stack, 0xA5, SIZE);
    if (pthread_attr_init(&attributes) || pthread_attr_setstack(&attributes, stack, SIZE)
        || pthread_create(&thread, &attributes, work, &function) || pthread_join(thread, NULL)) {
        return -1;
    }
    while (untouched < SIZE && stack[untouched] == 0xA5) {
        ++untouched;
    }
    munmap(stack, SIZE);
    return SIZE - untouched;
}

int main(void)
{
    long none;
    used(nothing);
    none = used(nothing);
    RUNS
    return none < 0;
}
"""


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory, repository: Path) -> dict[str, Path]:
    """A law, its loop (cut into parts), one in floats, and groups as they are committed."""
    folder = tmp_path_factory.mktemp("stack")
    made = lc.tracking_law("so3", inertia=[1, 2, 2.5], error="so3_right", gains={"K_p": [4, 5, 6], "K_d": 4})
    turn = lc.reference("so3", ["sin(t)", "0", "0"])
    loop = lc.closed_loop(law=made, reference=turn, X0=np.eye(3), t=[0.0, 0.1, 0.2], step=0.05)
    return {
        "law": lc.generate(made, folder / "law"),
        "loop": lc.generate(loop, folder / "loop"),
        "law in floats": lc.generate(made, folder / "lawf", real="float"),
        "so3": repository / "generated" / "so3",
        "se3": repository / "generated" / "se3",
    }


def stated(folder: Path) -> dict[str, int]:
    return dict(json.loads((folder / "manifest.json").read_text())["stack_bytes"])


def namespace(folder: Path) -> str:
    return str(json.loads((folder / "manifest.json").read_text())["namespace"])


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name", ["law", "loop", "so3", "se3", "law in floats"])
@pytest.mark.parametrize("level", LEVELS)
def test_what_compilers_say_is_below(
    compiler: str, name: str, level: str, packages: dict[str, Path], tmp_path: Path
) -> None:
    folder = packages[name]
    source = f"src/{namespace(folder)}.c"
    command = [compiler, "-std=c99", level, "-Iinclude", "-fstack-usage", "-c", source, "-o", str(tmp_path / "x.o")]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    said = re.findall(r":(\w+)\t(\d+)\t", (tmp_path / "x.su").read_text())
    own = {symbol: int(size) for symbol, size in said}
    for symbol, bound in stated(folder).items():
        # every static function of a group serves its logarithm, one after another in the worst case
        prefix = f"{symbol}_" if symbol.endswith("_log") else f"{symbol}_part_"
        below = [size for each, size in own.items() if each.startswith(prefix)]
        parts = sum(below) if symbol.endswith("_log") else max(below, default=0)
        # the compiler does not see libm, for which the bound has a place too
        assert own[symbol] + parts <= bound - LIBRARY, symbol
        if level == "-O0" and name != "law in floats" and bound > 4 * LIBRARY:
            assert own[symbol] + parts > 0.4 * bound, symbol


@pytest.mark.skipif("gcc" not in COMPILERS, reason="gcc alone tells who calls whom")
@pytest.mark.parametrize(
    ("name", "routine"),
    [
        ("average", "time_average_terms"),
        *(pytest.param(name, f"{name}_log", marks=pytest.mark.slow) for name in ("sp4", "so4", "su3")),
    ],
)
@pytest.mark.parametrize("level", LEVELS)
def test_what_runs_loops_is_below_along_every_chain(name: str, routine: str, level: str, tmp_path: Path) -> None:
    """Logarithms by iterations, by the lattice and by blocks; averages over nodes."""
    average = lc.time_average(["-x + 0.3*cos(t)*y", "sin(t)*x"], variables=("x", "y"), order=3)
    what = list(average.kernels()) if name == "average" else name
    folder = lc.generate(what, tmp_path / name, name=name)
    command = ["gcc", "-std=c99", level, "-Iinclude", "-fcallgraph-info=su", "-c", f"src/{name}.c", "-o", "x.o"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    functions = {each["symbol"] for each in json.loads((folder / "manifest.json").read_text())["functions"]}
    bounds = stated(folder)
    assert bounds.keys() == functions
    assert routine in functions
    for symbol, bound in bounds.items():
        found = deepest((folder / "x.ci").read_text(), symbol)
        assert found <= bound - LIBRARY, symbol
        if level == "-O0" and symbol == routine:
            assert found > 0.4 * (bound - LIBRARY), symbol


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("name", ["law", "loop", "se3"])
def test_a_painted_stack_shows_no_more(name: str, level: str, packages: dict[str, Path], tmp_path: Path) -> None:
    folder = packages[name]
    functions = json.loads((folder / "manifest.json").read_text())["functions"]
    data, calls, runs = [], [], []
    for number, function in enumerate(functions):
        arguments = []
        for side in ("inputs", "outputs"):
            for port in function[side]:
                size = 1
                for each in port["shape"]:
                    size *= each
                array = f"{side}_{number}_{len(arguments)}"
                data.append(f"static double {array}[{size}] = {{0.5}};")
                arguments.append(f"{array}[0]" if side == "inputs" and not port["shape"] else array)
        symbol = function["symbol"]
        calls.append(f"static void call_{number}(void) {{ {symbol}({', '.join(arguments)}); }}")
        runs.append(f'used(call_{number}); printf("{symbol} %ld\\n", used(call_{number}) - none);')
    text = PAINTED.replace("NAMESPACE", namespace(folder)).replace("DATA", "\n".join(data))
    (tmp_path / "painted.c").write_text(text.replace("CALLS", "\n".join(calls)).replace("RUNS", "\n    ".join(runs)))
    sources = [str(tmp_path / "painted.c"), *map(str, sorted((folder / "src").glob("*.c")))]
    program = str(tmp_path / "painted")
    command = [COMPILERS[0], "-std=gnu99", level, f"-I{folder / 'include'}", *sources, "-lm", "-pthread", "-o", program]
    subprocess.run(command, check=True, capture_output=True)
    done = subprocess.run([program], check=True, capture_output=True, text=True)
    found = {symbol: int(size) for symbol, size in (line.split() for line in done.stdout.splitlines())}
    most = stated(folder)
    assert found.keys() == most.keys()
    assert all(found[symbol] <= most[symbol] for symbol in found), (found, most)
    deepest = max(most, key=most.__getitem__)
    assert level != "-O0" or found[deepest] > 0.4 * most[deepest]


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("name", ["law", "loop"])
def test_a_thread_of_the_stated_stack_is_enough(
    name: str, level: str, packages: dict[str, Path], tmp_path: Path
) -> None:
    folder = packages[name]
    text = THREAD.replace("STACK +", f"{max(stated(folder).values())} +")
    (tmp_path / "thread.c").write_text(text)
    sources = [str(tmp_path / "thread.c"), *map(str, sorted((folder / "src").glob("*.c")))]
    includes = [f"-I{folder}", f"-I{folder / 'include'}"]
    program = str(tmp_path / "thread")
    subprocess.run(
        [COMPILERS[0], "-std=c99", level, *includes, *sources, "-lm", "-pthread", "-o", program],
        check=True,
        capture_output=True,
    )
    done = subprocess.run([program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_the_readme_states_it(packages: dict[str, Path]) -> None:
    for name in ("law", "se3"):
        readme = (packages[name] / "README.md").read_text()
        assert f"At most {max(stated(packages[name]).values()):,} bytes" in readme
        assert "loops" not in readme
    assert "se3_log" in stated(packages["se3"])
