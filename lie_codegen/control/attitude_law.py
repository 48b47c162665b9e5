"""Attitude laws on SO(3) as kernels; see `lie_codegen.control.attitude` for the formulas and their errata."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from lie_codegen.control.attitude import gyroscopic_factor
from lie_codegen.control.attitude_ports import (
    ATTITUDE,
    BODY,
    DESIRED,
    RATE,
    attitude_gain,
    body_inertia_parameter,
    random_reference,
    random_rotation,
    units_of_gains,
)
from lie_codegen.control.guarded_law import on_group_alone
from lie_codegen.control.reduced_attitude_law import reduced_law
from lie_codegen.errors import InputError
from lie_codegen.groups.catalogue_load import group
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.exponential import jacobian
from lie_codegen.groups.maps.rotation_log import rotation_log
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import (
    Matrix,
    Vector,
    cross,
    dot,
    matmul,
    matvec,
    minus,
    plus,
    scaled,
    transpose,
)
from lie_codegen.kernel.parameter import Parameter, input_ports, sample_inputs, values_of

_KINDS = ("p", "pd", "reduced")


@kernel_factory(units=units_of_gains)
def attitude_law(
    kind: str = "p",
    *,
    inertia: Any = None,
    k_p: Any = 1,
    k_d: Any = None,
    gyroscopic: str = "cancel",
    z: Sequence[Any] = (0, 0, 1),
    tracking: bool = False,
    tunable: bool = False,
    name: str | None = None,
) -> Kernel:
    """An attitude law of Geyer's paper.

    With `tracking` the desired attitude moves (Problem 2): X is the attitude itself and X_d the desired one, theta = log(X_d' X),
    nu = X' X_d omega_d, omega_e = omega - nu,

        p     omega = nu - k_p theta
        pd    tau = c omega_e x I omega + nu x I omega + I nu' - J' k_p theta - k_d omega_e,  V' = -omega_e' k_d omega_e

    for every gyroscopic factor c; with J the inverse of the right Jacobian at theta, which leaves theta as it is where k_p is a number.

    Args:
        kind: "p", (X) -> (omega, V, V_dot), the law (17); "pd", (X, omega) -> (torque, V, V_dot), the law (18);
            "reduced", (y) -> (omega, V, V_dot), Proposition 22 for a body sensor y = R' z.
        inertia: [kg m^2], for "pd": a number, a diagonal or a matrix; or "input", as any gain: then it is an input of the
            kernel by that name, (3, 3), behind the others. "p" and "reduced" command a velocity and use none of inertia, k_d, gyroscopic:
            these are checked and ignored there, so that one call serves all kinds.
        k_p: [1/s] for "p" and "reduced", [N m/rad] for "pd"; for "p" and "pd" perhaps a diagonal or a symmetric (3, 3) matrix.
        k_d: [N m s/rad], for "pd"; likewise.
        gyroscopic: "cancel", "none" or "double", for "pd".
        z: the inertial direction that the sensor of "reduced" sees, of any length.
        tracking: "p" and "pd" take the desired attitude behind the other inputs: (X, X_d, xi_d) and (X, omega, X_d, xi_d, xi_d_dot),
            xi_d the desired body velocity in the frame of X_d.
        tunable: inertia and gains are all inputs, whether or not numbers are given.
        name: C identifier: the symbol is so3_<name>; "attitude_" and the kind if None.

    Raises:
        InputError: an unknown kind or gyroscopic term, an indefinite inertia, a gain that is not positive.

    Warns:
        InertiaWarning: the inertia belongs to no rigid body (triangle inequality).
    """
    if kind not in _KINDS:
        raise InputError(f"attitude law {kind!r} is not known; choose one of {', '.join(_KINDS)}")
    ports = ("X", "X_d") if tracking else ("X",)
    if kind == "pd":
        if not tunable and (inertia is None or k_d is None):
            raise InputError("the attitude law 'pd' needs inertia and k_d")
        parameters = _parameters(inertia, k_p, k_d, tunable)
        law = replace(_proportional_derivative(parameters, gyroscopic, tracking), name=name or "attitude_pd")
        return on_group_alone(law, group("so3"), ports)
    if inertia is not None:
        body_inertia_parameter(inertia, False)
    if k_d is not None:
        attitude_gain(Port("k_d", ()), k_d, False)
    gyroscopic_factor(gyroscopic)
    gain = attitude_gain(Port("k_p", (), "1/s", description="gain"), k_p, tunable)
    if kind == "reduced":
        if tracking or gain.port.shape:
            raise InputError(
                "the attitude law 'reduced' has a number k_p and no tracking form; a loop gives it X_d' X instead"
            )
        made = reduced_law(gain, z)
    else:
        made = on_group_alone(_proportional(gain, tracking), group("so3"), ports)
    return replace(made, name=name or made.name)


def _times(gain: Any, vector: Vector) -> Vector:
    """A number or a matrix times a vector."""
    return matvec(gain, vector) if isinstance(gain, list) else scaled(gain, vector)


def _parameters(inertia: Any, k_p: Any, k_d: Any, tunable: bool) -> tuple[Parameter, ...]:
    """Of a law that commands a torque."""
    stiffness = Port("k_p", (), "N m/rad", description="stiffness")
    damping = Port("k_d", (), "N m s/rad", description="damping")
    return (
        body_inertia_parameter(inertia, tunable),
        attitude_gain(stiffness, k_p, tunable),
        attitude_gain(damping, k_d, tunable),
    )


def _relative(X: Matrix, X_d: Matrix) -> Matrix:
    """X_d' X."""
    return matmul(transpose(X_d), X)


def _proportional(k_p: Parameter, tracking: bool) -> Kernel:
    def body(ops: Arithmetic, X: Matrix, *given: Any) -> tuple[Any, ...]:
        E, numbers = (_relative(X, given[0]), given[2:]) if tracking else (X, given)
        theta = rotation_log(ops, E)
        [gain] = values_of(ops, [k_p], numbers)
        pull = _times(gain, theta)
        command = scaled(-1, pull)
        if tracking:
            command = plus(command, matvec(transpose(E), given[1]))
        return command, dot(theta, theta) / 2, -dot(theta, pull)

    moving = ", about the moving X_d" if tracking else ""
    return Kernel(
        name="attitude_p",
        namespace="so3",
        inputs=(*((BODY, *DESIRED[:2]) if tracking else (ATTITUDE,)), *input_ports([k_p])),
        outputs=(
            Port("omega", (3,), "rad/s", description="commanded body angular velocity"),
            Port("V", (), "rad^2", description="|theta|^2/2"),
            Port("V_dot", (), "rad^2/s", description="-theta' k_p theta"),
        ),
        body=body,
        formula="omega = -k_p log R; R(t) = exp(e^{-k_p t} log R(0))" + moving,
        source="Geyer, The Attitude Control Problem, (17) with omega where omega' is printed",
        sampler=lambda rng: (random_rotation(rng), *random_reference(rng)[: 2 * tracking], *sample_inputs([k_p], rng)),
    )


def _proportional_derivative(parameters: Sequence[Parameter], gyroscopic: str, tracking: bool) -> Kernel:
    factor = gyroscopic_factor(gyroscopic)
    derivation = derivation_of(group("so3"))

    def body(ops: Arithmetic, X: Matrix, omega: Vector, *given: Any) -> tuple[Any, ...]:
        E, numbers = (_relative(X, given[0]), given[3:]) if tracking else (X, given)
        metric, p, d = values_of(ops, parameters, numbers)
        theta = rotation_log(ops, E)
        rate, forward = omega, None
        if tracking:
            # (X' X_d)' = -hat(omega_e) X' X_d, so that nu' = X' X_d omega_d' - omega_e x nu.
            nu = matvec(transpose(E), given[1])
            rate = minus(omega, nu)
            nu_dot = minus(matvec(transpose(E), given[2]), cross(rate, nu))
            forward = plus(cross(nu, matvec(metric, omega)), matvec(metric, nu_dot))
        stiff, damping = _times(p, theta), _times(d, rate)
        pull = stiff
        if isinstance(p, list):
            # d/dt theta = J omega_e: the gradient of theta' k_p theta/2 is J' k_p theta, and only for a number is that k_p theta.
            pull = matvec(transpose(jacobian(ops, derivation, theta, "right", inverse=True)), stiff)
        torque = minus(scaled(factor, cross(rate, matvec(metric, omega))), plus(pull, damping))
        V = (dot(theta, stiff) + dot(rate, matvec(metric, rate))) / 2
        return torque if forward is None else plus(torque, forward), V, -dot(rate, damping)

    rate = "omega_e" if tracking else "omega"
    forward = " + nu x I omega + I nu'" if tracking else ""
    return Kernel(
        name="attitude_pd",
        namespace="so3",
        inputs=(*((BODY, RATE, *DESIRED) if tracking else (ATTITUDE, RATE)), *input_ports(parameters)),
        outputs=(
            Port("torque", (3,), "N m", description="body torque tau of I omega' = -omega x I omega + tau"),
            Port("V", (), "J", description=f"theta' k_p theta/2 + {rate}' I {rate}/2"),
            Port("V_dot", (), "W", description=f"-{rate}' k_d {rate}"),
        ),
        body=body,
        formula=f"tau = {factor} {rate} x I omega - k_p log R - k_d {rate}{forward}",
        source="Geyer, The Attitude Control Problem, (18); the printed sign of omega x I omega goes with the printed (3)",
        sampler=lambda rng: (
            random_rotation(rng),
            [rng.uniform(-1, 1) for _ in range(3)],
            *random_reference(rng)[: 3 * tracking],
            *sample_inputs(parameters, rng),
        ),
    )
