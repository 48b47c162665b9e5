"""What a plan does to quantum states: Bloch vectors of a qubit, of two levels among more, of each of several qubits; populations."""

from __future__ import annotations

from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.pauli import pauli_matrix
from lie_codegen.pictures.steering_loops import COLOURS
from lie_codegen.steering.plan import Plan

_SIGMA = np.array([pauli_matrix(letter) for letter in "XYZ"])


def bloch_paths(plan: Plan, X: Array) -> tuple[Array, list[str]] | None:
    """Curves (k, 3, j) in the Bloch ball and their names; None where the group is none of qubits.

    Two levels that a gate acts on: the Bloch vectors <sigma> of the states that begin along x, y and z, which are shorter than one by
    what is outside. Several qubits: the Bloch vector of each, from all at |0>; it is short while the qubit is entangled.
    """
    levels = computational(plan)
    if len(levels) == 2:
        block = X[:, levels][:, :, levels]
        begun = (np.eye(2) + _SIGMA) / 2
        moved = block[:, None] @ begun @ np.conj(np.swapaxes(block, 1, 2))[:, None]
        curves = np.real(np.einsum("iab,kjba->kij", _SIGMA, moved))
        return curves, [f"from {name}" for name in ("x", "y", "z")]
    qubits = _qubits(plan.group)
    if qubits < 2:
        return None
    strings = [["I" * q + letter + "I" * (qubits - q - 1) for letter in "XYZ"] for q in range(qubits)]
    states = X[:, :, 0]
    seen = [
        [np.real(np.einsum("ka,ab,kb->k", states.conj(), pauli_matrix(word), states)) for word in each]
        for each in strings
    ]
    return np.moveaxis(np.array(seen), 2, 0).swapaxes(1, 2), [f"qubit {q + 1}" for q in range(qubits)]


def draw_populations(axes: Any, plan: Plan, t: Array, X: Array) -> None:
    """|<row|X(t)|first>|^2 over time, first the first of the computational levels."""
    levels = computational(plan)
    first = levels[0] if levels else 0
    for row in range(plan.group.degree):
        style = "-" if not levels or row in levels else "--"
        axes.plot(t, np.abs(X[:, row, first]) ** 2, style, color=COLOURS[row % len(COLOURS)], label=rf"$|{row}\rangle$")
    outside = ", dashed: outside" if levels and len(levels) < plan.group.degree else ""
    axes.set(title=rf"populations from $|{first}\rangle$" + outside, xlabel="t [s]", xlim=(0, plan.duration))
    axes.grid(color="0.92")
    axes.legend(frameon=False, fontsize=8)


def computational(plan: Plan) -> tuple[int, ...]:
    """The levels of the gate that the plan ends at, none where it is one of the whole space."""
    return tuple(getattr(plan.details.get("goal"), "levels", None) or ())


def _qubits(group: MatrixGroup) -> int:
    """How many, where the basis is one of Pauli strings; else 0."""
    letters = {letter for label in group.labels for letter in label}
    size = len(group.labels[0])
    return size if group.is_complex and letters <= set("IXYZ") and group.degree == 2**size else 0
