"""Gates on some levels of a larger space: the block is the gate, nothing is outside; the pulses played by SciPy's exponential."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.stats import unitary_group
from transmon import ANHARMONIC, HX, HY, velocity

import lie_codegen as lc


def played(plan: lc.Plan) -> np.ndarray:
    """U of Schroedinger's equation under the constant pieces."""
    pieces, U = plan.details["pieces"], np.eye(3)
    for h, (x, y) in zip(np.diff(pieces.knots), pieces.first, strict=True):
        U = expm(-1j * h * (ANHARMONIC + x * HX + y * HY)) @ U
    return U


@pytest.mark.parametrize("levels", [(0, 1), (2, 0)])
def test_a_transmon_ends_in_its_gate_and_nowhere_else(levels: tuple[int, int]) -> None:
    gate = unitary_group.rvs(2, random_state=7)
    plan = lc.steer(
        "su3", lc.UpToPhase(gate, levels=levels), (velocity(HX), velocity(HY)), 8.0, drift=velocity(ANHARMONIC), bounds=2,
        equation="right",
    )  # fmt: skip
    assert plan.status is lc.Status.LOCAL
    block = played(plan)[np.ix_(levels, levels)]
    overlap = np.trace(gate.conj().T @ block)
    np.testing.assert_allclose(block, overlap / abs(overlap) * gate, atol=1e-9)
    assert plan.details["fidelity"] == pytest.approx(1, abs=1e-12)
    assert plan.details["leakage"] < 1e-12


def test_leakage_is_what_the_levels_lose_on_the_way() -> None:
    """A plan that was stopped early is worth what numpy says."""
    from lie_codegen.steering.direct.report import leakage

    plan = lc.steer(
        "su3", lc.UpToPhase([[0, 1], [1, 0]], levels=(0, 1)), (velocity(HX), velocity(HY)), 8.0, drift=velocity(ANHARMONIC), bounds=2,
        equation="right", polish=False,
    )  # fmt: skip
    X = plan.X(5.0)
    lost = np.mean([np.linalg.norm(X[2, k]) ** 2 for k in (0, 1)])
    assert lost > 1e-3
    assert leakage(X, (0, 1)) == pytest.approx(lost, rel=1e-9)


@pytest.mark.parametrize(("levels", "free"), [((0, 1), 4), ((0, 3, 2), 1), ((1,), 9)])
def test_what_is_outside_is_free(levels: tuple[int, ...], free: int) -> None:
    """dim S(U(1) x U(d - s)) = (d - s)^2; X exp(h) keeps the gate up to a phase."""
    from lie_codegen.steering.goals import cosets

    group, rng = lc.pauli(2), np.random.default_rng(1)
    gate = unitary_group.rvs(len(levels), random_state=3) if len(levels) > 1 else np.eye(1)
    elements, rows = cosets(group, lc.UpToPhase(gate, levels=levels), "test")
    assert rows.shape == (free, 15)
    X = elements[0] @ expm(group.hat(rng.normal(size=free) @ rows))
    block = X[np.ix_(levels, levels)]
    assert abs(np.trace(gate.conj().T @ block)) == pytest.approx(len(levels), abs=1e-12)


def test_two_levels_of_four_with_two_outside() -> None:
    gate = np.array([[1, 1], [1, -1]]) / np.sqrt(2)
    controls = ("XI", "YI", "IX", "IY")
    plan = lc.steer(
        lc.pauli(2), lc.UpToPhase(gate, levels=(0, 3)), controls, 4.0, drift={"ZZ": 1}, bounds=4, polish=False
    )
    block = plan.X_final[np.ix_((0, 3), (0, 3))]
    assert abs(np.trace(gate @ block)) / 2 == pytest.approx(1, abs=1e-9)
    assert plan.details["leakage"] < 1e-9


def test_wrong_levels_and_gates_are_named() -> None:
    go = lambda goal: lc.steer("su3", goal, ("l1", "l4"), 5.0, bounds=1)  # noqa: E731
    for levels in ((0, 0), (0, 3), ()):
        with pytest.raises(lc.errors.SteeringInputError, match="levels"):
            go(lc.UpToPhase(np.eye(2), levels=levels))
    with pytest.raises(lc.errors.ShapeError, match=r"\(2, 2\)"):
        go(lc.UpToPhase(np.eye(3), levels=(0, 1)))


def test_pictures_show_pulses_populations_and_bloch_vectors(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    from lie_codegen.pictures.steering_picture import draw_plan

    plan = lc.steer(
        "su3", lc.UpToPhase([[0, 1], [1, 0]], levels=(0, 1)), (velocity(HX), velocity(HY)), 8.0, drift=velocity(ANHARMONIC), bounds=2,
        equation="right", polish=False,
    )  # fmt: skip
    pulses, populations, ball = draw_plan(plan).axes[:3]
    assert len(pulses.lines) == 2
    shown = np.array([line.get_ydata() for line in populations.lines])
    np.testing.assert_allclose(shown.sum(axis=0), 1, atol=1e-9)
    np.testing.assert_allclose(shown[:, -1], [0, 1, 0], atol=1e-9)
    ends = np.array([np.array(line.get_data_3d())[:, -1] for line in ball.lines])
    np.testing.assert_allclose(ends, np.diag([1, -1, -1]), atol=1e-6)  # NOT turns y and z round
    assert lc.plot_plan(plan, tmp_path / "plan.svg").stat().st_size > 20_000
    gate = lc.steer(lc.pauli(2), lc.UpToPhase(np.eye(4)[[0, 1, 3, 2]]), ("XI", "YI", "IX", "IY"), 6.0, drift={"ZZ": 1}, bounds=4,
        pieces=30, equation="right", objective="none")  # fmt: skip
    qubits = draw_plan(gate).axes[2].lines
    for line in qubits:
        curve = np.array(line.get_data_3d())
        assert np.max(np.linalg.norm(curve, axis=0)) < 1 + 1e-9
        np.testing.assert_allclose(curve[:, [0, -1]].T, [[0, 0, 1], [0, 0, 1]], atol=1e-6)  # CNOT keeps |00>
