"""The C package in single precision: strict, right to single precision, and without a double for small processors."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
import toy_kernels
from operation_kernels import every_operation

import lie_codegen as lc
from lie_codegen.codegen.generate import generate
from lie_codegen.codegen.opcodes import C99_FLOAT_FORMS, C99_FORMS, c_float_literal
from lie_codegen.errors import CodegenError
from lie_codegen.kernel.kernel import Kernel, Port

STRICT = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-Wshadow", "-Wdouble-promotion"]
COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]
SMALL = "arm-none-eabi-gcc"
ARM, EMULATOR = "arm-linux-gnueabihf-gcc", "qemu-arm"

needs_compiler = pytest.mark.skipif(not COMPILERS, reason="needs a C compiler")


def run(*command: str, folder: Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module", params=["se3", "su2"])
def package(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    name = request.param
    return lc.generate(lc.group(name), tmp_path_factory.mktemp("float") / name, real="float")


@needs_compiler
@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_example_passes(package: Path, compiler: str) -> None:
    name = package.name
    run(compiler, *STRICT, "-O2", "-Iinclude", "example.c", f"src/{name}.c", "-lm", "-o", "example", folder=package)
    lines = run("./example", folder=package).splitlines()
    assert len(lines) == len(lc.build(name).kernels)
    assert all(line.endswith(" ok") for line in lines)
    assert all(float(line.split()[-2]) < 1e-6 for line in lines)


@pytest.mark.skipif(not shutil.which(SMALL), reason=f"needs {SMALL}")
def test_a_small_processor_needs_no_double(package: Path) -> None:
    machine = ["-mcpu=cortex-m4", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"]
    run(SMALL, *machine, *STRICT, "-Os", "-Iinclude", "-c", f"src/{package.name}.c", "-o", "m4.o", folder=package)
    undefined = run(SMALL.replace("gcc", "nm"), "-u", "m4.o", folder=package).split()[1::2]
    assert not [name for name in undefined if name.startswith("__aeabi_d") or name.startswith("__aeabi_f2d")]
    assert all(name.endswith("f") or name.startswith(("mem", "__aeabi")) for name in undefined), undefined


@pytest.mark.skipif(not (shutil.which(ARM) and shutil.which(EMULATOR)), reason=f"needs {ARM} and {EMULATOR}")
def test_the_example_passes_on_an_emulated_processor(package: Path) -> None:
    source = f"src/{package.name}.c"
    run(ARM, "-static", "-O2", "-Iinclude", "example.c", source, "-lm", "-o", "example_arm", folder=package)
    assert "WRONG" not in run(EMULATOR, "./example_arm", folder=package)


@needs_compiler
@pytest.mark.parametrize("name", ["so3", "se3", "su2", "so4", "su3", "sl2", "sim3"])
def test_the_logarithm_computes_in_single_precision(name: str, tmp_path: Path) -> None:
    """exp(-hat log X) X is 1 to single precision, of elements rounded to floats; in C without one double."""
    group = lc.group(name)
    folder = lc.generate(group, tmp_path / "p", real="float")
    assert not re.search(r"\bdouble\b", (folder / "src" / f"{name}.c").read_text())
    run(
        COMPILERS[-1],
        *STRICT,
        "-O1",
        "-Iinclude",
        "-shared",
        "-fPIC",
        f"src/{name}.c",
        "-lm",
        "-o",
        "lib.so",
        folder=folder,
    )
    log = getattr(ctypes.CDLL(str(folder / "lib.so")), f"{name}_log")
    rng = np.random.default_rng(7)
    real = np.complex64 if np.iscomplexobj(group.basis) else np.float32
    for size in np.repeat([1e-3, 0.3, 1.0, 2.0], 50):
        X = scipy.linalg.expm(group.hat(size * rng.normal(size=group.dim)))
        rounded = np.ascontiguousarray(X.astype(real))
        x = np.zeros(group.dim, dtype=np.float32)
        log(rounded.ctypes.data_as(ctypes.c_void_p), x.ctypes.data_as(ctypes.c_void_p))
        kappa = np.linalg.norm(X) * np.linalg.norm(np.linalg.inv(X))
        left = scipy.linalg.expm(-group.hat(x.astype(float))) @ X
        assert np.linalg.norm(left - np.eye(len(X))) < 2e-6 * kappa


@needs_compiler
def test_every_operation_compiles_strictly(tmp_path: Path) -> None:
    folder = generate([every_operation(), *toy_kernels.KERNELS], tmp_path / "toy", namespace="toy", real="float")
    source = (folder / "src" / "toy.c").read_text()
    assert "double" not in source
    for compiler in COMPILERS:
        run(compiler, *STRICT, "-Wfloat-conversion", "-Iinclude", "-c", "src/toy.c", folder=folder)


def test_the_forms_name_no_double() -> None:
    assert C99_FLOAT_FORMS.keys() == C99_FORMS.keys()
    assert C99_FLOAT_FORMS["SIN"] == "sinf({0})"
    assert C99_FLOAT_FORMS["LT"] == "(float)({0} < {1})"
    assert C99_FLOAT_FORMS["IF_ELSE_ZERO"] == "{0} != 0.0f ? {1} : 0.0f"
    assert not any("double" in form for form in C99_FLOAT_FORMS.values())


@pytest.mark.parametrize("value", [0.0, -0.0, 0.1, -1 / 3, 1e30, 16777217.0, 2.0, 1.5e-45, float("inf")])
def test_literals_are_the_nearest_floats(value: float) -> None:
    text = c_float_literal(value).strip("()")
    if value == float("inf"):
        assert text == "HUGE_VALF"
        return
    assert text.endswith("f")
    expected = np.float32(value) if abs(value) > 1e-37 or value == 0 else np.float32(1.17549435e-38)
    assert np.float32(text[:-1]) == expected
    assert np.signbit(np.float32(text[:-1])) == np.signbit(value)


def test_what_no_float_can_hold_is_refused(tmp_path: Path) -> None:
    kernel = Kernel("big", "toy", (Port("x", ()),), (Port("y", ()),), lambda ops, x: (1e300 * x,))
    with pytest.raises(CodegenError, match="single precision"):
        generate([kernel], tmp_path / "big", namespace="toy", real="float")
    with pytest.raises(CodegenError, match="double, float"):
        generate([toy_kernels.RATE], tmp_path / "half", namespace="toy", real="half")
    assert not list(tmp_path.iterdir())
