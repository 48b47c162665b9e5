"""A plan on unitary matrices as QuTiP objects: the Hamiltonian with its pulses, to be solved, plotted or put into a laboratory's tools."""

from __future__ import annotations

from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import MissingDependencyError, SteeringInputError
from lie_codegen.steering.plan import Plan


def qutip_evolution(plan: Plan) -> tuple[Any, Array]:
    """(qutip.QobjEvo of H(t), times) with U' = -i H(t) U from plan.details["system"].start to the target.

    H = i (drift + sum_i u_i b_i) as matrices. A plan of the left-invariant equation is played backwards in time, which is what makes it
    a solution of Schroedinger's. Constant pieces become step functions; controls that are linear between nodes stay linear.

    Raises:
        SteeringInputError: a plan of another method or of a group of real matrices, or directions that depend on time.
        MissingDependencyError: qutip is not installed.
    """
    system, inputs = plan.details.get("system"), plan.details.get("inputs")
    if system is None or inputs is None or not plan.group.is_complex:
        raise SteeringInputError("qutip_evolution: give a plan of method='direct' on a group of unitary matrices")
    if not system.steady:
        raise SteeringInputError(
            "qutip_evolution: controls and drift must not depend on time; sample plan.u(t) instead"
        )
    try:
        from qutip import Qobj, QobjEvo
    except ImportError:
        raise MissingDependencyError("qutip_evolution needs qutip: pip install qutip") from None
    played = inputs if system.right else inputs.reversed()
    stepwise = bool(np.all(played.first == played.last))
    values = np.vstack([played.first, played.last[-1:]])
    hat = plan.group.hat
    parts: list[Any] = [Qobj(1j * hat(system.drift.constant))]
    for number, direction in enumerate(system.directions):
        coefficients = values[:, number].astype(complex)
        parts.append([Qobj(1j * hat(direction.constant)), coefficients])
    return QobjEvo(parts, tlist=played.knots, order=0 if stepwise else 1), np.asarray(played.knots)
