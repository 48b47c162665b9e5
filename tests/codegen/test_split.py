"""Long kernels in parts: the same program, the same bits, on lanes too."""

from __future__ import annotations

import random
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import toy_kernels
from operation_kernels import every_operation, mixed, sizes

from lie_codegen.codegen import split as split_module
from lie_codegen.codegen.generate import generate
from lie_codegen.codegen.split import split
from lie_codegen.codegen.tape import Tape, tape_of
from lie_codegen.kernel.casadi_arithmetic import flatten, function_of
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.runtime.build import build_kernels
from lie_codegen.runtime.compiler import find_compilers

KERNELS = (*toy_kernels.KERNELS, every_operation(), mixed(), sizes())
STRICT = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-Wshadow"]


def run(tape: Tape, inputs: list[list[Any]]) -> list[list[Any]]:
    """The tape over texts: every value is the expression that it stands for."""
    values: list[Any] = []
    for statement in tape.statements:
        if statement.op == "INPUT":
            values.append(inputs[statement.slot[0]][statement.slot[1]])
        elif statement.op == "CONST":
            values.append(repr(statement.value))
        else:
            values.append((statement.op, *(values[i] for i in statement.operands)))
    return [[values[index] for index in port] for port in tape.outputs]


@pytest.mark.parametrize("limit", [1, 3, 10])
@pytest.mark.parametrize("kernel", KERNELS, ids=lambda kernel: kernel.name)
def test_the_parts_are_the_whole(kernel: Kernel, limit: int) -> None:
    tape = tape_of(kernel)
    inputs: list[list[Any]] = [[f"{port.name}{k}" for k in range(port.size)] for port in kernel.inputs]
    pieces = split(tape, len(kernel.inputs), limit)
    if pieces is None:
        assert sum(s.op not in ("INPUT", "CONST") for s in tape.statements) <= limit
        return
    work: list[Any] = [None] * pieces.size
    for part in pieces.parts:
        assert sum(s.op not in ("INPUT", "CONST") for s in part.tape.statements) <= limit
        for place, value in zip(part.places, run(part.tape, [*inputs, work])[0], strict=True):
            assert work[place] is None
            work[place] = value
    assert run(pieces.last, [*inputs, work]) == run(tape, inputs)


def test_short_tapes_stay_whole() -> None:
    assert all(split(tape_of(kernel), len(kernel.inputs)) is None for kernel in KERNELS)


@pytest.mark.skipif(not find_compilers(), reason="needs a C compiler")
def test_compiled_in_parts_it_is_the_interpreter_to_the_last_bit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LIE_CODEGEN_CACHE", str(tmp_path / "cache"))
    whole = build_kernels(lambda: KERNELS)
    monkeypatch.setattr(split_module, "PART", 5)
    parts = build_kernels(lambda: KERNELS)
    assert parts.path != whole.path
    rng = random.Random(3)
    for kernel in KERNELS:
        samples = [kernel.sample(rng) for _ in range(19)]
        flat = [[flatten(port, value) for port, value in zip(kernel.inputs, sample, strict=True)] for sample in samples]
        for sample, entries in zip(samples, flat, strict=True):
            got = parts[kernel.name](*[_plain(value) for value in sample])
            got = got if isinstance(got, tuple) else (got,)
            expected = function_of(kernel).call([[float(x) for x in port] for port in entries])
            for one, other in zip(got, expected, strict=True):
                np.testing.assert_array_equal(np.ravel(np.array(one)).view(float), np.array(other.nonzeros()))
        if kernel.inputs:
            columns = [np.array([_plain(value) for value in column]) for column in zip(*samples, strict=True)]
            first, second = (lib[kernel.name].batch(*columns) for lib in (whole, parts))
            for one, other in zip(_tuple(first), _tuple(second), strict=True):
                np.testing.assert_array_equal(one, other)


@pytest.mark.skipif(not shutil.which("gcc"), reason="needs gcc")
@pytest.mark.parametrize("real", ["double", "float"])
def test_parts_compile_strictly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, real: str) -> None:
    monkeypatch.setattr(split_module, "PART", 5)
    folder = generate(KERNELS, tmp_path / "toy", namespace="toy", real=real)
    command = ["gcc", *STRICT, "-Iinclude", "-c", "src/toy.c"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "toy_every_part_1" in (folder / "src" / "toy.c").read_text()


def _plain(value: Any) -> Any:
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    return complex(value.re, value.im) if hasattr(value, "re") else value


def _tuple(result: Any) -> tuple[Any, ...]:
    return result if isinstance(result, tuple) else (result,)
