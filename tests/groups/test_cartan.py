"""Cartan involutions from the brackets: dimensions known from the classification, in any basis and representation."""

from __future__ import annotations

import numpy as np
import pytest
from generators import adjoint_group, generic_basis, spin_group

import lie_codegen as lc
from lie_codegen.errors import AlgebraError
from lie_codegen.groups.wei_norman.chart_domain import chart_domain

#: dim of the maximal compact subgroup: SO(n) of SL(n), U(2) of Sp(4), SO(3) of SO(3,1), the group itself where it is compact.
COMPACT = {"sl2": 1, "sl3": 3, "sl4": 6, "sp4": 4, "so31": 3, "so3": 3, "so4": 6, "su2": 3, "su3": 8}


@pytest.mark.parametrize(
    ("name", "basis"),
    [
        pytest.param(name, basis, marks=[pytest.mark.slow] if (name, basis) == ("su3", "generic") else [])
        for name in COMPACT
        for basis in ("own", "generic")
    ],
)
def test_involutions_are_automorphisms_with_a_positive_form_and_the_known_compact_part(name: str, basis: str) -> None:
    group = lc.group(name)
    if basis == "generic":
        group = generic_basis(group, np.random.default_rng(3))
    found = lc.cartan_involution(group)
    assert found.compact == COMPACT[name]
    theta, n = found.theta, group.dim
    np.testing.assert_allclose(theta @ theta, np.eye(n), atol=1e-8 * max(1, np.max(np.abs(theta)) ** 2))
    ads = np.array([[group.vee(a @ b - b @ a) for b in group.basis] for a in group.basis])  # [i][j] = [A_i, A_j]
    mapped = np.einsum("ijk,mk->ijm", ads, theta)
    direct = np.einsum("ai,bj,abm->ijm", theta, theta, ads)
    np.testing.assert_allclose(mapped, direct, atol=1e-7 * np.max(np.abs(mapped)))
    killing = np.einsum("iab,jba->ij", ads, ads)
    form = -killing @ theta
    np.testing.assert_allclose(form, form.T, atol=1e-7 * np.max(np.abs(form)))
    assert np.linalg.eigvalsh((form + form.T) / 2)[0] > 0
    assert basis == "generic" or found.exact == (name != "su3")


def test_the_involution_of_a_levi_part_and_none_of_a_solvable_group() -> None:
    assert lc.cartan_involution("se3").compact == 3
    assert lc.cartan_involution("se3").exact
    with pytest.raises(AlgebraError, match="solvable"):
        lc.cartan_involution("h3")


@pytest.mark.parametrize(("plain", "other"), [("sl2", "adjoint"), ("so3", "adjoint"), ("so3", "spin")])
def test_verdicts_on_charts_do_not_depend_on_the_representation(plain: str, other: str) -> None:
    group = lc.group(plain)
    twin = adjoint_group(group) if other == "adjoint" else spin_group(3)
    mine, theirs = lc.wei_norman_order(group), lc.wei_norman_order(twin)
    assert mine.domain.end == theirs.domain.end
    assert (mine.changed_domain is None) == (theirs.changed_domain is None)
    if mine.changed_domain is not None and theirs.changed_domain is not None:
        assert mine.changed_domain.end == theirs.changed_domain.end


@pytest.mark.parametrize("name", ["se3", "so4", pytest.param("su3", marks=pytest.mark.slow), "sp4", "sim3"])
def test_generic_bases_get_a_short_verdict_that_says_what_is_numeric(name: str) -> None:
    group = generic_basis(lc.group(name), np.random.default_rng(1))
    found = lc.wei_norman_order(group)
    assert found.truncated
    assert len(found.reason) <= 2000
    assert "numeric, not proved" in found.reason
    if name in ("se3", "sim3"):
        assert found.changed_domain.end == "walls"
        assert len(found.changed_domain.walls) == 1
        assert len(found.changed_domain.text) < 300


def test_an_order_without_walls_is_never_given_up_for_one_with() -> None:
    for name in ("sl2", "sl3", "sp4", "gl2"):
        group = lc.group(name)
        assert chart_domain(group).walls == ()
        assert lc.wei_norman_order(group).domain.walls == ()
