"""The peers of the benchmark: the same kernel through CasADi, numba, jax and numpy, where they are installed."""

from __future__ import annotations

import ctypes
import importlib
import importlib.util
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.benchmarks.rows import AbsentError
from lie_codegen.codegen.opcodes import Target
from lie_codegen.codegen.tape import tape_of
from lie_codegen.codegen.templates import render, template_folder
from lie_codegen.codegen.views import kernel_view
from lie_codegen.errors import InputError, MissingDependencyError
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.runtime.compiler import Compiler, compile_library, find_compilers

#: What a C programmer would choose.
FLAGS = ("-std=c99", "-O3", "-march=native", "-fno-math-errno", "-fPIC", "-shared")

_BOTH = {
    "ADD": "{0} + {1}", "SUB": "{0} - {1}", "MUL": "{0} * {1}", "DIV": "{0} / {1}", "NEG": "-{0}", "INV": "1.0 / {0}",
    "TWICE": "2.0 * {0}", "SQ": "{0} * {0}", "SQRT": "m.sqrt({0})", "EXP": "m.exp({0})", "LOG": "m.log({0})",
    "SIN": "m.sin({0})", "COS": "m.cos({0})", "TAN": "m.tan({0})", "SINH": "m.sinh({0})", "COSH": "m.cosh({0})",
    "TANH": "m.tanh({0})", "FABS": "m.fabs({0})", "LT": "{0} < {1}", "LE": "{0} <= {1}", "EQ": "{0} == {1}",
}  # fmt: skip


def _literal(value: float) -> str:
    """A double in Python, infinity and NaN by the module's names."""
    return repr(value) if math.isfinite(value) else f"(-m.{-value})" if value < 0 else f"m.{value}"


SCALAR = Target(
    "numba",
    {**_BOTH, "ATAN2": "m.atan2({0}, {1})", "NOT": "not {0}", "SELECT": "{1} if {0} else {2}", "IF_ELSE_ZERO": "{1} if {0} else 0.0"},
    _literal,
)  # fmt: skip
ARRAYS = Target(
    "arrays",
    {**_BOTH, "ATAN2": "m.arctan2({0}, {1})", "NOT": "m.logical_not({0})", "SELECT": "m.where({0}, {1}, {2})",
     "IF_ELSE_ZERO": "m.where({0}, {1}, 0.0)"},
    _literal,
    "{0}[..., {1}]",
)  # fmt: skip


def is_there(name: str) -> bool:
    """Whether the module of a peer is installed."""
    return importlib.util.find_spec(name.partition(".")[0]) is not None


def need(name: str) -> Any:
    """The module of a peer.

    Raises:
        AbsentError: it is not installed.
    """
    if not is_there(name):
        raise AbsentError("not installed")
    return importlib.import_module(name)


def as_python(kernel: Kernel, folder: Path, module: str, *, scalars: bool) -> Any:
    """The kernel as a Python module over `module` (math, numpy, jax.numpy)."""
    view = kernel_view(kernel, tape_of(kernel, routines=False), SCALAR if scalars else ARRAYS)
    name = f"{kernel.symbol}_{module.replace('.', '_')}"
    file = folder / f"{name}.py"
    file.write_text(render("bench_peer.py.jinja", kernel=view, module=module, scalars=scalars), encoding="utf-8")
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None:
        raise InputError(f"cannot load {file}")
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


def instructions(kernel: Kernel) -> int:
    """The length of its program."""
    return len(tape_of(kernel).statements)


def as_casadi_c(kernel: Kernel, folder: Path) -> tuple[ctypes.CDLL, Any]:
    """CasADi's C in loops, compiled; and the same function loaded by CasADi as an external."""
    import casadi as ca

    from lie_codegen.kernel.casadi_arithmetic import function_of

    function = function_of(kernel)
    generator = ca.CodeGenerator(f"{kernel.symbol}_casadi.c", {"casadi_int": "long long int"})
    generator.add(function)
    (folder / f"{kernel.symbol}_casadi.c").write_text(generator.dump(), encoding="utf-8")
    view = kernel_view(kernel, tape_of(kernel, routines=False))
    main = f"{kernel.symbol}_loop.c"
    (folder / main).write_text(render("bench_loop.c.jinja", kernel=view, work=function.sz_w() + 8), encoding="utf-8")
    output = f"{kernel.symbol}_loop.so"
    compile_library(_compiler(), folder, main, output, FLAGS)
    return ctypes.CDLL(str(folder / output)), ca.external(kernel.symbol, str(folder / output))


def _compiler() -> Compiler:
    compilers = find_compilers()
    if not compilers:
        raise MissingDependencyError("the benchmark needs a C compiler")
    return compilers[0]


def hand_written(folder: Path) -> ctypes.CDLL:
    """The hand-written loop and the limits of the machine."""
    (folder / "hand.c").write_text((template_folder() / "bench_hand.c").read_text(encoding="utf-8"), encoding="utf-8")
    compile_library(_compiler(), folder, "hand.c", "hand.so", (*FLAGS, "-ffp-contract=fast"))
    library = ctypes.CDLL(str(folder / "hand.so"))
    library.read_all.restype = library.multiply_add.restype = ctypes.c_double
    return library


def pointers(arrays: Sequence[np.ndarray[Any, Any]]) -> Any:
    """The addresses of arrays, for C."""
    return (ctypes.c_void_p * len(arrays))(*[array.ctypes.data for array in arrays])


def sizes(values: Sequence[int]) -> Any:
    """Integers, for C."""
    return (ctypes.c_ssize_t * len(values))(*values)


def jax_modules() -> tuple[Any, Any]:
    """jax with 64 bits on one core, and jax.numpy.

    Raises:
        AbsentError: it is not installed.
    """
    jax = need("jax")
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_platforms", "cpu")
    return jax, importlib.import_module("jax.numpy")
