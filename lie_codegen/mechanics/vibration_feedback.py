"""lc.vibration_feedback: a law for fewer torques than dimensions, by oscillations that are held for a period.

Wanted acceleration eta = -k_p log(X) - k_d xi at the samples t_k, the zeros of U; eta = v^a Y_a + c_ab <Y_a : Y_b>, and until the next sample

    U^a += p sin(k w s),  U^b += q sin(k w s),  p = sqrt(2 |c_ab|),  q = -sign(c_ab) p,  s = t - t_k,  u^a = v^a + dU^a/ds,

v less what p^2 and q^2 do on the diagonal. The square root is right here, where c is held. The error decays exponentially although the oscillation is of size
sqrt|e| / w, as the terms of second order are smaller still; but only if the loop is slow beside the oscillation. Measure at the zeros of U alone: between them xi
is mostly U.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lie_codegen.errors import InputError
from lie_codegen.exact.positive_matrix import positive_number
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.kernels import group_kernel
from lie_codegen.groups.maps.matrices import matrix_port, velocity_units
from lie_codegen.groups.units import force_units
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector, plus, scaled
from lie_codegen.kernel.parameter import refuse_input
from lie_codegen.kernel.structural_zeros import add, product
from lie_codegen.mechanics.virtual_actuation import virtual_actuation

#: The loop's rate times the period beyond which averages say nothing: at 1.26 the loops of SO(3) and SE(2) diverge, at .63 they do not.
_FASTEST = 0.7


@kernel_factory(group=as_group)
def vibration_feedback(
    group: GroupLike,
    inertia: Any,
    controls: Sequence[Any] | None = None,
    k_p: Any = 1,
    k_d: Any = 2,
    frequency: Any = 20,
    *,
    forces: Any = None,
    name: str = "vibration_feedback",
) -> Kernel:
    """(X, xi, s) -> force: the law from the measurement X, xi at the last sample and the time s since; a sample every 2 pi / frequency.

    Args:
        group: the group; the target is its identity (give target^-1 X).
        inertia: J, a number, (n,) or (n, n).
        controls: labels of the actuated components; or
        forces: (m, n) covectors.
        k_p, k_d: of eta = -k_p log(X) - k_d xi, in 1/s^2 and 1/s.
        frequency: w of the slowest oscillation [rad/s]. None of these numbers can be "input": the loop must be slow beside the oscillation.
        name: C identifier.

    Raises:
        InputError: the loop's rate, max |s| of s^2 + k_d s + k_p = 0, times the period 2 pi / w exceeds .7.
        UncontrollableError: a missing direction or a bad product, in words.
    """
    group = as_group(group, "vibration_feedback")
    for what, value in (("k_p", k_p), ("k_d", k_d), ("frequency", frequency)):
        refuse_input(
            value,
            f"vibration_feedback: {what}",
            "that the loop is slow beside the oscillation is checked when the law is made",
        )
    refuse_input(inertia, "vibration_feedback: inertia", "the directions of the symmetric products follow from it")
    body_of = virtual_actuation(group, inertia, controls=controls, forces=forces, where="vibration_feedback")
    body_of.require("vibration_feedback")
    stiffness, damping, omega = (
        float(positive_number(value, what)) for value, what in ((k_p, "k_p"), (k_d, "k_d"), (frequency, "frequency"))
    )
    period = 2 * np.pi / omega
    rate = float(np.abs(np.roots([1, damping, stiffness])).max())
    if rate * period > _FASTEST:
        raise InputError(
            f"vibration_feedback: the loop's rate {rate:.3g} 1/s times the period {period:.3g} s is {rate * period:.3g}, above {_FASTEST}: the oscillation is no "
            f"longer fast beside the loop, which diverges; frequency at least {2 * np.pi * rate / _FASTEST:.3g} rad/s, or lower gains"
        )
    n, m = group.dim, len(body_of.forces)
    logarithm = group_kernel(group, "log")
    split, rows, back = body_of.decomposition.tolist(), body_of.forces.tolist(), body_of.compensation.tolist()

    def body(ops: Arithmetic, X: Any, xi: Vector, s: Scalar) -> tuple[Any, ...]:
        (error,) = logarithm.evaluate(ops, X)
        eta = plus(scaled(ops.constant(-stiffness), error), scaled(ops.constant(-damping), xi))
        parts = []
        for row in split:
            total: Scalar = 0
            for factor, entry in zip(row, eta, strict=True):
                total = add(total, product(ops.constant(factor), entry) if factor else 0)
            parts.append(total)
        u = list(parts[:m])
        for i, (a, b) in enumerate(body_of.pairs):
            c = parts[m + i]
            if isinstance(c, int) and c == 0:
                continue
            # One frequency a pair: the product of sines of two frequencies has no mean, so that pairs do not push each other.
            turning = ops.constant(omega * (2 * i + 1))
            # The velocities p sin and q sin have a mean product p q / 2, and the averaged force is minus that times <Y_a : Y_b>: p q = -2 c.
            p = ops.sqrt(2 * ops.fabs(c))
            q = ops.where(ops.less(c, 0.0), p, -p)
            wave = turning * ops.cos(turning * s)
            for force, size in ((a, p), (b, q)):
                u[force] = add(u[force], size * wave)
                # Each oscillation also pushes along <Y_a : Y_a> by -size^2 / 4, which lies in the span of the controls: they take it back.
                for k, factor in enumerate(back[force]):
                    if abs(factor) > 1e-14:
                        u[k] = add(u[k], ops.constant(factor / 4) * size * size)
        total_force: Vector = [0] * n
        for strength, row in zip(u, rows, strict=True):
            for k, factor in enumerate(row):
                if factor:
                    total_force[k] = add(total_force[k], product(ops.constant(factor) if factor != 1 else 1, strength))
        return ([0.0 if isinstance(f, int) else f for f in total_force],)

    return Kernel(
        name=name,
        namespace=group.name,
        inputs=(
            matrix_port(group, "X"),
            Port("xi", (n,), velocity_units(group), description="body velocity at the last sample"),
            Port("s", (), "s", description="time since the last sample, 0 to 2 pi / frequency"),
        ),
        outputs=(Port("force", (n,), force_units(group)),),
        body=body,
        formula="u^a = v^a + d/ds sum p sin(k w s), p = sqrt(2 |c|), q = -sign(c) p",
        source="Bullo, Leonard and Lewis, IEEE TAC 45 (2000) 1437",
    )
