"""Critical points of error functions against closed forms; a claim that fails is refused with its place."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.errors import InputError

GAINS = {"K": np.diag([4.0, 5, 6]), "L": np.diag([1.0, 2, 3])}


def tilted(c: float) -> object:
    """p + c p_2^2 of two trace functions: minima and saddles appear as c falls."""
    text = "tr(K*(1 - Xd^-1*X))/2 + c*(tr(L*(1 - Xd^-1*X))/2)^2"
    return lc.error_function("so3", text, parameters={**GAINS, "c": c})


@pytest.mark.parametrize(
    ("c", "values", "indices", "component"),
    [
        (-0.06, [0, 8.46, 9.04, 9.5], [0, 1, 2, 3], 8.46),
        (-0.25, [0, 4.75, 4.84, 4.84, 6, 6.75], [0, 0, 1, 1, 2, 3], 4.84),
    ],
)
def test_values_and_indices_of_a_family(c: float, values: list, indices: list, component: float) -> None:
    found = lc.critical_points(tilted(c))
    assert [point.value for point in found] == pytest.approx(values, abs=1e-9)
    assert [point.index for point in found] == indices
    assert found.status == "complete"
    assert found.euler == 0
    assert pytest.approx(values[1]) == found.L
    assert found.L_component == pytest.approx(component)


def test_negative_somewhere_is_refused_with_the_place() -> None:
    with pytest.raises(InputError, match=r"phi = -1.5 at a turn by 180 degrees about \(1, 0, 0\)"):
        lc.critical_points(tilted(-0.5))


@pytest.mark.parametrize(("name", "gains"), [("so3", [4, 5, 6]), ("so4", [1, 2, 3.5, 5])])
def test_trace_functions_have_the_sums_of_pairs(name: str, gains: list) -> None:
    found = lc.critical_points(f"{name}_right", group=name, gains={"K_p": gains})
    sums = [sum(each) for size in range(0, len(gains) + 1, 2) for each in itertools.combinations(gains, size)]
    assert [point.value for point in found] == pytest.approx(sorted(sums), abs=1e-9)
    for point in found:  # diagonal, with an even number of -1
        assert np.allclose(np.abs(point.X), np.eye(len(gains)), atol=1e-7)


@pytest.mark.parametrize(("name", "values"), [("sl2", [0, 4]), ("h3", [0]), ("su2", [0, 8])])
def test_frobenius_on_other_groups(name: str, values: list) -> None:
    found = lc.critical_points("frobenius", group=name, gains={"k_p": 1})
    assert [point.value for point in found] == pytest.approx(values, abs=1e-9)
    assert found.status == "complete"
    assert pytest.approx(values[1] if len(values) > 1 else float("inf")) == found.L


def test_equal_gains_give_a_critical_manifold() -> None:
    found = lc.critical_points("so3_right", group="so3", gains={"K_p": 2})
    assert (found.status, found.L, found.euler) == ("degenerate", pytest.approx(4), None)
    assert found[1].nullity == 2


def test_what_stays_bounded_has_no_level() -> None:
    found = lc.critical_points("frobenius", group="aff1", gains={"k_p": 1})
    assert found.status == "not proper"
    assert found.L is None


def test_a_false_constant_is_refused_and_a_modest_one_kept() -> None:
    still = {"X": np.eye(3), "xi": np.zeros(3), "X_d": np.eye(3), "xi_d": np.zeros(3)}
    text = "(3 - tr(Xd^-1*X))/2 - ((3 - tr(Xd^-1*X))/2)^2"
    negative = lc.error_function("so3", text, constant=50.0)
    with pytest.raises(InputError, match=r"constant = 50 is not valid: .*phi = -2 at a turn by 180 degrees"):
        lc.tracking_region("so3", inertia=1, error=negative, gains={"K_d": 1}, **still)
    with pytest.raises(InputError, match="phi = -2"):
        lc.tracking_law("so3", inertia=1, error=negative, gains={"K_d": 1})

    def claimed(constant: float) -> object:
        return lc.error_function("so3", "tr(K*(1 - Xd^-1*X))/2", parameters={"K": GAINS["K"]}, constant=constant)

    with pytest.raises(
        InputError, match=r"constant = 9.01 is not valid: .*phi = 9 at a turn by 180 degrees about \(0, 0, 1\)"
    ):
        lc.tracking_region("so3", inertia=1, error=claimed(9.01), gains={"K_d": 1}, **still)
    region = lc.tracking_region("so3", inertia=1, error=claimed(5), gains={"K_d": 1}, **still)
    assert (region.inside, region.bound) == (True, 5)


def test_the_basis_does_not_matter() -> None:
    """so(3) in an ugly basis: the same values, indices and status."""
    turned = lc.change_of_basis(
        "so3", {"a": {"w1": 1, "w2": 2}, "b": {"w2": 3, "w3": -1}, "c": {"w1": 1, "w3": 5}}, name="so3_ugly"
    )
    text = "tr(K*(1 - Xd^-1*X))/2"
    found = lc.critical_points(lc.error_function(turned, text, parameters={"K": GAINS["K"]}))
    assert [point.value for point in found] == pytest.approx([0, 9, 10, 11], abs=1e-8)
    assert [point.index for point in found] == [0, 1, 2, 3]
