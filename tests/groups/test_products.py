"""Direct and semidirect products, reordering and changes of basis."""

from __future__ import annotations

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.errors import AlgebraError, DependentBasisError, IdentifierError, InputError, ShapeError

SP2_ON_H3 = {
    "h": [[1, 0, 0], [0, -1, 0], [0, 0, 0]],
    "e": [[0, 1, 0], [0, 0, 0], [0, 0, 0]],
    "f": [[0, 0, 0], [1, 0, 0], [0, 0, 0]],
}


def test_a_direct_product_keeps_different_labels() -> None:
    group = lc.product(lc.group("so3"), lc.group("sl2"), name="both")
    assert group.name == "both"
    assert group.labels == ("w1", "w2", "w3", "h", "e", "f")
    assert group.degree == 5
    assert not any(i < 3 <= j for i, j in group.algebra.table)


def test_labels_of_products_are_made_different_predictably() -> None:
    so3, se3 = lc.group("so3"), lc.group("se3")
    assert lc.product(so3, se3).labels[:4] == ("so3_w1", "so3_w2", "so3_w3", "se3_w1")
    assert lc.product(so3, so3).labels == ("so3_1_w1", "so3_1_w2", "so3_1_w3", "so3_2_w1", "so3_2_w2", "so3_2_w3")
    assert lc.product(so3, so3).name == "so3_x_so3"
    with pytest.raises(IdentifierError):
        lc.product(so3, so3, name="a b")


def test_a_product_with_a_complex_group_is_complex() -> None:
    group = lc.product(lc.group("su2"), lc.group("r3"))
    assert group.is_complex
    assert group.units == ("rad", "rad", "rad", "m", "m", "m")
    commutator = group.basis[0] @ group.basis[1] - group.basis[1] @ group.basis[0]
    np.testing.assert_allclose(commutator, group.basis[2])


def test_rotations_on_vectors_are_rigid_motions() -> None:
    group = lc.semidirect(lc.group("so3"), lc.group("r3"), name="poses")
    assert group.exact_basis == lc.group("se3").exact_basis
    assert group.algebra.table == lc.group("se3").algebra.table


def test_a_given_action_on_a_nonabelian_group() -> None:
    group = lc.semidirect(lc.group("sl2"), lc.group("h3"), SP2_ON_H3)
    assert group.labels == ("h", "e", "f", "x", "y", "z")
    commutators = np.einsum("iab,jbc->ijac", group.basis, group.basis)
    commutators = commutators - commutators.swapaxes(0, 1)
    np.testing.assert_allclose(
        commutators, np.tensordot(group.algebra.structure_constants, group.basis, axes=(2, 0)), atol=1e-14
    )
    assert lc.structure(group).kind == "Levi + radical"


def test_actions_that_are_none() -> None:
    sl2, h3, so3, r3 = (lc.group(name) for name in ("sl2", "h3", "so3", "r3"))
    with pytest.raises(AlgebraError, match="no derivation"):
        lc.semidirect(sl2, h3, {"h": [[1, 0, 0], [0, -1, 0], [0, 0, 1]]})
    with pytest.raises(AlgebraError, match="does not follow the brackets"):
        lc.semidirect(sl2, h3, {"h": SP2_ON_H3["h"]})
    with pytest.raises(ShapeError, match="2 matrices for the 3"):
        lc.semidirect(so3, r3, [np.eye(3), np.eye(3)])
    with pytest.raises(ShapeError, match="2 x 2, not 3 x 3"):
        lc.semidirect(so3, r3, [np.eye(2)] * 3)
    with pytest.raises(InputError, match="not one of"):
        lc.semidirect(so3, r3, {"w9": np.eye(3)})
    with pytest.raises(InputError, match="without an action"):
        lc.semidirect(so3, h3)
    with pytest.raises(InputError, match="not real"):
        lc.semidirect(lc.group("so2"), r3, [[["i", 0, 0], [0, 0, 0], [0, 0, 0]]])


def test_reorder_is_undone_by_reordering_back() -> None:
    group = lc.group("se3")
    order = ("v3", "w1", "v1", "w2", "w3", "v2")
    assert group.reorder(order).reorder(group.labels) == group
    with pytest.raises(InputError, match="not a reordering"):
        group.reorder(("w1", "w2"))


def test_changes_of_basis_that_are_none() -> None:
    sl2 = lc.group("sl2")
    with pytest.raises(InputError, match="2 combinations for a basis of 3"):
        lc.change_of_basis(sl2, {"a": {"h": 1}, "b": {"e": 1}})
    with pytest.raises(DependentBasisError):
        lc.change_of_basis(sl2, {"a": {"h": 1}, "b": {"e": 1}, "c": {"h": 2, "e": 3}})
    with pytest.raises(InputError, match="basis element c"):
        lc.change_of_basis(sl2, {"a": {"h": 1}, "b": {"e": 1}, "c": {"q": 2}})
    with pytest.raises(InputError, match="basis element c"):
        lc.change_of_basis(sl2, {"a": {"h": 1}, "b": {"e": 1}, "c": {"f": 0.1}})


def test_what_is_no_definition_is_named() -> None:
    for call, words in (
        (lambda: lc.product(lc.group("so3"), 5), "expected a group"),
        (lambda: lc.group(None), "name of a group"),
        (lambda: lc.from_matrices("a", ["x"], 5), "list of matrices"),
        (lambda: lc.from_brackets("a", ["x", "y"], {("x", "y"): "y"}), "must be a mapping"),
        (lambda: lc.from_brackets("a", ["x", "y"], [1]), "must be a mapping"),
        (lambda: lc.change_of_basis(lc.group("so3"), 3), "new label"),
        (lambda: lc.group("so3").hat("x"), "must be an array of real numbers"),
        (lambda: lc.group("so3").hat([1j, 0, 0]), "must be an array of real numbers"),
        (lambda: lc.group("so3").vee("x"), "must be an array of numbers"),
        (lambda: lc.generate(lc.group("so3"), None), "must be a path"),
    ):
        with pytest.raises(InputError, match=words):
            call()
