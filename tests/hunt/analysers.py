"""What cppcheck, clang-tidy and valgrind say of generated C: kernels in double and in float, the steering solver, the bounded solver.

Each is used where it is installed; what is excepted stands here with its reason.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np

import lie_codegen as lc
from tests.hunt import warnings_matrix

CPPCHECK = (
    "--std=c99",
    "--quiet",
    "--enable=warning,portability,performance",
    "--suppress=missingIncludeSystem",
    # Elimination reads the rows above the one it fills, insertion the places before: cppcheck looks at the first pass alone.
    "--suppress=uninitvar",
    "--error-exitcode=1",
)
DIALECT = ("-std=c99", "-Iinclude")
CHECKS = (
    "clang-analyzer-*",
    "bugprone-*",
    "cert-*",
    "-bugprone-easily-swappable-parameters",  # X and Y of a product are two matrices
    "-bugprone-narrowing-conversions",  # -Wconversion says more, in tests.hunt.warnings_matrix
    "-bugprone-implicit-widening-of-multiplication-result",  # k * N inside one matrix
    "-bugprone-reserved-identifier,-cert-dcl37-c",
    "-cert-flp30-c,-clang-analyzer-security.FloatLoopCounter",  # a size that is halved until it is below 1/2
)


def packages(folder: Path) -> list[tuple[Path, str]]:
    """(folder of a package, its source): those of the strict compilations, and a bounded solver on rotations."""
    problem = lc.ocp(
        "so3", controls=("w1", "w2", "w3"), duration=1.0, intervals=10, parameters={"Xd": (3, 3)}, bounds=1.2,
        stage_cost=("X - Xd", "u"), terminal_cost=("2*(X - Xd)",), name="turn",
    )  # fmt: skip
    controller = lc.mpc(problem)
    c, s = np.cos(1.0), np.sin(1.0)
    controller.reset(problem.solve(X0=np.eye(3), Xd=[[c, -s, 0], [s, c, 0], [0, 0, 1]]))
    home = Path(lc.generate(controller, folder / "bounded"))
    return [*warnings_matrix.packages(folder), (home, str(next((home / "src").glob("*.c")).relative_to(home)))]


def tools() -> dict[str, Callable[[str], list[list[str]]]]:
    """Those installed: the commands that each runs in the folder of a package, of its source."""
    compiler = shutil.which("gcc") or "cc"
    program = [compiler, "-std=c99", "-g", "-O1", "-Iinclude", "-DLIE_CODEGEN_ONE_LANE", "example.c"]
    sanitized = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    every: dict[str, Callable[[str], list[list[str]]]] = {
        "cppcheck": lambda source: [["cppcheck", *CPPCHECK, "-Iinclude", source]],
        "clang-tidy": lambda source: [
            [
                "clang-tidy",
                "--quiet",
                f"--checks={','.join(CHECKS)}",
                "--warnings-as-errors=*",
                source,
                "example.c",
                "--",
                *DIALECT,
            ]
        ],
        "valgrind": lambda source: [
            [*program, source, "-lm", "-o", "example"],
            ["valgrind", "--quiet", "--error-exitcode=9", "./example"],
        ],
        "gcc": lambda source: [[*program, *sanitized, source, "-lm", "-o", "checked"], ["./checked"]],
    }
    return {name: commands for name, commands in every.items() if shutil.which(name)}


def hunt(folder: Path) -> tuple[int, list[str]]:
    """(runs of analysers, what they say)."""
    tried, found = 0, []
    for home, source in packages(folder):
        for name, commands in tools().items():
            tried += 1
            for command in commands(source):
                done = subprocess.run(command, cwd=home, capture_output=True, text=True, check=False, timeout=900)
                if done.returncode:
                    found.append(f"{name} of {source}: {(done.stdout + done.stderr)[:1500]}")
    return tried, found
