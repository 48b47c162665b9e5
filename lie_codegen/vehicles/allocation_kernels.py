"""Thruster allocation as a kernel: (force) -> (thrust, residual)."""

from __future__ import annotations

from typing import Any

from lie_codegen.control.force_limits import force_limits
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector, matvec, minus, plus, scaled
from lie_codegen.kernel.parameter import input_ports, sample_inputs, values_of
from lie_codegen.kernel.saturation import saturated
from lie_codegen.vehicles.allocation import Allocation


@kernel_factory()
def allocation_kernel(
    allocation: Allocation, *, limits: Any = None, namespace: str = "se3", name: str = "allocation"
) -> Kernel:
    """Thrusts for a wanted body force, and the force that the limits leave undone.

    Two-sided: u = W^-1 B' (B W^-1 B')^-1 f. One-sided: the same plus the least multiple of `balance` that makes every
    thrust positive. Then clipped to the limits, which may be "input"; residual = f - B u.

    Args:
        allocation: of `lc.allocation`: k thrusters.
        limits: largest thrust: a number, (k,), or "input"; None for none. [N]
        namespace: prefix of the C symbol.
        name: C identifier.

    Raises:
        InputError: a limit that is not positive.
    """
    n, k = allocation.B.shape
    bounds = force_limits(limits, k)
    inverse = [[_plain(x) for x in row] for row in allocation.inverse]
    B = [[_plain(x) for x in row] for row in allocation.B]

    def body(ops: Arithmetic, force: Vector, *given: Any) -> tuple[Any, ...]:
        u = matvec(inverse, force)
        if allocation.balance is not None:
            lift: Any = 0
            for thrust, share in zip(u, allocation.balance, strict=True):
                need = -1 * thrust / float(share)
                lift = ops.where(ops.less(lift, need), need, lift)
            u = plus(u, scaled(lift, [float(share) for share in allocation.balance]))
        u = saturated(ops, u, *values_of(ops, bounds, given))
        return u, minus(force, matvec(B, u))

    return Kernel(
        name=name,
        namespace=namespace,
        inputs=(Port("force", (n,), description="wanted body force"), *input_ports(bounds)),
        outputs=(
            Port("thrust", (k,), "N", description="one a thruster"),
            Port("residual", (n,), description="what the limits leave undone"),
        ),
        body=body,
        formula="u = W^-1 B' (B W^-1 B')^-1 f, plus a balance for one-sided thrusters, clipped",
        source="least weighted effort",
        sampler=lambda rng: ([rng.uniform(-1, 1) for _ in range(n)], *sample_inputs(bounds, rng)),
    )


def _plain(x: float) -> float | int:
    """0 and 1 as integers, so that they cost nothing in C."""
    value = 0.0 if abs(x) < 1e-15 else float(x)
    return int(value) if value in (0.0, 1.0) else value
