"""The example of a generated package as a program: compiled with every warning an error, and run."""

from __future__ import annotations

import subprocess
from pathlib import Path

STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror")


def run_example(folder: Path, name: str) -> None:
    """Compiles example.c with src/<name>.c and runs it; a warning or a vector that does not fit fails."""
    command = ["cc", *STRICT, "-Iinclude", "example.c", f"src/{name}.c", "-lm", "-o", "example"]
    subprocess.run(command, cwd=folder, check=True)
    subprocess.run(["./example"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
