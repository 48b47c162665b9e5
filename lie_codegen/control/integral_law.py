"""Integral action with saturation and anti-windup on any group: a constant unknown force leaves no error behind.

    f   = sat(f_0 - K_i s),   f_0 the tracking law of `tracking_kernels`
    s'  = xi_e + c K_d^{-1} d_1 phi + w K_i^{-1} (f_0 - K_i s - f)

The last term lets the integral follow what the actuators give (back-calculation): while they saturate it does not
wind up.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from lie_codegen.control.error_catalogue import gain, law_error
from lie_codegen.control.error_derivatives import ErrorDerivatives
from lie_codegen.control.force_limits import force_limits
from lie_codegen.control.tracking_law import tracking_law
from lie_codegen.exact.positive_matrix import positive_matrix, positive_number
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.matrices import GroupMatrices
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Matrix, Vector, constant_matrix, matvec, minus, plus, scaled
from lie_codegen.kernel.parameter import Parameter, input_ports, parameter, sample_inputs, values_of
from lie_codegen.kernel.saturation import saturated
from lie_codegen.kernel.small_inverse import inverse

#: Inputs of a tracking law before its numbers.
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
        limits: largest absolute force, a number or one a component; None for none. Each of these numbers may be "input": an input of that
            name, behind the others.
        name: C identifier.

    Raises:
        InputError: as `tracking_law`; a limit that is not positive.
    """
    group = as_group(group, "integral_law")
    rest = {
        key: value for key, value in gains.items() if key not in ("c", "w") and key.replace("_", "").lower() != "ki"
    }
    law = tracking_law(group, inertia=inertia, error=error, gains=rest, feedforward=feedforward, name=name)
    pair, n = law_error(group, error, rest), group.dim
    K_d = _matrix_gain(gains, "K_d", "dissipation", n)
    of_tracking = law.inputs[_TRACKING:]
    own = (
        _matrix_gain(gains, "K_i", "of the integral", n),
        parameter(
            Port("c", (), description="share of d_1 phi in the integral"), gains.get("c", "1/2"), positive_number
        ),
        parameter(Port("w", (), "1/s", description="rate of the anti-windup"), gains.get("w", 1), positive_number),
        *force_limits(limits, n),
    )
    real = derivation_of(group).real

    def body(
        ops: Arithmetic, X: Any, xi: Vector, X_d: Any, xi_d: Vector, xi_d_dot: Vector, s: Vector, *given: Any
    ) -> tuple[Any, ...]:
        theirs, ours = given[: len(of_tracking)], given[len(of_tracking) :]
        free, phi, W, _ = law.evaluate(ops, X, xi, X_d, xi_d, xi_d_dot, *theirs)
        named = dict(zip((port.name for port in of_tracking), theirs, strict=True))
        K_i, c, w, *bounds = values_of(ops, own, ours)
        read = GroupMatrices(ops, real).read
        at = ErrorDerivatives(ops, pair, real, read(X), read(X_d), [named[port.name] for port in pair.inputs])
        _, slope = at.differential(1)
        wanted = minus(free, matvec(K_i, s))
        force = saturated(ops, wanted, *bounds)
        rate = plus(minus(xi, at.transported(xi_d)), scaled(c, matvec(_inverse(ops, K_d, named.get("K_d")), slope)))
        if bounds:
            excess = matvec(_inverse(ops, own[0], K_i), minus(wanted, force))
            rate = plus(rate, scaled(w, excess))
        return force, rate, phi, W

    integral = Port("integral", (n,), description="the integral s, zero at the start")
    inputs = (*law.inputs[:_TRACKING], integral, *of_tracking, *input_ports(own))
    outputs = (law.outputs[0], Port("integral_dot", (group.dim,), description="s'"), law.outputs[1], law.outputs[2])
    sampler = law.sampler
    return replace(
        law,
        inputs=inputs,
        outputs=outputs,
        body=body,
        formula="f = sat(f_0 - K_i s), s' = xi_e + c K_d^-1 d_1 phi + w K_i^-1 (f_0 - K_i s - f)",
        sampler=None if sampler is None else lambda rng: _sample(sampler(rng), n, own, rng),
    )


def _sample(tracking: tuple[Any, ...], n: int, own: Sequence[Parameter], rng: random.Random) -> tuple[Any, ...]:
    s = [rng.uniform(-1, 1) for _ in range(n)]
    return *tracking[:_TRACKING], s, *tracking[_TRACKING:], *sample_inputs(own, rng)


def _matrix_gain(gains: Mapping[str, Any], name: str, what: str, n: int) -> Parameter:
    port = Port(name, (n, n), description=f"{what}, symmetric")
    return parameter(port, gain(gains, name, "an integral law"), lambda value, name: positive_matrix(value, n, name))


def _inverse(ops: Arithmetic, gain: Parameter, value: Any) -> Matrix:
    """Of a gain: exact where it is a number, else from the input's value at each call."""
    return inverse(ops, value) if gain.value is None else constant_matrix(ops, gain.value.inv())
