"""Tracking laws on any matrix group, from an error function, a transport map and an inertia.

    f = f_P + f_D + f_FF,  f_P,a = -d_1 phi_a,  f_D = -K_d (xi - nu),  nu = P(X, X_d) xi_d        (28)
    W = phi + <I xi_e, xi_e>/2,  xi_e = xi - nu,  dW/dt = -<K_d xi_e, xi_e>  along I xi' = ad*_xi I xi + f

with the feedforward by name (all share dW/dt and give different trajectories):

    basic        -ad*_nu I xi + I nu'                    (29) with S = 0; printed without the I before xi
    right        -ad*_xi I nu + I (nu' + [xi, nu])       f_FF,r of section 5.4: (29) with 2 S_tau
    left         the same as basic; with nu = xi_d it is f_FF,l of section 5.4
    levi_civita  I (nabla_xi nu + nu')                   Theorem 4.2

Where actuators are weak, `damping_limits` shortens f_D alone: f_D = -s K_d xi_e with the largest s <= 1 that keeps every component within its
limit, so that dW/dt = -s <K_d xi_e, xi_e> and W still falls; to clip the whole force may make W rise.

Bullo and Murray, CIT-CDS 97-003, sections 4 and 5.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from typing import Any

from lie_codegen.control.claims import check_claims
from lie_codegen.control.compatibility import check_compatibility
from lie_codegen.control.error_catalogue import error_names, gain, law_error
from lie_codegen.control.error_derivatives import ErrorDerivatives
from lie_codegen.control.error_inputs import input_parameters
from lie_codegen.control.force_limits import force_limits
from lie_codegen.control.guarded_law import on_group_alone
from lie_codegen.errors import InputError
from lie_codegen.exact.positive_matrix import body_inertia, positive_matrix
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.matrices import GroupMatrices, matrix_port, random_element, velocity_units
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.matrix_pattern import RealMatrices
from lie_codegen.groups.units import force_units
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.brackets import ad_star, bracket
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import (
    Matrix,
    Vector,
    dot,
    matvec,
    minus,
    negative,
    plus,
    scaled,
)
from lie_codegen.kernel.parameter import input_ports, parameter, sample_inputs, values_of
from lie_codegen.kernel.saturation import shortened
from lie_codegen.on_demand import sympy as sp

#: The feedforwards by name.
FEEDFORWARDS = ("basic", "right", "left", "levi_civita")


@kernel_factory(group=as_group)
def tracking_law(
    group: GroupLike,
    *,
    inertia: Any,
    error: Any,
    gains: Mapping[str, Any] | None = None,
    feedforward: str = "basic",
    damping_limits: Any = None,
    tunable: bool = False,
    name: str = "tracking_law",
) -> Kernel:
    """The tracking law as a kernel (X, xi, X_d, xi_d, xi_d_dot) -> (force, phi, W, W_dot).

    Args:
        group: any matrix group.
        inertia: symmetric positive definite on the algebra: a number, a diagonal or an (n, n) matrix; or "input": then it is an
            input of the kernel by that name, (n, n), behind the others. So may K_d be, and every gain of the error function.
        error: a name ("so3_right", "so3_left", "se3_1" .. "se3_6", "frobenius"), an `ErrorFunction`, or (phi,
        transport)
            as `error_function` takes them, with the parameters among the gains.
        gains: K_d (dissipation) and what the error function needs: K_p, or K_1 and K_2, or its parameters.
        feedforward: "basic", "right", "left" or "levi_civita".
        damping_limits: largest |f_D| of each component: a number, (n,), or "input"; None for none. The largest f_P on a level of W is
            `lc.certificate(...).proportional`: gains for which the two and the feedforward stay within the actuators need no clipping.
        tunable: inertia and K_d are inputs, whether or not numbers are given; the error function is compiled in.
        name: C identifier of the kernel.

    Raises:
        InputError: an indefinite inertia or gain, a name that is not known, a gain that is missing; phi is negative somewhere; its
            `constant` is not valid.
        IncompatibleError: phi and the transport map do not satisfy (A2); with the residual.
    """
    group = as_group(group, "tracking_law")
    if feedforward not in FEEDFORWARDS:
        raise InputError(f"feedforward {feedforward!r} is not known; choose one of {', '.join(FEEDFORWARDS)}")
    if gains is not None and not isinstance(gains, Mapping):
        raise InputError(f"gains must be a mapping such as {{'K_p': 4, 'K_d': 6}}, got {gains!r}")
    gains = gains or {}
    pair = law_error(group, error, gains)
    shape, K_d = (group.dim, group.dim), gain(gains, "K_d", "a tracking law")
    parameters = (
        parameter(
            Port("inertia", shape, description="of the body, symmetric"),
            inertia,
            lambda value, _: _inertia(group, value),
            tunable=tunable,
        ),
        parameter(
            Port("K_d", shape, description="dissipation, symmetric"),
            K_d,
            lambda value, name: positive_matrix(value, group.dim, name),
            tunable=tunable,
        ),
        *force_limits(damping_limits, group.dim, "damping_limits"),
        *input_parameters(pair),
    )
    bounded = damping_limits is not None
    check_compatibility(pair)
    check_claims(pair)
    real, data = derivation_of(group).real, derivation_of(group).wei_norman

    def body(ops: Arithmetic, X: Any, xi: Any, X_d: Any, xi_d: Any, xi_d_dot: Any, *given: Any) -> tuple[Any, ...]:
        read = GroupMatrices(ops, real).read
        metric, K_d, *rest = values_of(ops, parameters, given)
        limits = rest.pop(0) if bounded else None
        at = ErrorDerivatives(ops, pair, real, read(X), read(X_d), rest)
        return _law(at, metric, K_d, feedforward, xi, xi_d, xi_d_dot, limits)

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        def vector() -> list[float]:
            return [rng.uniform(-1, 1) for _ in range(group.dim)]

        X, X_d = random_element(group, data, rng), random_element(group, data, rng)
        return X, vector(), X_d, vector(), vector(), *sample_inputs(parameters, rng)

    n, speed = group.dim, velocity_units(group)
    law = Kernel(
        name=name,
        namespace=group.name,
        inputs=(
            matrix_port(group, "X", "configuration, body to inertial"),
            Port("xi", (n,), speed, description="body velocity, X' = X hat(xi)"),
            matrix_port(group, "X_d", "reference configuration"),
            Port("xi_d", (n,), speed, description="reference velocity in the frame of the reference"),
            Port("xi_d_dot", (n,), velocity_units(group, "s^2"), description="its rate of change"),
            *input_ports(parameters),
        ),
        outputs=(
            Port("force", (n,), force_units(group), description="body force f of I xi' = ad*_xi I xi + f"),
            Port("phi", (), "J", description="configuration error"),
            Port("W", (), "J", description="total error energy, phi + <I xi_e, xi_e>/2"),
            Port("W_dot", (), "W", description="dW/dt = -<K_d xi_e, xi_e>"),
        ),
        body=body,
        formula=f"f = -d_1 phi - K_d (xi - nu) + f_FF; error {pair.name}, feedforward {feedforward}"
        + ("; f_D within its limits" if bounded else ""),
        source="Bullo and Murray, CIT-CDS 97-003, (28), (29), Theorem 4.2",
        sampler=sampler,
    )
    return on_group_alone(law, group, ("X", "X_d"))


def _inertia(group: MatrixGroup, inertia: Any) -> sp.ImmutableMatrix:
    rotations = group.degree == 3 and "so3_right" in error_names(group)
    return body_inertia(inertia) if rotations else positive_matrix(inertia, group.dim, "inertia")


def _law(
    at: ErrorDerivatives,
    metric: Matrix,
    dissipation: Matrix,
    feedforward: str,
    xi: Sequence[Scalar],
    xi_d: Sequence[Scalar],
    xi_d_dot: Sequence[Scalar],
    limits: Sequence[Scalar] | None,
) -> tuple[Any, ...]:
    phi, slope = at.differential(1)
    nu, nu_dot, turned = at.transported_rates(xi, xi_d, xi_d_dot)
    xi_e = minus(xi, nu)
    damping = matvec(dissipation, xi_e)
    if limits is not None:
        damping = shortened(at.ops, damping, limits)
    forward = feedforward_force(at.ops, at.real, metric, feedforward, xi, nu, nu_dot, turned)
    force = plus(negative(slope), negative(damping), forward)
    energy = phi + dot(matvec(metric, xi_e), xi_e) / 2
    return force, phi, energy, -dot(damping, xi_e)


def motion_ports(group: MatrixGroup) -> tuple[Port, ...]:
    """(X, xi, X_d, xi_d, xi_d_dot): what a law with a memory of its own reads of the motion and of its reference."""
    n, speed = group.dim, velocity_units(group)
    return (
        matrix_port(group, "X", "configuration, body to inertial"),
        Port("xi", (n,), speed, description="body velocity"),
        matrix_port(group, "X_d", "reference configuration"),
        Port("xi_d", (n,), speed, description="reference velocity"),
        Port("xi_d_dot", (n,), velocity_units(group, "s^2"), description="its rate of change"),
    )


def feedforward_force(
    ops: Arithmetic,
    real: RealMatrices,
    metric: Matrix,
    kind: str,
    xi: Sequence[Scalar],
    nu: Vector,
    nu_dot: Vector,
    turned: Vector,
) -> Vector:
    """The feedforward of that name, linear in the metric; `turned` is nu' + [xi, nu]."""
    algebra = real.group.algebra
    if kind == "right":
        return minus(matvec(metric, turned), ad_star(ops, algebra, xi, matvec(metric, nu)))
    if kind == "levi_civita":
        return plus(matvec(metric, nu_dot), lowered_connection(ops, real, metric, xi, nu))
    return minus(matvec(metric, nu_dot), ad_star(ops, algebra, nu, matvec(metric, xi)))


def lowered_connection(
    ops: Arithmetic, real: RealMatrices, metric: Matrix, x: Sequence[Scalar], y: Sequence[Scalar]
) -> Vector:
    """I nabla_x y = I [x, y]/2 - (ad*_x I y + ad*_y I x)/2, (8); no inverse of I is needed."""
    algebra = real.group.algebra
    half = ops.constant(sp.Rational(1, 2))
    symmetric = plus(ad_star(ops, algebra, x, matvec(metric, y)), ad_star(ops, algebra, y, matvec(metric, x)))
    return scaled(half, minus(matvec(metric, bracket(ops, algebra, x, y)), symmetric))
