"""The system that a vibrational feedback was designed for, as a plant of `lc.closed_loop`:

(q, v)' = X(q, v) + Y_a u^a(tau; alpha)/eps,  tau = t/eps, the command alpha
"""

from __future__ import annotations

from typing import Any

from lie_codegen.control.space_plants import SpacePlant
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector
from lie_codegen.mechanics.vibrational_feedback import VibrationalFeedback
from lie_codegen.mechanics.vibrational_kernels import vibrational_kernels
from lie_codegen.mechanics.vibrational_law import feedback_kernels


def vibrated(design: VibrationalFeedback) -> tuple[SpacePlant, Kernel, float]:
    """The system that a vibrational feedback was designed for, the law of its amplitudes, and the period of its calls [s].

    Theorem 2 of Sanyal, Bloch and McClamroch, corrected: the amplitude is switched once a period of the vibration, where the primitive
    of the input is zero.
    """
    fields, n = design.fields, len(design.fields.state) // 2
    named = {kernel.name: kernel for kernel in vibrational_kernels(fields, "vibrated")}
    command = next(kernel for kernel in feedback_kernels(design, "vibrated") if kernel.name == "command")

    def acceleration(ops: Arithmetic, t: Scalar, q: Vector, v: Vector, alpha: Vector) -> Vector:
        held = iter(alpha)
        given = [
            next(held) if str(p) in design.amplitudes else ops.constant(design.values[p]) for p in fields.parameters
        ]
        fast = design.switch_phase + t / design.eps
        return list(named["actual"].evaluate(ops, [*q, *v], fast, design.eps, *given)[0][n:])

    def body(ops: Arithmetic, q: Vector, v: Vector, held: Vector) -> tuple[Any, ...]:
        (alpha,) = command.evaluate(ops, [*q, *v], held)
        return alpha, alpha

    size = len(design.amplitudes)
    law = Kernel(
        "vibrational_law",
        "vibrated",
        (Port("q", (n,)), Port("q_dot", (n,)), Port("held", (size,), description="amplitudes of the period that ends")),
        (Port("alpha", (size,), description=", ".join(design.amplitudes)), Port("held_next", (size,))),
        body,
        command.formula,
        command.source,
    )
    return SpacePlant("vibrated", n, size, 2, acceleration), law, float(fields.period) * design.eps
