"""Kernels, libraries and compiled kernels in files: what is loaded is equal and computes the same bits, here and elsewhere."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.errors import InputError

HEISENBERG = """
name = "mine"
labels = ["x", "y", "z"]

[matrices]
x = [[0, 1, 0], [0, 0, 0], [0, 0, 0]]
y = [[0, 0, 0], [0, 0, 1], [0, 0, 0]]
z = [[0, 0, 1], [0, 0, 0], [0, 0, 0]]
"""


def law(k_p: Any = 4) -> lc.Kernel:
    return lc.attitude_law("pd", inertia=(1, 2, 2), k_p=k_p, k_d=3, name="held")


def mine(tmp_path: Path) -> Path:
    file = tmp_path / "mine.toml"
    file.write_text(HEISENBERG)
    return file


def test_a_group_is_kept_in_a_file(tmp_path: Path) -> None:
    """Of the catalogue, reordered, of a file and of matrices with roots: equal, and the same code."""
    rows = [[["0", "sqrt(2)"], ["-sqrt(2)", "0"]]]
    for group in (
        lc.group("su3"),
        lc.group("se2").reorder(lc.group("se2").labels[::-1]),
        lc.group(mine(tmp_path)),
        lc.from_matrices("turn", ["w"], rows),
    ):
        again = lc.load(group.save(tmp_path / "group.npz"))
        assert again == group
        assert (again.labels, again.units, again.definition_text) == (group.labels, group.units, group.definition_text)
    x = np.array([0.3])
    np.testing.assert_array_equal(lc.build(again).exp(x), lc.build(group).exp(x))


def spring(ops: Any, x: Any) -> tuple[Any, ...]:
    return (2 * x[0],)


@lc.kernel_factory()
def sprung(name: str) -> lc.Kernel:
    return lc.Kernel(name, "demo", (lc.Port("x", (1,)),), (lc.Port("force", ()),), spring)


@pytest.mark.parametrize(
    "make",
    [
        law,
        lambda: law("input"),
        lambda: lc.build(law()),
        lambda: lc.build([law(), lc.attitude_law("p")], name="two"),
        lambda: lc.build("so3"),
        lambda: lc.build(lc.group("se2"), name="flight"),
        lambda: lc.build("so3", name="flight").exp,
        lambda: lc.build(law()).held,
    ],
)
def test_what_is_loaded_is_equal(make: Any, tmp_path: Path) -> None:
    made = make()
    again = lc.load(made.save(tmp_path / "kept.npz"))
    assert again == made
    assert type(again) is type(made)
    assert repr(again) == repr(made)
    assert again != lc.build("r3")


def test_a_loaded_law_computes_the_same_bits_in_another_process(tmp_path: Path) -> None:
    """The hexadecimal digits of V at one attitude, from the library, from the law and from one compiled kernel of it."""
    lib = lc.build(law())
    lib.save(tmp_path / "lib.npz")
    law().save(tmp_path / "law.npz")
    lib.held.save(tmp_path / "held.npz")
    code = (
        "import sys, lie_codegen as lc; X, w = lc.build('so3').exp([.3, -.2, .1]), [1, 2, 3]; at = sys.argv[1]; "
        "print(lc.load(at + '/lib.npz').held(X, w).V.hex(), lc.build(lc.load(at + '/law.npz')).held(X, w).V.hex(), "
        "lc.load(at + '/held.npz')(X, w).V.hex())"
    )
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, check=True)
    V = lib.held(lc.build("so3").exp([0.3, -0.2, 0.1]), [1, 2, 3]).V
    assert done.stdout.split() == [V.hex()] * 3


def test_a_library_of_a_group_file_does_not_need_the_file(tmp_path: Path) -> None:
    path = mine(tmp_path)
    lib = lc.build(path)
    x = [0.3, -1.0, 2.0]
    expected = lib.exp(x)
    lib.save(tmp_path / "lib.npz")
    path.unlink()
    again = lc.load(tmp_path / "lib.npz")
    assert again == lib
    np.testing.assert_array_equal(again.exp(x), expected)


def test_what_load_would_not_make_is_refused_at_once(tmp_path: Path) -> None:
    by_hand = lc.Kernel("spring", "demo", (lc.Port("x", (1,)),), (lc.Port("force", ()),), spring)
    for made in (by_hand, lc.build(by_hand), lc.build(by_hand).spring):
        with pytest.raises(InputError, match="cannot be saved: a function written by hand"):
            made.save(tmp_path / "no.npz")
    for made in (sprung("mine"), lc.build(sprung("mine")), lc.build(sprung("mine")).mine):
        with pytest.raises(InputError, match="no value of this package and cannot be saved; pickle it"):
            made.save(tmp_path / "no.npz")
    assert not (tmp_path / "no.npz").exists()
