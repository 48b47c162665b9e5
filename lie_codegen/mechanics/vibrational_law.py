"""The amplitude feedback as kernels: the command, the force, and one step of the closed loop."""

from __future__ import annotations

from typing import Any

import numpy as np

from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import plus
from lie_codegen.kernel.runge_kutta import CLASSICAL, increment, vectors
from lie_codegen.kernel.saturation import saturated
from lie_codegen.mechanics.vibrational_feedback import VibrationalFeedback
from lie_codegen.mechanics.vibrational_fields import fast_time
from lie_codegen.mechanics.vibrational_kernels import vibrational_kernels

SOURCE = "Sanyal, Bloch and McClamroch, Theorem 2 corrected: averaged equilibrium, amplitude held over a period"


@kernel_factory()
def feedback_kernels(design: VibrationalFeedback, namespace: str, *, steps: int = 60) -> tuple[Kernel, ...]:
    """command, force and loop of a designed feedback: all a flight computer needs, and the plant to test it on.

    command(y, held) -> alpha: the amplitude for the next period from the state at the switching phase, where `held` is
        the amplitude of the period that ends; z = estimate(y), alpha = -K (z - z_e), saturated.
    force(tau, alpha) -> u / eps, the inputs at fast time tau.
    loop(state) -> state after one Runge-Kutta step of order 4 of the actual system with the law; the state is
        (y, alpha, j) with j = 0 .. steps - 1 the position in the period that starts at the switching phase.

    Args:
        design: of `design_feedback`.
        namespace: prefix of the C symbols.
        steps: Runge-Kutta steps a period of the closed loop.

    Raises:
        IdentifierError: namespace is no C identifier.
        ArgumentError: design is no such feedback.
    """
    fields, n, na = design.fields, len(design.fields.state), len(design.amplitudes)
    named = {kernel.name: kernel for kernel in vibrational_kernels(fields, namespace)}
    period = float(fields.period)
    fast = period / steps

    def parameters(ops: Arithmetic, alpha: Any) -> list[Scalar]:
        held = iter(alpha)
        return [
            next(held) if str(p) in design.amplitudes else ops.constant(design.values[p]) for p in fields.parameters
        ]

    def command(ops: Arithmetic, y: Any, held: Any) -> tuple[Any, ...]:
        where, eps = design.switch_phase, design.eps
        (z,) = named["estimate"].evaluate(ops, y, where, eps, *parameters(ops, held))
        error = [a - float(b) for a, b in zip(z, design.equilibrium, strict=True)]
        alpha = [-sum(float(k) * e for k, e in zip(row, error, strict=True)) for row in design.K]
        return (saturated(ops, alpha, [design.limit] * na if np.isfinite(design.limit) else None),)

    def force(ops: Arithmetic, tau: Scalar, alpha: Any) -> tuple[Any, ...]:
        values = {**dict(zip(fields.parameters, parameters(ops, alpha), strict=True)), fast_time(): tau}
        evaluate = ExpressionEvaluator(ops, values)
        return ([evaluate(u.expression(fast_time())) / design.eps for u in fields.inputs],)

    def loop(ops: Arithmetic, state: Any) -> tuple[Any, ...]:
        y, held, j = list(state[:n]), list(state[n : n + na]), state[n + na]
        (fresh,) = command(ops, y, held)
        first = ops.less(j, 0.5)
        alpha = [ops.where(first, new, old) for new, old in zip(fresh, held, strict=True)]
        given, h = parameters(ops, alpha), design.eps * fast
        tau = design.switch_phase + j * fast

        def slope(c: float, change: Any) -> Any:
            return named["actual"].evaluate(ops, plus(y, change), tau + c * fast, design.eps, *given)[0]

        end = plus(y, increment(vectors(ops), CLASSICAL, slope, [0] * n, h))
        # j is a whole number held in a double: halves between them tell one from the next whatever the rounding.
        last = ops.less(steps - 1.5, j)
        return ([*end, *alpha, ops.where(last, 0.0 * j, j + 1)],)

    y, a = Port("y", (n,), description=", ".join(map(str, fields.state))), ", ".join(design.amplitudes)
    state, following = Port("state", (n + na + 1,), description=f"y, {a}, j"), Port("next_state", (n + na + 1,))
    return (
        Kernel("command", namespace, (y, Port("held", (na,), description=a)), (Port("alpha", (na,)),), command,
               "alpha = -K (P^-1(Phi^-1(y)) - z_e) at the switching phase", SOURCE),
        Kernel("force", namespace, (Port("tau", ()), Port("alpha", (na,))), (Port("u", (len(fields.inputs),)),), force,
               "u^a(tau; alpha) / eps", SOURCE),
        Kernel("loop", namespace, (state,), (following,), loop, "one step of the closed loop", SOURCE),
    )  # fmt: skip


def closed_loop_start(design: VibrationalFeedback, y0: Any) -> list[float]:
    """The state of `loop` at the switching phase: y0, zero amplitudes, j = 0."""
    return [*(float(v) for v in y0), *([0.0] * len(design.amplitudes)), 0.0]
