"""A plan on unitary matrices as QuTiP objects: the Hamiltonian with its pulses, to be solved, plotted or put into a laboratory's tools."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import MissingDependencyError, SteeringInputError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.plan import Controls, Plan
from lie_codegen.steering.plan_path import velocity_of


def qutip_evolution(plan: Plan) -> tuple[Any, Array]:
    """(qutip.QobjEvo of H(t), times) with U' = -i H(t) U: from the start to the target, or, of a left-invariant plan, from the identity to
    start^-1 target.

    H = i (drift + sum_i u_i b_i) as matrices. A plan of the left-invariant equation is played backwards in time, which is what makes it
    a solution of Schroedinger's. Constant pieces become step functions and controls that are linear between nodes stay linear; smooth
    controls of other methods, and directions that depend on time, become functions of t. On `lc.pauli(n)` the objects know their qubits
    (dims [[2, 2], [2, 2]] for two): start from `qutip.qeye([2, 2])` or a tensor product of states.

    Raises:
        SteeringInputError: a plan on a group of real matrices, or of torques.
        MissingDependencyError: qutip is not installed.
    """
    if not plan.group.is_complex or plan.details.get("inertia") is not None:
        raise SteeringInputError("qutip_evolution: give a plan of velocities on a group of unitary matrices")
    try:
        from qutip import Qobj, QobjEvo
    except ImportError:
        raise MissingDependencyError("qutip_evolution needs qutip: pip install qutip") from None
    hat, dims = plan.group.hat, _dimensions(plan.group)
    system, inputs = plan.details.get("system"), plan.details.get("inputs")
    if system is None or inputs is None or not system.steady:
        velocity, forwards = velocity_of(plan), _forwards(plan)
        parts = [
            [Qobj(1j * A, dims=dims), _Component(velocity, number, plan.duration, forwards)]
            for number, A in enumerate(plan.group.basis)
        ]
        return QobjEvo(parts), np.unique(np.concatenate([np.linspace(0, plan.duration, 101), _breakpoints(plan)]))
    played = inputs if system.right else inputs.reversed()
    stepwise = bool(np.all(played.first == played.last))
    values = np.vstack([played.first, played.last[-1:]])
    terms: list[Any] = [Qobj(1j * hat(system.drift.constant), dims=dims)]
    for number, direction in enumerate(system.directions):
        coefficients = values[:, number].astype(complex)
        terms.append([Qobj(1j * hat(direction.constant), dims=dims), coefficients])
    return QobjEvo(terms, tlist=played.knots, order=0 if stepwise else 1), np.asarray(played.knots)


def _dimensions(group: MatrixGroup) -> list[list[int]]:
    """Of QuTiP's objects: one for each qubit where the basis is one of Pauli strings."""
    qubits = len(group.labels[0])
    strings = set("".join(group.labels)) <= set("IXYZ") and 2**qubits == group.degree
    return [[2] * qubits if strings else [group.degree]] * 2


@dataclass(frozen=True)
class _Component:
    """t -> one component of the velocity, drift included, as it is played."""

    velocity: Controls
    number: int
    duration: float
    forwards: bool

    def __call__(self, t: float) -> float:
        s = min(max(t if self.forwards else self.duration - t, 0.0), self.duration)
        return float(self.velocity(s)[self.number])


def _forwards(plan: Plan) -> bool:
    return bool(getattr(plan.details.get("system"), "right", False))


def _breakpoints(plan: Plan) -> Array:
    """Where controls may jump, in the time in which they are played."""
    knots = np.asarray(plan.u.breakpoints)
    return knots if _forwards(plan) else np.asarray(plan.duration - knots)
