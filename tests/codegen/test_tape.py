"""The tape: same numbers as CasADi's interpreter to the last bit, for every operation of the closed table."""

from __future__ import annotations

import ctypes
import math
import shutil
import subprocess
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
import toy_kernels
from operation_kernels import every_operation

from lie_codegen.codegen.opcodes import C99, C99_FORMS, c_literal
from lie_codegen.codegen.package import render_library
from lie_codegen.codegen.tape import tape_of, tape_of_function
from lie_codegen.errors import CodegenError, ShapeError
from lie_codegen.kernel.casadi_arithmetic import function_of
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.runtime.build import build_kernels

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="needs a C compiler")


@pytest.fixture(scope="module")
def private_cache(tmp_path_factory: pytest.TempPathFactory) -> Any:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LIE_CODEGEN_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


def test_every_operation_of_the_table_is_exercised() -> None:
    used = {statement.op for statement in tape_of(every_operation()).statements}
    assert set(C99_FORMS) - used == {"ASSIGN", "LIFT"}


@needs_compiler
def test_every_operation_agrees_with_the_interpreter_to_the_last_bit(private_cache: None) -> None:
    kernel = every_operation()
    compiled, function = build_kernels(lambda: [kernel]).every, function_of(kernel)
    points = [(0.3, 0.7), (-1.25, 2.0), (2.0, 2.0), (0.0, -0.0), (-3.7, 0.1), (1e-9, -4.5), (7.0, 0.0), (-0.0, 1e-300)]
    for x, y in points:
        expected = np.array(function(x, y).nonzeros())
        np.testing.assert_array_equal(compiled(x, y), expected)


@needs_compiler
@pytest.mark.parametrize("kernel", toy_kernels.KERNELS, ids=lambda kernel: kernel.name)
def test_compiled_kernels_agree_with_the_interpreter_to_the_last_bit(kernel: Kernel, private_cache: None) -> None:
    import random

    from lie_codegen.kernel.casadi_arithmetic import flatten

    library = build_kernels(lambda: toy_kernels.KERNELS)
    function, compiled = function_of(kernel), library[kernel.name]
    rng = random.Random(3)
    for _ in range(20):
        flat = [flatten(port, value) for port, value in zip(kernel.inputs, kernel.sample(rng), strict=True)]
        arguments = [
            np.array(values).view(np.complex128 if port.is_complex else float).reshape(port.shape)
            for port, values in zip(kernel.inputs, flat, strict=True)
        ]
        results = compiled(*arguments)
        results = results if isinstance(results, tuple) else (results,)
        for result, expected in zip(results, function.call(flat), strict=True):
            np.testing.assert_array_equal(np.atleast_1d(result).reshape(-1).view(float), expected.nonzeros())


@needs_compiler
def test_emitter_agrees_with_casadis_own_generator(tmp_path: Path, private_cache: None) -> None:
    """The same Function through CasADi's C generator, compiled with the same flags."""
    function = function_of(toy_kernels.EXP)
    generator = ca.CodeGenerator("theirs.c")
    generator.add(function)
    generator.generate(f"{tmp_path}/")
    flags = ["-O2", "-std=c99", "-ffp-contract=off", "-fPIC", "-shared"]
    subprocess.run([str(COMPILER), *flags, "-o", "theirs.so", "theirs.c", "-lm"], cwd=tmp_path, check=True)
    theirs = ca.external(function.name(), str(tmp_path / "theirs.so"))
    ours = build_kernels(lambda: toy_kernels.KERNELS).exp
    for x in np.random.default_rng(5).normal(size=(50, 3)) * np.logspace(-6, 1, 50)[:, None]:
        np.testing.assert_array_equal(ours(x).reshape(-1), theirs(x).nonzeros())


@needs_compiler
def test_the_branch_not_taken_does_not_leak_nan(private_cache: None) -> None:
    def body(ops: Any, x: Any) -> tuple[Any, ...]:
        return ops.where(ops.less(x, 1.0), 2.0 + x, ops.log(x - 1.0)), ops.where(ops.less(1.0, x), 1 / (x - x), 7.0)

    kernel = Kernel("branch", "toy", (Port("x", ()),), (Port("y", ()), Port("z", ())), body)
    function = build_kernels(lambda: [kernel]).branch
    assert function(0.5) == (2.5, 7.0)
    assert function(2.0).y == 0.0
    assert math.isinf(function(2.0).z) or math.isnan(function(2.0).z)


def test_if_else_becomes_one_select() -> None:
    ops = [statement.op for statement in tape_of(toy_kernels.EXP).statements]
    assert ops.count("SELECT") == 3
    assert "IF_ELSE_ZERO" not in ops
    assert "NOT" not in ops


def test_inputs_come_first_and_every_operand_before_its_use() -> None:
    for kernel in toy_kernels.KERNELS:
        tape = tape_of(kernel)
        loads = [index for index, statement in enumerate(tape.statements) if statement.op == "INPUT"]
        assert loads == list(range(len(loads)))
        for index, statement in enumerate(tape.statements):
            assert all(operand < index for operand in statement.operands)


def test_sine_and_cosine_of_one_argument_are_neighbours() -> None:
    statements = tape_of(toy_kernels.RATE).statements
    for index, statement in enumerate(statements):
        if statement.op == "SIN":
            cosines = [
                i for i, other in enumerate(statements) if other.op == "COS" and other.operands == statement.operands
            ]
            assert [abs(i - index) for i in cosines] == [1]


def test_dead_code_is_gone() -> None:
    x = ca.SX.sym("x", 3)
    tape = tape_of_function(ca.Function("f", [x], [x[1] + 0 * ca.sin(x[0])]))
    assert [statement.op for statement in tape.statements] == ["INPUT"]


def test_free_symbols_and_matrix_functions_are_refused() -> None:
    x, p = ca.SX.sym("x"), ca.SX.sym("p")
    with pytest.raises(CodegenError, match="p"):
        tape_of_function(ca.Function("f", [x], [x + p], {"allow_free": True}))
    m = ca.MX.sym("m")
    with pytest.raises(CodegenError, match="not a CasADi SX function"):
        tape_of_function(ca.Function("f", [m], [ca.sin(m)]))


def test_an_operation_without_c_form_is_refused_by_name() -> None:
    kernel = Kernel("odd", "toy", (Port("x", ()),), (Port("y", ()),), lambda ops, x: (ca.erfinv(x),))
    with pytest.raises(CodegenError, match="ERFINV"):
        render_library("toy", [kernel])


@pytest.mark.parametrize("value", [0.1, -0.0, 1e-300, 5e-324, 1.7976931348623157e308, 1 / 3, -2.5e-17, 1e22])
def test_literals_read_back_exactly(value: float) -> None:
    text = c_literal(value)
    assert math.copysign(1, float(text.strip("()"))) == math.copysign(1, value)
    assert float(text.strip("()")) == value
    assert any(mark in text for mark in ".en")


def test_infinite_literals_have_names() -> None:
    assert c_literal(math.inf) == "HUGE_VAL"
    assert c_literal(-math.inf) == "(-HUGE_VAL)"
    assert "NAN" in c_literal(math.nan)


def test_target_decides_the_c_type() -> None:
    assert C99.expression("ADD", ("a", "b")) == "a + b"
    with pytest.raises(CodegenError, match="NOSUCH"):
        C99.expression("NOSUCH", ())


@needs_compiler
def test_an_output_array_may_be_an_input_array(private_cache: None) -> None:
    library = build_kernels(lambda: toy_kernels.KERNELS)
    x, energy = np.array([0.3, 0.4]), np.empty(1)
    expected = library.step(x, 0.1, 0.01)
    pointer, scalar = ctypes.c_void_p, ctypes.c_double
    function = ctypes.CDLL(str(library.path)).toy_step
    function.argtypes, function.restype = (pointer, scalar, scalar, pointer, pointer), None
    function(x.ctypes.data, 0.1, 0.01, x.ctypes.data, energy.ctypes.data)
    np.testing.assert_array_equal(x, expected.x_next)
    assert energy[0] == expected.energy


def test_names_that_CasADi_forbids_are_names_of_C() -> None:
    for name in ("a__b", "jac", "x_"):
        function = function_of(Kernel(name, "g_", (Port("x", ()),), (Port("y", ()),), lambda ops, x: (2 * x,)))
        assert function(3) == 6


def test_a_body_that_gives_another_shape_than_its_port_is_refused() -> None:
    short = Kernel("f", "g", (Port("x", ()),), (Port("y", (3,)),), lambda ops, x: ([x],))
    with pytest.raises(ShapeError, match="gives 1 real numbers for the output y, which is declared with 3"):
        function_of(short)
