"""Laws with names of their own, groups and both together in one C program or library."""

from __future__ import annotations

import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.runtime.compiler import find_compilers

needs_compiler = pytest.mark.skipif(not find_compilers(), reason="no C compiler")
MAIN = """
#include <stdio.h>
#include "soft.h"
#include "stiff.h"
#include "so3.h"
int main(void)
{
    const double x[3] = {0.1, 0.2, 0.3}, rest[3] = {0, 0, 0};
    double X[9], soft[3], stiff[3], V, V_dot;
    so3_exp(x, X);
    so3_soft(X, rest, soft, &V, &V_dot);
    so3_stiff(X, rest, stiff, &V, &V_dot);
    printf("%.17g %.17g", soft[0], stiff[0]);
    return 0;
}
"""


def law(name: str, k_p: Any) -> lc.Kernel:
    return lc.attitude_law("pd", inertia=(1, 2, 2), k_p=k_p, k_d=6, name=name)


@needs_compiler
def test_two_laws_and_their_group_are_one_program(tmp_path: Path) -> None:
    folders = [lc.generate(law(name, k_p), tmp_path / name, name=name) for name, k_p in (("soft", 4), ("stiff", 99))]
    assert "k_p = 4 [N m/rad]" in (folders[0] / "include" / "soft.h").read_text()
    assert "k_p = 99 [N m/rad]" in (folders[1] / "include" / "stiff.h").read_text()
    folders.append(lc.generate("so3", tmp_path / "so3"))
    (tmp_path / "main.c").write_text(MAIN)
    includes = [f"-I{folder / 'include'}" for folder in folders]
    sources = [str(path) for folder in folders for path in (folder / "src").glob("*.c")]
    command = ["gcc", "-std=c99", "-Wall", "-Werror", *includes, "main.c", *sources, "-lm", "-o", "main"]
    subprocess.run(command, cwd=tmp_path, check=True)
    done = subprocess.run([str(tmp_path / "main")], capture_output=True, text=True, check=True)
    np.testing.assert_allclose([float(x) for x in done.stdout.split()], [-0.4, -9.9], rtol=1e-12)


@needs_compiler
def test_one_package_of_several_namespaces(tmp_path: Path) -> None:
    home = lc.generate([law("soft", 4), "so3", lc.group("se2")], tmp_path / "firmware", name="firmware")
    subprocess.run(
        ["gcc", "-std=c99", "-Iinclude", "example.c", "src/firmware.c", "-lm", "-o", str(tmp_path / "example")],
        cwd=home,
        check=True,
    )
    done = subprocess.run([str(tmp_path / "example")], capture_output=True, text=True, check=True)
    assert "so3_exp " in done.stdout
    assert "se2_exp " in done.stdout
    assert "so3_soft " in done.stdout


def test_a_library_of_several_namespaces() -> None:
    exps = [lc.group_kernels(lc.group(name))[3] for name in ("so3", "se2")]
    lib = lc.build([*exps, law("soft", 4)], name="both")
    assert lib.kernels == ("so3_exp", "se2_exp", "soft")
    np.testing.assert_allclose(lib.se2_exp([0, 1, 2]), [[1, 0, 1], [0, 1, 2], [0, 0, 1]])
    with pytest.raises(lc.errors.InputError, match="so3_soft"):
        lc.build([law("soft", 4), law("soft", 5)])
    with pytest.raises(lc.errors.IdentifierError):
        lc.build(law("soft", 4), name="no name")


def test_the_library_of_a_group_is_called_as_asked(tmp_path: Path) -> None:
    """As in the package of that name: the header bears it, the symbols stay the group's."""
    for what in ("so3", lc.group("so3")):
        lib = lc.build(what, name="flight")
        plain = lc.build(what)
        assert (lib.namespace, plain.namespace) == ("flight", "so3")
        assert "library flight:" in repr(lib)
        assert lib != plain
        again = pickle.loads(pickle.dumps(lib))
        assert (again, again.namespace) == (lib, "flight")
        np.testing.assert_array_equal(lib.exp([0.1, 0.2, 0.3]), plain.exp([0.1, 0.2, 0.3]))
        with pytest.raises(lc.errors.IdentifierError):
            lc.build(what, name="no name")
    header = lc.generate("so3", tmp_path / "flight", name="flight") / "include" / "flight.h"
    assert "so3_exp(" in header.read_text()


def test_a_current_folder_is_left_alone(tmp_path: Path) -> None:
    home = lc.generate(law("soft", 4), tmp_path / "soft", name="soft")
    before = {path: path.stat().st_mtime_ns for path in home.rglob("*")}
    assert lc.generate(law("soft", 4), home, name="soft") == home
    assert {path: path.stat().st_mtime_ns for path in home.rglob("*")} == before
    lc.generate(law("soft", 5), home, name="soft")
    assert "k_p = 5" in (home / "include" / "soft.h").read_text()
    (home / "include" / "soft.h").write_text("mine")
    with pytest.raises(lc.errors.OutputFolderError, match="edited"):
        lc.generate(law("soft", 5), home, name="soft")


def test_a_warm_build_lowers_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LIE_CODEGEN_CACHE", str(tmp_path))  # its own: that of the whole run evicts
    lc.build(law("warm", 7))
    code = (
        "import sys, lie_codegen as lc; law = lc.attitude_law('pd', inertia=(1, 2, 2), k_p=7, k_d=6, name='warm'); "
        "lib = lc.build(law); print(lib.warm([[1, 0, 0], [0, 1, 0], [0, 0, 1]], [1, 0, 0]).V, 'casadi' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["0.5", "False"]
