"""What is taken for an element: as it is, projected, or refused with the figure that is off; by laws of error growth."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from generators import haar_rotation, haar_special_unitary, off_the_group

import lie_codegen as lc
from lie_codegen.errors import NotFiniteError, NotOnGroupError, ShapeError
from lie_codegen.groups.maps.admission import admitted, admitted_all

#: GL(n) is open in the matrices: nothing near it is off it.
GROUPS = [name for name in lc.group_names() if not name.startswith("gl")]


@pytest.mark.parametrize("name", GROUPS)
def test_elements_pass_and_noise_is_projected_or_refused_by_its_size(name: str) -> None:
    group, rng = lc.group(name), np.random.default_rng(1)
    X = scipy.linalg.expm(group.hat(0.8 * rng.normal(size=group.dim)))
    assert admitted(group, X, "X").projected == 0.0
    for size in (1e-9, 1e-7):
        noisy = off_the_group(group, X, size, rng)
        found = admitted(group, noisy, "X")
        assert 0 < found.projected <= 10 * size
        assert found.projected == pytest.approx(np.linalg.norm(found.X - noisy), rel=1e-6)
        assert admitted(group, found.X, "X").projected == 0.0
    with pytest.raises(NotOnGroupError, match=r"X is not on the group .*lc.nearest"):
        admitted(group, off_the_group(group, X, 0.05, rng), "X")


def test_messages_give_differences_and_the_phase_that_mends_a_gate() -> None:
    so3, su2, su4 = lc.group("so3"), lc.group("su2"), lc.group("su4")
    with pytest.raises(NotOnGroupError, match=r"det X.*= -1"):
        admitted(so3, np.diag([1.0, 1, -1]), "X0")
    with pytest.raises(NotOnGroupError, match=r"det X - 1 = 0\.0003"):
        admitted(lc.group("sl3"), np.diag([1, 1, 1 + 3e-4]), "X")
    hadamard = np.array([[1, 1], [1, -1]]) / np.sqrt(2)
    with pytest.raises(NotOnGroupError, match=r"exp\(-1.570796327j\)"):
        admitted(su2, hadamard, "target")
    cnot = np.eye(4)[[0, 1, 3, 2]]
    with pytest.raises(NotOnGroupError, match="UpToPhase"):
        admitted(su4, cnot, "target")
    assert admitted(su4, np.exp(-0.25j * np.pi) * cnot, "target").projected < 1e-15
    with pytest.raises(ShapeError, match=r"\(2, 2\)"):
        admitted(so3, np.eye(2), "X")
    with pytest.raises(ShapeError, match="complex"):
        admitted(so3, 1j * np.eye(3), "X")
    with pytest.raises(NotFiniteError):
        admitted(so3, np.full((3, 3), np.nan), "X")


def test_single_precision_and_printed_rotations_work_everywhere() -> None:
    rng = np.random.default_rng(4)
    so3 = lc.group("so3")
    R = haar_rotation(3, rng)
    single = R.astype(np.float32)
    run = lc.simulate(so3, [0.1, 0.2, 0.3], t=[0.0, 1.0], X0=single)
    assert np.max(np.abs(run.X[-1].T @ run.X[-1] - np.eye(3))) < 1e-14
    q = lc.quaternion_from_rotation(single, order="wxyz")
    np.testing.assert_allclose(lc.rotation_from_quaternion(q, order="wxyz"), R, atol=1e-6)
    reference = lc.reference(so3, times=[0, 1], waypoints=[np.eye(3), np.round(R, 7)])
    assert reference is not None


@pytest.mark.parametrize(("name", "controls"), [("so3", ("w1", "w2")), ("su2", None)])
def test_a_target_printed_with_few_digits_costs_what_the_exact_one_costs(
    name: str, controls: tuple[str, str] | None
) -> None:
    rng = np.random.default_rng(7)
    group = lc.group(name)
    used = controls or group.labels[:2]
    for _ in range(5):
        X = haar_rotation(3, rng) if name == "so3" else haar_special_unitary(2, rng)
        exact = lc.steer(group, X, controls=used, duration=2.0).cost
        for digits in (12, 9, 5):
            printed = np.round(X, digits)
            cost = lc.steer(group, printed, controls=used, duration=2.0).cost
            assert cost == pytest.approx(exact, rel=max(1e-6, 10 * 10.0**-digits))
            # the energy of the projected target, to 1e-9
            projected = lc.steer(group, lc.nearest(group, printed).X, controls=used, duration=2.0).cost
            assert cost == pytest.approx(projected, rel=1e-9)


@pytest.mark.parametrize("name", ["so3", "se3", "su2", "su3"])
def test_elements_printed_with_five_decimals_are_taken_and_with_two_are_not(name: str) -> None:
    group, rng = lc.group(name), np.random.default_rng(8)
    refused = 0
    for _ in range(60):
        X = scipy.linalg.expm(group.hat(rng.normal(size=group.dim)))
        found = admitted(group, np.round(X, 5), "X")
        assert 0 < found.projected < 2e-5
        try:
            admitted(group, np.round(X, 2), "X")
        except NotOnGroupError:
            refused += 1
    assert refused >= 58


def test_batches_are_judged_one_by_one() -> None:
    so3, rng = lc.group("so3"), np.random.default_rng(5)
    X = np.array([haar_rotation(3, rng) for _ in range(4)])
    X[2] = np.round(X[2], 8)
    found, distances = admitted_all(so3, X, "X")
    assert np.count_nonzero(distances) == 1
    assert distances[2] < 1e-7
    np.testing.assert_array_equal(found[[0, 1, 3]], X[[0, 1, 3]])
    X[3] = np.diag([1.0, 1, -1])
    with pytest.raises(NotOnGroupError, match=r"X\[3\]"):
        admitted_all(so3, X, "X")
