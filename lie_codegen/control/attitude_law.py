"""Attitude laws on SO(3) as kernels; see `lie_codegen.control.attitude` for the formulas and their errata."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lie_codegen.control.attitude import gyroscopic_factor
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.positive_matrix import body_inertia, positive_matrix, positive_number, real_number
from lie_codegen.groups.catalogue_load import group
from lie_codegen.groups.derivation import GroupDerivation
from lie_codegen.groups.maps.admission import NEAR_GROUP
from lie_codegen.groups.maps.exponential import jacobian
from lie_codegen.groups.maps.guard import kept_where, nan_off_group
from lie_codegen.groups.maps.rotation_log import half_angle_ratio, rotation_log
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.dual import DualArithmetic, tangent_of, value_of
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import (
    Matrix,
    Vector,
    cross,
    dot,
    matmul,
    matvec,
    minus,
    number,
    plus,
    scaled,
    transpose,
)
from lie_codegen.kernel.parameter import Parameter, input_ports, parameter, sample_inputs, values_of
from lie_codegen.on_demand import sympy as sp

_KINDS = ("p", "pd", "reduced")
_ATTITUDE = Port("X", (3, 3), description="attitude error: body to reference, R_d' R")
_BODY = Port("X", (3, 3), description="attitude, body to inertial")
_RATE = Port("omega", (3,), "rad/s", description="body angular velocity")
_DESIRED = (
    Port("X_d", (3, 3), description="desired attitude"),
    Port("xi_d", (3,), "rad/s", description="its body velocity, X_d' = X_d hat(xi_d)"),
    Port("xi_d_dot", (3,), "rad/s^2", description="the rate of that"),
)


def _units(parameters: Mapping[str, Any]) -> Mapping[str, str]:
    """Of the gains: the kinds that command a velocity, and the one that commands a torque."""
    if parameters.get("kind", "pd") != "pd":
        return {"k_p": "1/s"}
    return {"inertia": "kg m^2", "k_p": "N m/rad", "k_d": "N m s/rad"}


@kernel_factory(units=_units)
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
        return nan_off_group(law, group("so3"), ports)
    if inertia is not None:
        _inertia(inertia, False)
    if k_d is not None:
        _gain(Port("k_d", ()), k_d, False)
    gyroscopic_factor(gyroscopic)
    gain = _gain(Port("k_p", (), "1/s", description="gain"), k_p, tunable)
    if kind == "reduced":
        if tracking or gain.port.shape:
            raise InputError(
                "the attitude law 'reduced' has a number k_p and no tracking form; a loop gives it X_d' X instead"
            )
        made = _reduced(gain, z)
    else:
        made = nan_off_group(_proportional(gain, tracking), group("so3"), ports)
    return replace(made, name=name or made.name)


def _gain(port: Port, value: Any, tunable: bool) -> Parameter:
    """A positive number; or, given as one, a diagonal or a symmetric positive definite matrix."""
    listed = not isinstance(value, str) and (isinstance(value, Sequence) or hasattr(value, "shape"))
    if listed and np.ndim(value):
        return parameter(
            replace(port, shape=(3, 3)), value, lambda given, what: positive_matrix(given, 3, what), tunable=tunable
        )
    return parameter(port, value, positive_number, tunable=tunable)


def _times(gain: Any, vector: Vector) -> Vector:
    """A number or a matrix times a vector."""
    return matvec(gain, vector) if isinstance(gain, list) else scaled(gain, vector)


def _inertia(value: Any, tunable: bool) -> Parameter:
    port = Port("inertia", (3, 3), "kg m^2", description="inertia of the body, symmetric")
    return parameter(port, value, body_inertia, tunable=tunable)


def _parameters(inertia: Any, k_p: Any, k_d: Any, tunable: bool) -> tuple[Parameter, ...]:
    """Of a law that commands a torque."""
    stiffness = Port("k_p", (), "N m/rad", description="stiffness")
    damping = Port("k_d", (), "N m s/rad", description="damping")
    return (
        _inertia(inertia, tunable),
        _gain(stiffness, k_p, tunable),
        _gain(damping, k_d, tunable),
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
        inputs=(*((_BODY, *_DESIRED[:2]) if tracking else (_ATTITUDE,)), *input_ports([k_p])),
        outputs=(
            Port("omega", (3,), "rad/s", description="commanded body angular velocity"),
            Port("V", (), "rad^2", description="|theta|^2/2"),
            Port("V_dot", (), "rad^2/s", description="-theta' k_p theta"),
        ),
        body=body,
        formula="omega = -k_p log R; R(t) = exp(e^{-k_p t} log R(0))" + moving,
        source="Geyer, The Attitude Control Problem, (17) with omega where omega' is printed",
        sampler=lambda rng: (_rotation(rng), *_desired(rng)[: 2 * tracking], *sample_inputs([k_p], rng)),
    )


def _proportional_derivative(parameters: Sequence[Parameter], gyroscopic: str, tracking: bool) -> Kernel:
    factor = gyroscopic_factor(gyroscopic)
    derivation = GroupDerivation(group("so3"))

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
        inputs=(*((_BODY, _RATE, *_DESIRED) if tracking else (_ATTITUDE, _RATE)), *input_ports(parameters)),
        outputs=(
            Port("torque", (3,), "N m", description="body torque tau of I omega' = -omega x I omega + tau"),
            Port("V", (), "J", description=f"theta' k_p theta/2 + {rate}' I {rate}/2"),
            Port("V_dot", (), "W", description=f"-{rate}' k_d {rate}"),
        ),
        body=body,
        formula=f"tau = {factor} {rate} x I omega - k_p log R - k_d {rate}{forward}",
        source="Geyer, The Attitude Control Problem, (18); the printed sign of omega x I omega goes with the printed (3)",
        sampler=lambda rng: (
            _rotation(rng),
            [rng.uniform(-1, 1) for _ in range(3)],
            *_desired(rng)[: 3 * tracking],
            *sample_inputs(parameters, rng),
        ),
    )


def _desired(rng: random.Random) -> tuple[Any, ...]:
    """X_d, xi_d, xi_d_dot."""
    return _rotation(rng), *([rng.uniform(-1, 1) for _ in range(3)] for _ in range(2))


def _reduced(k_p: Parameter, z: Sequence[Any]) -> Kernel:
    if len(z) != 3:
        raise ShapeError(f"z has {len(z)} entries; give the three of an inertial direction")
    exact = [real_number(entry, f"z[{i}]") for i, entry in enumerate(z)]
    length = sp.sqrt(sum(entry**2 for entry in exact))
    if length == 0:
        raise InputError("z is zero; give the inertial direction that the sensor sees")
    unit = [entry / length for entry in exact]

    def body(ops: Arithmetic, y: Vector, *given: Any) -> tuple[Any, ...]:
        axis = [number(ops, entry) for entry in unit]
        of_unit_length = ops.less(ops.fabs(dot(y, y) - 1), ops.constant(2 * NEAR_GROUP))
        normal, cosine = cross(axis, y), dot(axis, y)
        ratio = _angle_over_sine(ops, dot(normal, normal), cosine)
        error, [gain] = scaled(ratio, normal), values_of(ops, [k_p], given)
        square = dot(error, error)
        values = (scaled(gain, error), square / 2, -gain * square)
        return tuple(kept_where(ops, [of_unit_length], value) for value in values)

    return Kernel(
        name="attitude_reduced",
        namespace="so3",
        inputs=(
            Port("y", (3,), description="measured direction R' z in the body frame, of unit length"),
            *input_ports([k_p]),
        ),
        outputs=(
            Port("omega", (3,), "rad/s", description="commanded body angular velocity"),
            Port("V", (), "rad^2", description="alpha^2/2, alpha the angle from y to z"),
            Port("V_dot", (), "rad^2/s", description="-k_p alpha^2"),
        ),
        body=body,
        formula="omega = k_p alpha (z x y)/|z x y|; alpha(t) = alpha(0) e^{-k_p t}; singular at y = -z alone",
        source="Geyer, The Attitude Control Problem, Proposition 22, for y = R' z",
        sampler=lambda rng: ([row[2] for row in _rotation(rng)], *sample_inputs([k_p], rng)),
    )


def _angle_over_sine(ops: Arithmetic, sine_squared: Scalar, cosine: Scalar) -> Scalar:
    """alpha/sin alpha for alpha in [0, pi), by the half angle: alpha = 2 atan2(sin alpha, 1 + cos alpha).

    At alpha = pi the direction is lost: the value there is 0, the law commands nothing, and any disturbance leaves
    that set.
    """
    away = ops.less(-1 + _ANTIPODE, cosine)
    safe = ops.where(away, 1 + cosine, 1)
    tangent_squared = ops.where(away, sine_squared, 0) / (safe * safe)
    return ops.where(away, half_angle_ratio(ops, 1, tangent_squared) / safe, 0)


#: Distance of the cosine from -1 below which the antipode is treated as reached.
_ANTIPODE = 1e-14


@kernel_factory(units=_units)
def attitude_lyapunov(
    *, inertia: Any, k_p: Any, k_d: Any, epsilon: Any, gyroscopic: str = "none", name: str = "attitude_lyapunov"
) -> Kernel:
    """The strict Lyapunov function of Proposition 21 and its rate: (X, omega) -> (V, V_dot); each number may be "input".

        V = k_p |theta|^2/2 + omega' I omega/2 + epsilon theta' I omega

    V_dot is the derivative along the closed loop, by a dual number through the logarithm itself, so that it holds for
    every gyroscopic term; for epsilon below `cross_term_bound` it is negative for gyroscopic "none" and |theta| < pi.

    Raises:
        InputError: as `attitude_law`.
    """
    parameters = (
        _inertia(inertia, False),
        parameter(Port("k_p", (), "N m/rad"), k_p, positive_number),
        parameter(Port("k_d", (), "N m s/rad"), k_d, positive_number),
        parameter(Port("epsilon", (), "1/s", description="of the cross term"), epsilon, positive_number),
    )
    c = gyroscopic_factor(gyroscopic) - 1

    def body(ops: Arithmetic, X: Matrix, omega: Vector, *given: Any) -> tuple[Any, ...]:
        metric, p, d, e = values_of(ops, parameters, given)
        dual = DualArithmetic(ops)
        wx = [[0, -omega[2], omega[1]], [omega[2], 0, -omega[0]], [-omega[1], omega[0], 0]]
        rate = matmul(X, wx)
        moving = [[dual.variable(X[i][j], {0: rate[i][j]}) for j in range(3)] for i in range(3)]
        logarithm = rotation_log(dual, moving)
        theta = [value_of(entry, dual.level) for entry in logarithm]
        theta_dot = [tangent_of(entry, 0, dual.level) for entry in logarithm]
        momentum = matvec(metric, omega)
        action = plus(scaled(p, theta), scaled(d, omega))
        force = minus(scaled(c, cross(omega, momentum)), action)
        V = (p * dot(theta, theta) + dot(omega, momentum)) / 2 + e * dot(theta, momentum)
        crossing = dot(theta_dot, momentum) + dot(theta, force)
        return V, -d * dot(omega, omega) + e * crossing

    return Kernel(
        name=name,
        namespace="so3",
        inputs=(_ATTITUDE, _RATE, *input_ports(parameters)),
        outputs=(Port("V", (), "J"), Port("V_dot", (), "W")),
        body=body,
        formula="V = k_p |theta|^2/2 + omega' I omega/2 + epsilon theta' I omega, and dV/dt along the closed loop",
        source="Geyer, The Attitude Control Problem, proof of Proposition 21",
        sampler=lambda rng: (_rotation(rng), [rng.uniform(-1, 1) for _ in range(3)], *sample_inputs(parameters, rng)),
    )


def _rotation(rng: random.Random) -> list[list[float]]:
    """A rotation by a random unit quaternion."""
    q = np.array([rng.gauss(0, 1) for _ in range(4)])
    a, b, c, d = q / np.linalg.norm(q)
    R = [
        [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
        [2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)],
        [2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d],
    ]
    return [[float(entry) for entry in row] for row in R]
