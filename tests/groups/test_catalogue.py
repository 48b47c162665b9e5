"""The catalogue: every file and family is a group, with the brackets it is known for."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.cli.catalogue_table import catalogue_table
from lie_codegen.errors import GroupFileError, InputError, UnknownGroupError
from lie_codegen.groups.catalogue_names import FAMILY_EXAMPLES, definition_source, family_of, group_names, is_generated
from lie_codegen.groups.families import family

DIMENSIONS = {
    "aff1": 2, "engel": 4, "gl2": 4, "h3": 3, "h5": 5, "osc4": 4, "r3": 3, "se2": 3, "se3": 6, "se_2_3": 9, "sgal3": 10,
    "sim2": 4, "sim3": 7, "sl2": 3, "sl3": 8, "so2": 1, "so3": 3, "so31": 6, "so4": 6, "sp4": 10, "su2": 3, "su3": 8,
}  # fmt: skip
LABELS = {
    "so3": ("w1", "w2", "w3"),
    "se3": ("w1", "w2", "w3", "v1", "v2", "v3"),
    "se2": ("omega", "vx", "vy"),
    "su2": ("sx", "sy", "sz"),
    "sl2": ("h", "e", "f"),
    "h3": ("x", "y", "z"),
}


def test_the_catalogue_holds_what_it_promises() -> None:
    assert {name: lc.group(name).dim for name in group_names()} == DIMENSIONS
    assert {name: lc.group(name).labels for name in LABELS} == LABELS


@pytest.mark.parametrize("name", ["so3", "su6"])
def test_a_group_and_its_algebra_print_in_a_line(name: str) -> None:
    group = lc.group(name)
    for printed in (repr(group), repr(group.algebra)):
        assert name in printed
        assert len(printed) < 160


@pytest.mark.parametrize("name", [*group_names(), *FAMILY_EXAMPLES])
def test_commutators_follow_the_structure_constants(name: str) -> None:
    group = lc.group(name)
    assert group.name == name
    commutators = np.einsum("iab,jbc->ijac", group.basis, group.basis)
    commutators = commutators - commutators.swapaxes(0, 1)
    expected = np.tensordot(group.algebra.structure_constants, group.basis, axes=(2, 0))
    np.testing.assert_allclose(commutators, expected, atol=1e-15)


@pytest.mark.parametrize("name", [name for name in group_names() if family_of(name)])
def test_files_of_family_members_are_what_the_family_makes(name: str) -> None:
    ours, made = lc.group(name), family(name)
    assert (ours.labels, ours.units, ours.exact_basis) == (made.labels, made.units, made.exact_basis)


@pytest.mark.parametrize(
    ("name", "form"),
    [
        ("so5", np.eye(5)),
        ("so31", np.diag([1.0, 1, 1, -1])),
        ("so22", np.diag([1.0, 1, -1, -1])),
        ("so_1_2", np.diag([1.0, -1, -1])),
        ("sp6", np.block([[np.zeros((3, 3)), np.eye(3)], [-np.eye(3), np.zeros((3, 3))]])),
    ],
)
def test_matrices_preserve_the_form_of_their_family(name: str, form: np.ndarray) -> None:
    for A in lc.group(name).basis:
        np.testing.assert_array_equal(A.T @ form + form @ A, 0)


def test_unitary_and_special_families() -> None:
    for name in ("su2", "su3", "su4"):
        group = lc.group(name)
        assert group.is_complex
        for A in group.basis:
            np.testing.assert_allclose(A + A.conj().T, 0, atol=1e-16)
            assert abs(np.trace(A)) < 1e-15
        gram = np.einsum("iab,jba->ij", group.basis, group.basis)
        np.testing.assert_allclose(gram, -np.eye(group.dim) / 2, atol=1e-15)
    for name in ("sl2", "sl3", "sl4"):
        assert np.trace(lc.group(name).basis, axis1=1, axis2=2).any() == np.False_


@pytest.mark.parametrize(
    ("name", "brackets"),
    [
        ("osc4", {("J", "P"): {"Q": 1}, ("J", "Q"): {"P": -1}, ("P", "Q"): {"Z": 1}}),
        ("engel", {("x1", "x2"): {"x3": 1}, ("x1", "x3"): {"x4": 1}}),
        ("h5", {("x1", "y1"): {"z": 1}, ("x2", "y2"): {"z": 1}}),
        ("aff1", {("d", "t"): {"t": 1}}),
        ("sl2", {("h", "e"): {"e": 2}, ("h", "f"): {"f": -2}, ("e", "f"): {"h": 1}}),
        ("se2", {("omega", "vx"): {"vy": 1}, ("omega", "vy"): {"vx": -1}}),
    ],
)
def test_brackets_known_from_the_books(name: str, brackets: dict) -> None:
    group = lc.group(name)
    assert lc.from_brackets(name, group.labels, brackets).algebra == group.algebra


def test_galilean_boosts_move_positions_in_time() -> None:
    algebra = lc.group("sgal3").algebra
    found = algebra.bracket({algebra.index("v2"): 1}, {algebra.index("t"): 1})
    assert found == {algebra.index("p2"): 1}


@pytest.mark.parametrize("name", ["sp5", "h4", "so1", "su1", "sl1", "se1", "sp99", "su9", "r0", "so_0_3", "gl0"])
def test_members_that_a_family_does_not_have(name: str) -> None:
    with pytest.raises(InputError):
        lc.group(name)


@pytest.mark.parametrize("name", ["so", "spin3", "e8", "../so3", "so3 ", "so-3", "", "so５"])
def test_unknown_names_list_what_there_is(name: str) -> None:
    with pytest.raises(UnknownGroupError, match=r"so3.*so5"):
        lc.group(name)


def test_definition_source_needs_no_sympy() -> None:
    assert definition_source("so5") == b"family so5"
    assert definition_source("so3").startswith(b'name = "so3"')
    assert is_generated("sl4")
    assert not is_generated("sl3")
    with pytest.raises(GroupFileError, match=r"absent\.toml"):
        definition_source("absent.toml")
    code = "import sys, lie_codegen.groups.catalogue_names as c; c.definition_source('sl4'); c.group_names(); "
    code += "sys.exit('sympy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_table_has_a_row_for_each_group() -> None:
    lines = catalogue_table(with_times=True).splitlines()
    assert len(lines) == len(group_names()) + 2
    [row] = [line for line in lines if line.startswith("| se3 |")]
    assert row.startswith("| se3 | 6 | 4 x 4 real | Levi + radical | \\|g2\\| < pi/2 | cos(g2) | ")
    assert row.endswith(" s |")


@pytest.mark.parametrize(
    ("written", "name"),
    [("SO3", "so3"), ("SO(3)", "so3"), ("se(3)", "se3"), ("SE_2(3)", "se_2_3"), ("SO(3,1)", "so31"), ("Sp(4)", "sp4"), ("SL(4)", "sl4")],
)  # fmt: skip
def test_names_are_understood_as_books_write_them(written: str, name: str) -> None:
    assert lc.group(written) == lc.group(name)
    assert lc.build(written).namespace == lc.group(name).name


def test_a_group_is_the_group_of_itself() -> None:
    so3 = lc.group("so3")
    assert lc.group(so3) is so3
