"""Plans as QuTiP objects: QuTiP's own solver ends at the gate; refusals without it."""

from __future__ import annotations

import numpy as np
import pytest

import lie_codegen as lc

HADAMARD = np.array([[1, 1], [1, -1]]) / np.sqrt(2)


@pytest.mark.parametrize("equation", ["left", "right"])
@pytest.mark.parametrize("polish", [True, False])
def test_qutip_solves_the_plan_to_its_gate(equation: str, polish: bool) -> None:
    qutip = pytest.importorskip("qutip")
    plan = lc.steer(
        lc.pauli(1), lc.UpToPhase(HADAMARD), ("X", "Y"), 6.0, drift={"Z": 1}, bounds=1, equation=equation, polish=polish
    )
    H, times = lc.qutip_evolution(plan)
    options = {"atol": 1e-10, "rtol": 1e-9, "nsteps": 100_000, "max_step": 0.01}
    U = qutip.sesolve(H, qutip.qeye(2), times, options=options).states[-1].full()
    assert abs(np.trace(U.conj().T @ HADAMARD)) / 2 == pytest.approx(1, abs=1e-6)


def test_objects_of_two_qubits_know_their_qubits() -> None:
    qutip = pytest.importorskip("qutip")
    cnot = np.eye(4)[[0, 1, 3, 2]]
    options = {"drift": {"ZZ": 1}, "bounds": 4, "pieces": 30, "objective": "none", "equation": "right"}
    plan = lc.steer(lc.pauli(2), lc.UpToPhase(cnot), ("XI", "YI", "IX", "IY"), 6.0, **options)
    H, times = lc.qutip_evolution(plan)
    start = qutip.tensor(qutip.basis(2, 1), qutip.basis(2, 0))
    end = qutip.sesolve(H, start, times, options={"atol": 1e-11, "rtol": 1e-11, "nsteps": 100_000}).states[-1]
    assert end.dims == start.dims
    assert abs(end.overlap(qutip.tensor(qutip.basis(2, 1), qutip.basis(2, 1)))) == pytest.approx(1, abs=1e-7)
    assert H.dims == [[2, 2], [2, 2]]


@pytest.mark.parametrize(
    ("controls", "options"),
    [
        (("sx", "sy"), {"method": "optimal"}),
        (("sx", "sy"), {"method": "swing_twist"}),
        (
            (lambda t: (np.cos(t), np.sin(t), 0), "sy"),
            {"drift": (0, 0, "1 + t/10"), "bounds": 3, "equation": "right", "method": "direct"},
        ),
    ],
)
def test_qutip_solves_plans_of_any_method(controls: tuple[object, ...], options: dict[str, object]) -> None:
    qutip = pytest.importorskip("qutip")
    plan = lc.steer("su2", 1j * HADAMARD, controls, 6.0, **options)
    H, times = lc.qutip_evolution(plan)
    options = {"atol": 1e-10, "rtol": 1e-9, "nsteps": 100_000, "max_step": 0.02}
    U = qutip.sesolve(H, qutip.qeye(2), times, options=options).states[-1].full()
    np.testing.assert_allclose(U, 1j * HADAMARD, atol=1e-6)


def test_plans_of_rotations_are_refused() -> None:
    plan = lc.steer(lc.group("so3"), (0.1, 0.2, 0.3), ("w1", "w2"), 1.0, method="direct")
    with pytest.raises(lc.errors.SteeringInputError, match="unitary"):
        lc.qutip_evolution(plan)
