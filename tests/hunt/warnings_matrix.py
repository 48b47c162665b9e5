"""Generated C under strict warnings, in double and in float, on lanes and on one lane, by every compiler that is here, and for other targets.

gcc, clang     -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Wdouble-promotion -Werror
zig cc         aarch64, riscv64, wasm32 and Windows, compiled; wasm32 is run under node where that is found
"""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path

import lie_codegen as lc
from lie_codegen.steering.shooting.package import render_steering_package

STRICT = (
    "-std=c99",
    "-O1",
    "-Wall",
    "-Wextra",
    "-Wpedantic",
    "-Wconversion",
    "-Wshadow",
    "-Wdouble-promotion",
    "-Werror",
)
#: An index is an int, a size a size_t, and -Wconversion minds the signs of both in sizes of arrays; nothing else is excepted.
EXCEPT = ("-Wno-sign-conversion",)
TARGETS = ("aarch64-linux-musl", "riscv64-linux-musl", "x86_64-windows-gnu", "wasm32-wasi")


def compilers() -> list[str]:
    """Those of the strict part."""
    return [found for name in ("gcc", "clang") if (found := shutil.which(name))]


def has_zig() -> bool:
    """Whether the wheel ziglang is installed."""
    return importlib.util.find_spec("ziglang") is not None


def packages(folder: Path) -> list[tuple[Path, str]]:
    """(folder of a package, its source): a group in double and in float, and a steering solver."""
    made = []
    for real in ("double", "float"):
        home = Path(lc.generate("so3", folder / real, real=real))
        made.append((home, "src/so3.c"))
    home = folder / "steering"
    for path, text in render_steering_package(lc.group("so3"), ("w1", "w2")).items():
        (home / path).parent.mkdir(parents=True, exist_ok=True)
        (home / path).write_text(text)
    return [*made, (home, "src/so3_steer.c")]


def hunt(folder: Path) -> tuple[int, list[str]]:
    """(compilations, those that failed)."""
    tried, found = 0, []

    def compile_one(home: Path, *command: str) -> bool:
        nonlocal tried
        tried += 1
        done = subprocess.run(command, cwd=home, capture_output=True, text=True, check=False, timeout=600)
        if done.returncode:
            found.append(f"{' '.join(command)}: {done.stderr[:600]}")
        return done.returncode == 0

    made = packages(folder)
    for home, source in made:
        for compiler in compilers():
            for lanes in ((), ("-DLIE_CODEGEN_ONE_LANE",)):
                compile_one(home, compiler, *STRICT, *EXCEPT, *lanes, "-Iinclude", "-c", source, "-o", "strict.o")
        if has_zig():
            for target in TARGETS:
                zig = (sys.executable, "-m", "ziglang", "cc", "-target", target, "-std=c99", "-O1")
                program = f"example-{target}.wasm" if target.startswith("wasm") else f"example-{target}"
                if compile_one(
                    home, *zig, "-DLIE_CODEGEN_ONE_LANE", "-Iinclude", "example.c", source, "-lm", "-o", program
                ):
                    emulator = emulator_of(target)
                    if emulator:
                        compile_one(home, *emulator, program)
    return tried, found


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
