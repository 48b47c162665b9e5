"""Group files that ask for too much: refused within the budget, by our own errors, and on the command line too."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

import lie_codegen as lc
from lie_codegen.errors import InputError
from lie_codegen.exact.budget import Budget

#: A file is read in a process of its own: a parser in C hears no alarm.
_READ = """
import sys, lie_codegen as lc
from lie_codegen.errors import InputError
try:
    lc.group(sys.argv[1])
except InputError as error:
    print(error)
    sys.exit(2)
"""
HEAD = 'name = "g"\nlabels = ["a", "b"]\n'
FILES = {
    "digits": (HEAD + '[brackets]\n"a,b" = { b = 1e1000000 }\n', "limit of digits"),
    "exponent": (HEAD + '[brackets]\n"a,b" = { b = 1e99999999999999999999 }\n', "g.toml"),
    "integer": (HEAD + f'[brackets]\n"a,b" = {{ b = {"9" * 5000} }}\n', "g.toml"),
    "name": (f'name = 0x{"F" * 20000}\nlabels = ["a"]\n[brackets]\n', "too long to be shown"),
    "power": (HEAD + '[brackets]\n"a,b" = { b = "((9^64)^64)^64" }\n', "limit of digits"),
    "terms": (HEAD + '[brackets]\n"a,b" = { b = "(1+sqrt(2)+sqrt(3)+pi)^64" }\n', "limit of terms"),
    "roots": (
        HEAD + '[brackets]\n"a,b" = { b = "sqrt(2)+sqrt(3)+sqrt(5)+sqrt(7)+sqrt(11)+sqrt(13)" }\n',
        "limit of degree",
    ),
    "labels": (f'name = "g"\nlabels = {[f"l{k}" for k in range(3000)]}\n[brackets]\n', "limit of dimension"),
    "keys": (HEAD + "[brackets]\n" + ".".join(["a"] * 30000) + " = 1\n", "limit of nesting"),
    "size": ("#" * 1_000_001, "limit of size"),
}


def _run(arguments: Sequence[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *arguments], capture_output=True, text=True, timeout=10, check=False)


@pytest.mark.parametrize("case", FILES)
def test_a_file_over_the_budget(case: str, tmp_path: Path) -> None:
    text, says = FILES[case]
    path = tmp_path / "g.toml"
    path.write_text(text)
    done = _run(["-c", _READ, str(path)])
    assert done.returncode == 2, done.stderr
    assert says in done.stdout


@pytest.mark.parametrize("case", ["digits", "name", "keys"])
def test_the_command_line_says_it_in_one_line(case: str, tmp_path: Path) -> None:
    text, says = FILES[case]
    path = tmp_path / "g.toml"
    path.write_text(text)
    done = _run(["-m", "lie_codegen", "check", str(path)])
    assert done.returncode == 2
    assert says in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_a_pipe_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "pipe.toml"
    os.mkfifo(path)
    done = _run(["-c", _READ, str(path)])
    assert done.returncode == 2
    assert "not a file" in done.stdout


def test_too_many_labels_and_rows_from_python() -> None:
    labels = [f"l{k}" for k in range(3000)]
    with pytest.raises(InputError, match="limit of dimension"):
        lc.from_brackets("g", labels, {})
    with Budget(dimension=2), pytest.raises(InputError, match="3 rows; the limit of dimension is 2"):
        lc.from_matrices("g", ["a"], [[[0, 1, 0], [0, 0, 0], [0, 0, 0]]])


def test_an_integer_as_name() -> None:
    with pytest.raises(InputError, match="not a C identifier"):
        lc.from_brackets(10**20000, ["a"], {})  # type: ignore[arg-type]
