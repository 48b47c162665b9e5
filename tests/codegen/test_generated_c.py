"""The C of real groups: strict in both compilers, right by its own vectors and by scipy's matrix exponential."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.codegen.generate import generate
from lie_codegen.codegen.views import PackageMetadata
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.runtime.build import build_kernels, interpreted
from lie_codegen.runtime.compiler import find_compilers
from lie_codegen.runtime.library import Library

STRICT = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-Wshadow"]
COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]
GROUPS = ("se2", "su2")

pytestmark = pytest.mark.skipif(not find_compilers(), reason="needs a C compiler")


@pytest.fixture(scope="module", params=GROUPS)
def made(request: pytest.FixtureRequest) -> tuple[lc.MatrixGroup, tuple[Kernel, ...]]:
    group = lc.group(request.param)
    return group, lc.group_kernels(group)


@pytest.fixture(scope="module")
def library(
    made: tuple[lc.MatrixGroup, tuple[Kernel, ...]], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Library]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LIE_CODEGEN_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield build_kernels(lambda: made[1])


def test_the_example_of_a_group_passes_in_both_compilers(
    made: tuple[lc.MatrixGroup, tuple[Kernel, ...]], tmp_path: Path
) -> None:
    group, kernels = made
    metadata = PackageMetadata(group.name, group.description, group.labels, group.units)
    folder = generate(kernels, tmp_path / group.name, namespace=group.name, metadata=metadata)
    for compiler in COMPILERS:
        command = [compiler, *STRICT, "-Iinclude", "example.c", f"src/{group.name}.c", "-lm", "-o", "example"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        done = subprocess.run(["./example"], cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout
        assert done.stdout.count(" ok\n") == len(kernels)


def test_compiled_equals_interpreted_to_the_last_bit(
    made: tuple[lc.MatrixGroup, tuple[Kernel, ...]], library: Library
) -> None:
    other = interpreted(made[1])
    rng = np.random.default_rng(11)
    g, u, x, y = rng.uniform(-0.7, 0.7, (4, 5, made[0].dim))
    X = library.exp.batch(x)
    arguments = {"g": g, "u": u, "x": x, "y": y, "X": X, "Y": X[::-1]}
    for name in library.kernels:
        chosen = [arguments[port.name] for port in library[name].inputs]
        expected = other[name].batch(*chosen)
        single = [library[name](*point) for point in zip(*chosen, strict=True)]
        np.testing.assert_array_equal(single, expected, err_msg=name)
        np.testing.assert_allclose(library[name].batch(*chosen), expected, rtol=1e-14, atol=1e-14, err_msg=name)


def test_compiled_product_of_exponentials_is_scipys(
    made: tuple[lc.MatrixGroup, tuple[Kernel, ...]], library: Library
) -> None:
    group, _ = made
    basis = [np.array(matrix.tolist(), dtype=complex) for matrix in group.basis]
    for g in np.random.default_rng(12).uniform(-1, 1, (20, group.dim)):
        expected = np.eye(group.degree, dtype=complex)
        for value, matrix in zip(g, basis, strict=True):
            expected = expected @ expm(value * matrix)
        np.testing.assert_allclose(library.product_exp(g), expected, atol=1e-13)
