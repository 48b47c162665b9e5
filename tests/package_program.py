"""The programs of a generated package: compiled with every warning an error, and run."""

from __future__ import annotations

import subprocess
from pathlib import Path

STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror")


def run_example(folder: Path, name: str, program: str = "example.c") -> str:
    """Compiles the program with src/<name>.c and runs it; a warning or a vector that does not fit fails. Returns what it printed."""
    subprocess.run(["cc", *STRICT, "-Iinclude", program, f"src/{name}.c", "-lm", "-o", "run"], cwd=folder, check=True)
    return subprocess.run(["./run"], cwd=folder, check=True, capture_output=True, text=True).stdout
