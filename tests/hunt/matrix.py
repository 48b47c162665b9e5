"""Packages by compilers, targets, sanitizers and analysers: `python -m tests.hunt.matrix` prints the table.

A cell compiles the package with strict warnings as errors and runs its example, which compares with its own test vectors, where something here can
run it: the machine itself, qemu for other Linux, node for WebAssembly, wine for Windows. What a tool is excepted from stands here with its reason.
"""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import lie_codegen as lc
from lie_codegen.codegen.templates import template_folder
from lie_codegen.steering.shooting.package import render_steering_package

STRICT = (
    "-std=c99", "-O1", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wdouble-promotion", "-Werror",
    # An index is an int, a size a size_t, and -Wconversion minds the signs of both in sizes of arrays; nothing else is excepted.
    "-Wno-sign-conversion",
)  # fmt: skip
ONE_LANE = ("-DLIE_CODEGEN_ONE_LANE",)
SANITIZED = ("-g", "-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all")
CORTEX = ("-mcpu=cortex-m7", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv5-d16")
ZIG = ("aarch64-linux-musl", "riscv64-linux-musl", "wasm32-wasi", "x86_64-windows-gnu")
CPPCHECK = (
    "--std=c99", "--quiet", "--enable=warning,portability,performance", "--error-exitcode=1", "--suppress=missingIncludeSystem",
    # Elimination reads the rows above the one it fills, insertion the places before: cppcheck looks at the first pass alone.
    "--suppress=uninitvar",
)  # fmt: skip
CHECKS = (
    "clang-analyzer-*",
    "bugprone-*",
    "cert-*",
    "-bugprone-easily-swappable-parameters",  # X and Y of a product are two matrices
    "-bugprone-narrowing-conversions",  # -Wconversion says more
    "-bugprone-implicit-widening-of-multiplication-result",  # k * N inside one matrix
    "-bugprone-reserved-identifier,-cert-dcl37-c,-cert-dcl51-cpp",  # _GNU_SOURCE, and names of the house with a final _
    "-cert-flp30-c,-clang-analyzer-security.FloatLoopCounter",  # a size that is halved until it is below 1/2
)
#: Plain C of templates/ that clang-tidy reads as it is (the rest needs a generated header, and is read in packages), with further exceptions.
PLAIN = {
    "bench_hand.c": "",
    "loop.c": "",
    "drive.c": ",-clang-analyzer-core.CallAndMessage",  # a block of no steps
    # A function without inputs or outputs, which no kernel is.
    "python_call.c": ",-clang-analyzer-core.UndefinedBinaryOperatorResult,-clang-analyzer-core.uninitialized.UndefReturn",
}
_SECONDS = 1800


@dataclass(frozen=True)
class Package:
    """A package to build: its folder, its sources."""

    home: Path
    sources: tuple[str, ...]


@dataclass(frozen=True)
class Cell:
    """What is done with a package: the words in the table if all goes well, and the commands."""

    done: str
    commands: Callable[[Package], list[list[str]]]


def compilers() -> list[str]:
    """gcc and clang, those that are here."""
    return [name for name in ("gcc", "clang") if shutil.which(name)]


def has_zig() -> bool:
    """Whether the wheel ziglang is installed."""
    return importlib.util.find_spec("ziglang") is not None


def _package(home: Path) -> Package:
    return Package(home, tuple(str(each.relative_to(home)) for each in sorted((home / "src").glob("*.c"))))


def _steering(folder: Path) -> Path:
    for path, text in render_steering_package(lc.group("so3"), ("w1", "w2")).items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")
    return folder


def _bounded(folder: Path) -> Path:
    problem = lc.ocp(
        "so3", controls=("w1", "w2", "w3"), duration=1.0, intervals=10, parameters={"Xd": (3, 3)}, bounds=1.2,
        stage_cost=("X - Xd", "u"), terminal_cost=("2*(X - Xd)",), name="turn",
    )  # fmt: skip
    controller = lc.mpc(problem)
    c, s = np.cos(1.0), np.sin(1.0)
    controller.reset(problem.solve(X0=np.eye(3), Xd=[[c, -s, 0], [s, c, 0], [0, 0, 1]]))
    return Path(lc.generate(controller, folder))


#: name -> write(folder): groups in double and in float, one with loops (its logarithm) and one complex, a solver for steering, a bounded one.
PACKAGES: dict[str, Callable[[Path], Path]] = {
    "so3": lambda folder: Path(lc.generate("so3", folder)),
    "so3 float": lambda folder: Path(lc.generate("so3", folder, real="float")),
    "su2": lambda folder: Path(lc.generate("su2", folder)),
    "se3": lambda folder: Path(lc.generate("se3", folder)),
    "steering": _steering,
    "mpc": _bounded,
}


def _program(compiler: str, *flags: str, run: bool = True) -> Cell:
    def commands(package: Package) -> list[list[str]]:
        build = [compiler, *STRICT, *flags, "-Iinclude", "example.c", *package.sources, "-lm", "-o", "program"]
        return [build, ["./program"]] if run else [build]

    return Cell("ran", commands)


def _foreign(target: str, *flags: str) -> Cell:
    runner = emulator_of(target)

    def commands(package: Package) -> list[list[str]]:
        program = f"program-{target}{'.wasm' if target.startswith('wasm') else ''}"
        zig = [sys.executable, "-m", "ziglang", "cc", "-target", target, *STRICT, *flags]
        build = [*zig, "-Iinclude", "example.c", *package.sources, "-lm", "-o", program]
        return [build, [*runner, program]] if runner else [build]

    return Cell("ran" if runner else "built", commands)


def _embedded(compiler: str) -> Cell:
    def commands(package: Package) -> list[list[str]]:
        objects = [
            [compiler, *STRICT, *ONE_LANE, *CORTEX, "-Iinclude", "-c", each, "-o", "unit.o"] for each in package.sources
        ]
        return [
            *objects,
            [
                compiler,
                "--specs=nosys.specs",
                *STRICT,
                *ONE_LANE,
                *CORTEX,
                "-Iinclude",
                "-c",
                "example.c",
                "-o",
                "unit.o",
            ],
        ]

    return Cell("built", commands)


def cells() -> dict[str, Cell]:
    """Those for which the tools are here, by name."""
    found = {}
    for compiler in compilers():
        found[compiler] = _program(compiler)
        found[f"{compiler}, one lane"] = _program(compiler, *ONE_LANE)
        found[f"{compiler}, sanitizers"] = _program(compiler, *SANITIZED)
    if has_zig():
        found[f"zig {ZIG[0]}, lanes"] = _foreign(ZIG[0])
        found |= {f"zig {target}": _foreign(target, *ONE_LANE) for target in ZIG}
    if embedded := shutil.which("arm-none-eabi-gcc"):
        found["arm-none-eabi, Cortex-M7"] = _embedded(embedded)
    if shutil.which("valgrind") and shutil.which("gcc"):
        plain = _program("gcc", "-g", *ONE_LANE, run=False)
        found["valgrind"] = Cell(
            "clean",
            lambda package: [*plain.commands(package), ["valgrind", "--quiet", "--error-exitcode=9", "./program"]],
        )
    if shutil.which("cppcheck"):
        found["cppcheck"] = Cell("clean", lambda package: [["cppcheck", *CPPCHECK, "-Iinclude", *package.sources]])
    if shutil.which("clang-tidy"):
        found["clang-tidy"] = Cell("clean", lambda package: [_tidy([*package.sources, "example.c"], "-Iinclude")])
    return found


def _tidy(files: list[str], *flags: str, more: str = "") -> list[str]:
    checks = f"--checks={','.join(CHECKS)}{more}"
    return ["clang-tidy", "--quiet", checks, "--warnings-as-errors=*", *files, "--", "-std=c99", *flags]


def emulator_of(target: str) -> tuple[str, ...]:
    """What runs a program of that target here; empty if nothing does."""
    if target.startswith("wasm") and shutil.which("node"):
        run = (
            "import {WASI} from 'node:wasi'; import fs from 'node:fs';"
            "const w = new WASI({version: 'preview1', args: process.argv, env: {}});"
            "const m = await WebAssembly.instantiate(await WebAssembly.compile(fs.readFileSync(process.argv[1])), w.getImportObject());"
            "process.exit(w.start(m));"
        )
        return (str(shutil.which("node")), "--no-warnings", "--input-type=module", "-e", run, "--")
    name = {"aarch64": "qemu-aarch64", "riscv64": "qemu-riscv64", "x86_64-windows": "wine"}
    found = next((shutil.which(program) for start, program in name.items() if target.startswith(start)), None)
    return (found,) if found else ()


def tried(package: Package, cell: Cell) -> tuple[str, str]:
    """(the words of the table, what went wrong)."""
    for command in cell.commands(package):
        try:
            done = subprocess.run(
                command, cwd=package.home, capture_output=True, text=True, check=False, timeout=_SECONDS
            )
        except subprocess.TimeoutExpired:
            return "LATE", f"{' '.join(command)}: over {_SECONDS} s"
        if done.returncode:
            return "FAILED", f"{' '.join(command)}: {(done.stdout + done.stderr)[:1500]}"
    return cell.done, ""


def plain_c() -> Iterator[tuple[str, str, str]]:
    """(file, tool, what it says) of the plain C in templates/, as it is; "" where it has nothing to say."""
    home = template_folder()
    includes = [f"-I{sysconfig.get_path('include')}", f"-I{np.get_include()}"]
    commands: list[tuple[str, list[str]]] = []
    if shutil.which("cppcheck"):
        every = sorted(each.name for each in home.glob("*.c"))
        commands += [(each, ["cppcheck", *CPPCHECK, "--suppress=missingInclude", each]) for each in every]
    if shutil.which("clang-tidy") and (Path(sysconfig.get_path("include")) / "Python.h").exists():
        commands += [(each, _tidy([each], *includes, more=more)) for each, more in PLAIN.items()]
    for file, command in commands:
        done = subprocess.run(command, cwd=home, capture_output=True, text=True, check=False, timeout=_SECONDS)
        yield file, command[0], f"{done.stdout}{done.stderr}"[:1500] if done.returncode else ""


def results(
    folder: Path, packages: tuple[str, ...] = tuple(PACKAGES), only: str = ""
) -> Iterator[tuple[str, str, str, str]]:
    """(cell, package, words, what went wrong), one after another."""
    made = {name: _package(PACKAGES[name](folder / name.replace(" ", "_"))) for name in packages}
    for cell_name, cell in cells().items():
        if cell_name.startswith(only):
            for name, package in made.items():
                yield (cell_name, name, *tried(package, cell))


def hunt(
    folder: Path, packages: tuple[str, ...] = tuple(PACKAGES), only: str = "", tell: Callable[[str], Any] | None = None
) -> tuple[int, list[str]]:
    """(cells, those that failed), with the plain C; the table is told as it grows."""
    say = tell or (lambda text: None)
    say(f"| | {' | '.join(packages)} |\n|---|{'---|' * len(packages)}")
    tried, row, failed = 0, "", []
    for cell, name, words, wrong in results(folder, packages, only):
        begun = "" if cell == row else f"\n| {cell} |"
        say(f"{begun} {words} |")
        tried, row = tried + 1, cell
        failed += [f"{cell}, {name}: {wrong}"] if wrong else []
    plain = [] if only else list(plain_c())
    say(f"\nplain C of templates/: {len(plain)} runs of cppcheck and clang-tidy\n")
    return tried + len(plain), [*failed, *(f"{tool} of {file}: {wrong}" for file, tool, wrong in plain if wrong)]


def main() -> int:
    """Print the table."""
    with tempfile.TemporaryDirectory(prefix="matrix-") as folder:
        _, failed = hunt(Path(folder), tell=sys.stdout.write)
    print(*failed, sep="\n")  # noqa: T201
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
