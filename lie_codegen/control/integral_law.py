"""Integral action with saturation and anti-windup on any group: a constant unknown force leaves no error behind.

    f   = sat(f_0 - K_i s),   f_0 the tracking law of `tracking_kernels`
    s'  = xi_e + c K_d^{-1} d_1 phi + w K_i^{-1} (f_0 - K_i s - f)

The last term lets the integral follow what the actuators give (back-calculation): while they saturate it does not
wind up.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from lie_codegen.control.error_catalogue import as_error, gain
from lie_codegen.control.error_derivatives import ErrorDerivatives
from lie_codegen.control.tracking_law import tracking_law
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.positive_matrix import positive_matrix, positive_number
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.maps.matrices import GroupMatrices
from lie_codegen.groups.matrix_pattern import RealMatrices
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector, constant_matrix, matvec, minus, number, plus, scaled
from lie_codegen.on_demand import sympy as sp

#: Inputs of a tracking law whose numbers are all compiled in.
_TRACKING = 5


@kernel_factory(group=as_group)
def integral_law(
    group: GroupLike,
    *,
    inertia: Any,
    error: Any,
    gains: Mapping[str, Any],
    feedforward: str = "basic",
    limits: Any = None,
    name: str = "integral_law",
) -> Kernel:
    """(X, xi, X_d, xi_d, xi_d_dot, integral) -> (force, integral_dot, phi, W).

    Args:
        group, inertia, error, feedforward: as `tracking_law`.
        gains: those of `tracking_law`, K_i, and optionally c (default 1/2) and w, the anti-windup rate (default 1
        for finite
            limits: s follows K_i^{-1} times the excess).
        limits: largest absolute force, a number or one a component; None for none.
        name: C identifier.

    Raises:
        InputError: as `tracking_law`; a limit that is not positive.
    """
    group = as_group(group, "integral_law")
    rest = {
        key: value for key, value in gains.items() if key not in ("c", "w") and key.replace("_", "").lower() != "ki"
    }
    law = tracking_law(group, inertia=inertia, error=error, gains=rest, feedforward=feedforward, name=name)
    if len(law.inputs) != _TRACKING:
        raise InputError('an integral law has its numbers compiled in: inertia and gains cannot be "input"')
    pair = as_error(group, error, rest)
    K_i = positive_matrix(gain(gains, "K_i", "an integral law"), group.dim, "K_i")
    K_d = positive_matrix(gain(gains, "K_d", "an integral law"), group.dim, "K_d")
    c, w = positive_number(gains.get("c", "1/2"), "c"), positive_number(gains.get("w", 1), "w")
    bounds = force_limits(limits, group.dim)
    real = RealMatrices(group)

    def body(
        ops: Arithmetic, X: Any, xi: Vector, X_d: Any, xi_d: Vector, xi_d_dot: Vector, s: Vector
    ) -> tuple[Any, ...]:
        free, phi, W, _ = law.evaluate(ops, X, xi, X_d, xi_d, xi_d_dot)
        read = GroupMatrices(ops, real).read
        at = ErrorDerivatives(ops, pair, real, read(X), read(X_d))
        _, slope = at.differential(1)
        wanted = minus(free, matvec(constant_matrix(ops, K_i), s))
        force = saturated(ops, wanted, bounds)
        rate = plus(
            minus(xi, at.transported(xi_d)), scaled(number(ops, c), matvec(constant_matrix(ops, K_d.inv()), slope))
        )
        if bounds is not None:
            excess = matvec(constant_matrix(ops, K_i.inv()), minus(wanted, force))
            rate = plus(rate, scaled(number(ops, w), excess))
        return force, rate, phi, W

    inputs = (*law.inputs, Port("integral", (group.dim,), description="the integral s, zero at the start"))
    outputs = (law.outputs[0], Port("integral_dot", (group.dim,), description="s'"), law.outputs[1], law.outputs[2])
    sampler = law.sampler
    return replace(
        law,
        inputs=inputs,
        outputs=outputs,
        body=body,
        formula="f = sat(f_0 - K_i s), s' = xi_e + c K_d^-1 d_1 phi + w K_i^-1 (f_0 - K_i s - f)",
        sampler=None
        if sampler is None
        else lambda rng: (*sampler(rng), [rng.uniform(-1, 1) for _ in range(group.dim)]),
    )


@kernel_factory()
def with_limits(law: Kernel, limits: Any, name: str | None = None) -> Kernel:
    """The same law with its first output, a force or velocity, clipped to +-limits component by component.

    Raises:
        ShapeError: the first output is not a vector, or the limits have another length.
        InputError: a limit that is not positive.
    """
    if len(law.outputs[0].shape) != 1:
        raise ShapeError(f"{law.name}: the first output is not a vector, so it has no component limits")
    bounds = force_limits(limits, law.outputs[0].shape[0])

    def body(ops: Arithmetic, *arguments: Any) -> tuple[Any, ...]:
        first, *others = law.evaluate(ops, *arguments)
        return saturated(ops, first, bounds), *others

    return replace(law, name=name or law.name, body=body, formula=f"{law.formula}; clipped to +-limits")


def force_limits(limits: Any, size: int) -> list[sp.Expr] | None:
    """Positive limits, one a component; None for none.

    Raises:
        ShapeError, InputError: another length; a limit that is not positive.
    """
    if limits is None:
        return None
    many = (isinstance(limits, Sequence) and not isinstance(limits, str)) or hasattr(limits, "tolist")
    values = limits if many else [limits] * size
    if len(values) != size:
        raise ShapeError(f"{len(values)} limits for {size} components")
    return [positive_number(value, f"limits[{i}]") for i, value in enumerate(values)]


def saturated(ops: Arithmetic, vector: Sequence[Scalar], limits: Sequence[sp.Expr] | None) -> Vector:
    """min(max(v, -limit), limit), component by component."""
    if limits is None:
        return list(vector)
    result: Vector = []
    for value, limit in zip(vector, limits, strict=True):
        high = ops.constant(limit)
        low = -high
        clipped = ops.where(ops.less(high, value), high, value)
        result.append(ops.where(ops.less(value, low), low, clipped))
    return result
