"""Tracking of position and heading by a quadrotor on SE(3): the law of Lee, Leok and McClamroch (2010), and its
reference.

World axes with e_3 down, X = (R, x) body to world, body velocity xi = (Omega, V), v = R V:

    m v' = m g e_3 - f R e_3,  J Omega' + Omega x J Omega = M
    A = -k_x (x - x_d) - k_v (v - x_d') - m g e_3 + m x_d'',   f = -A . R e_3,   b_3 = -A/|A|
    R_c = [b_2 x b_3, b_2, b_3],  b_2 = b_3 x b_1d/|b_3 x b_1d|
    M = -k_R e_R - k_W e_W + Omega x J Omega - J (Omega^ R' R_c Omega_c - R' R_c Omega_c')
    e_R = (R_c' R - R' R_c)^v/2,   e_W = Omega - R' R_c Omega_c

Omega_c and Omega_c' are derived by dual numbers from A' and A'', which follow from the model itself; nothing is
differenced. The law is singular where A = 0 (a free fall is asked for) and where b_3 is along b_1d.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from typing import Any

from lie_codegen.control.second_order_step import ForceBody
from lie_codegen.errors import InputError
from lie_codegen.exact.expression import FORMULA_FUNCTIONS, parse_expression, time_symbol
from lie_codegen.exact.positive_matrix import body_inertia, positive_number
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.dual import DualArithmetic, tangent_of, value_of
from lie_codegen.kernel.expressions import ExpressionEvaluator
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
from lie_codegen.kernel.parameter import input_ports, parameter, sample_inputs, values_of
from lie_codegen.on_demand import sympy as sp

#: Standard gravity [m/s^2].
GRAVITY = "9.80665"
_GAINS = ("k_x", "k_v", "k_R", "k_W")
_REFERENCE = ("x_d", "v_d", "a_d", "j_d", "s_d", "b_1d", "b_1d_dot", "b_1d_ddot")


@kernel_factory(units={"mass": "kg", "inertia": "kg m^2", "gravity": "m/s^2"})
def quadrotor_law(
    *,
    mass: Any,
    inertia: Any,
    gains: Mapping[str, Any],
    gravity: Any = GRAVITY,
    tunable: bool = False,
    name: str = "quadrotor_law",
) -> Kernel:
    """The law as a kernel (X, xi, x_d, v_d, a_d, j_d, s_d, b_1d, b_1d_dot, b_1d_ddot) -> (thrust, moment, Psi, rate).

    `rate` is R' R_c Omega_c, the body rate that a cascade hands to an autopilot; Psi = tr(1 - R_c' R)/2.

    Args:
        mass: [kg].
        inertia: (3, 3) [kg m^2].
        gains: k_x [N/m], k_v [N s/m], k_R [N m], k_W [N m s].
        gravity: [m/s^2]. Each of these numbers may be "input": an input of that name, behind the others.
        tunable: all of them are inputs.
        name: C identifier.

    Raises:
        InputError: an indefinite inertia, a gain that is missing, unknown or not positive.
    """
    if sorted(gains) != sorted(_GAINS):
        raise InputError(f"a quadrotor law needs the gains {', '.join(_GAINS)}; given: {', '.join(gains)}")
    units = {"k_x": "N/m", "k_v": "N s/m", "k_R": "N m", "k_W": "N m s"}
    parameters = (
        parameter(Port("mass", (), "kg"), mass, positive_number, tunable=tunable),
        parameter(Port("gravity", (), "m/s^2"), gravity, positive_number, tunable=tunable),
        parameter(Port("inertia", (3, 3), "kg m^2"), inertia, body_inertia, tunable=tunable),
        *(parameter(Port(key, (), units[key]), gains[key], positive_number, tunable=tunable) for key in _GAINS),
    )
    count = len(_REFERENCE)

    def body(ops: Arithmetic, X: Matrix, xi: Vector, *rest: Any) -> tuple[Any, ...]:
        m, g, J, *k = values_of(ops, parameters, rest[count:])
        return _law(ops, m, g, J, dict(zip(_GAINS, k, strict=True)), X, xi, rest[:count])

    return Kernel(
        name=name,
        namespace="se3",
        inputs=(
            Port("X", (4, 4), description="body to world, e_3 down"),
            Port("xi", (6,), "rad/s, rad/s, rad/s, m/s, m/s, m/s", description="body velocity (Omega, V)"),
            Port("x_d", (3,), "m", description="position to follow"),
            Port("v_d", (3,), "m/s"),
            Port("a_d", (3,), "m/s^2"),
            Port("j_d", (3,), "m/s^3"),
            Port("s_d", (3,), "m/s^4"),
            Port("b_1d", (3,), "", description="direction in which the first body axis should point"),
            Port("b_1d_dot", (3,), "1/s"),
            Port("b_1d_ddot", (3,), "1/s^2"),
            *input_ports(parameters),
        ),
        outputs=(
            Port("thrust", (), "N", description="f, along -R e_3"),
            Port("moment", (3,), "N m"),
            Port("Psi", (), "", description="attitude error tr(1 - R_c' R)/2, 2 at 180 degrees"),
            Port("rate", (3,), "rad/s", description="commanded body rate, for a cascade"),
        ),
        body=body,
        formula="f = -A.R e_3, M = -k_R e_R - k_W e_W + Omega x J Omega - J (Omega^ R'R_c Omega_c - R'R_c Omega_c')",
        source="the law of Lee, Leok and McClamroch (2010); derivation in the module",
        sampler=lambda rng: (*_sample(rng), *sample_inputs(parameters, rng)),
    )


@kernel_factory()
def flat_reference(position: Sequence[Any], heading: Any = 0, name: str = "flat_reference") -> Kernel:
    """The reference of the law from formulas of t: t -> (x_d, ..., s_d, b_1d, b_1d_dot, b_1d_ddot).

    Args:
        position: three formulas of t [m].
        heading: formula of t [rad]: b_1d = (cos, sin, 0).
        name: C identifier.

    Raises:
        InputError: not three formulas.
        ExpressionError: a text outside the grammar.
    """
    if isinstance(position, str) or len(position) != 3:
        raise InputError("a flat reference needs three formulas of t for the position")
    names = {"t": time_symbol(), "pi": sp.pi}
    path = [parse_expression(str(p), names, FORMULA_FUNCTIONS) for p in position]
    psi = parse_expression(str(heading), names, FORMULA_FUNCTIONS)
    curves = [[sp.diff(p, time_symbol(), order) if order else p for p in path] for order in range(5)]
    first = [sp.cos(psi), sp.sin(psi), sp.S.Zero]
    curves += [[sp.diff(b, time_symbol(), order) if order else b for b in first] for order in range(3)]

    def body(ops: Arithmetic, t: Scalar) -> tuple[Any, ...]:
        evaluate = ExpressionEvaluator(ops, {time_symbol(): t})
        return tuple([evaluate(entry) for entry in curve] for curve in curves)

    units = ("m", "m/s", "m/s^2", "m/s^3", "m/s^4", "", "1/s", "1/s^2")
    outputs = tuple(Port(port, (3,), unit) for port, unit in zip(_REFERENCE, units, strict=True))
    return Kernel(name, "se3", (Port("t", (), "s"),), outputs, body, "derivatives of the formulas", "exact derivatives")


def quadrotor_force(law: Kernel, reference: Kernel, *, mass: Any, gravity: Any = GRAVITY) -> ForceBody:
    """The body force (M, -f e_3 + m g R' e_3), (6,) [N m, N], of the law along a flat reference, for `closed_loop(external=...)`.

    Args:
        law: (X, xi, flat reference) -> (thrust f [N], moment M [N m], ...), as `quadrotor_law` makes it.
        reference: t -> the flat reference, as `flat_reference` makes it.
        mass: [kg]. gravity: [m/s^2].

    Raises:
        InputError: a mass or gravity that is not positive.
    """
    m, g = positive_number(mass, "mass"), positive_number(gravity, "gravity")

    def force(ops: Arithmetic, t: Scalar, X: Matrix, xi: Vector) -> Vector:
        thrust, moment, *_ = law.evaluate(ops, X, xi, *reference.evaluate(ops, t))
        weight = number(ops, m) * number(ops, g)
        return [*moment, weight * X[2][0], weight * X[2][1], weight * X[2][2] - thrust]

    return force


def _law(
    ops: Arithmetic,
    m: Scalar,
    g: Scalar,
    inertia: Matrix,
    k: Mapping[str, Scalar],
    X: Matrix,
    xi: Vector,
    reference: Sequence[Vector],
) -> tuple[Any, ...]:
    x_d, v_d, a_d, j_d, s_d, *heading = reference
    R, x = [row[:3] for row in X[:3]], [row[3] for row in X[:3]]
    Omega, v = list(xi[:3]), matvec(R, xi[3:])
    axis = [row[2] for row in R]
    spin = [row[2] for row in matmul(R, _hat(Omega))]  # (R e_3)' = R Omega^ e_3
    e_x, e_v = minus(x, x_d), minus(v, v_d)
    down = [0, 0, g]
    A = plus(scaled(-k["k_x"], e_x), scaled(-k["k_v"], e_v), scaled(m, minus(a_d, down)))
    thrust = -dot(A, axis)
    gap = minus(minus(down, scaled(thrust / m, axis)), a_d)  # v' - x_d''
    A_1 = plus(scaled(-k["k_x"], e_v), scaled(-k["k_v"], gap), scaled(m, j_d))
    thrust_1 = -dot(A_1, axis) - dot(A, spin)
    gap_1 = minus(plus(scaled(-thrust_1 / m, axis), scaled(-thrust / m, spin)), j_d)
    A_2 = plus(scaled(-k["k_x"], gap), scaled(-k["k_v"], gap_1), scaled(m, s_d))
    R_c, W_c, W_c_dot = _commanded(ops, (A, A_1, A_2), heading)
    J = inertia
    turn = matmul(transpose(R), R_c)  # R' R_c
    e_R = scaled(ops.constant(sp.Rational(1, 2)), _vee_difference(transpose(turn)))
    rate = matvec(turn, W_c)
    e_W = minus(Omega, rate)
    forward = matvec(J, minus(cross(Omega, rate), matvec(turn, W_c_dot)))
    moment = plus(scaled(-k["k_R"], e_R), scaled(-k["k_W"], e_W), minus(cross(Omega, matvec(J, Omega)), forward))
    Psi = (3 - (turn[0][0] + turn[1][1] + turn[2][2])) / 2
    return thrust, moment, Psi, rate


def _commanded(ops: Arithmetic, A: Sequence[Vector], heading: Sequence[Vector]) -> tuple[Matrix, Vector, Vector]:
    """R_c, Omega_c and Omega_c' by two nested dual numbers of time."""
    inner = DualArithmetic(ops)
    outer = DualArithmetic(inner)

    def moving(value: Vector, first: Vector, second: Vector) -> Vector:
        return [
            outer.variable(inner.variable(a, {0: b}), {0: inner.variable(b, {0: c})})
            for a, b, c in zip(value, first, second, strict=True)
        ]

    a, b_1 = moving(A[0], A[1], A[2]), moving(heading[0], heading[1], heading[2])
    b_3 = scaled(-1 / outer.sqrt(dot(a, a)), a)
    side = cross(b_3, b_1)
    b_2 = scaled(1 / outer.sqrt(dot(side, side)), side)
    frame = transpose([cross(b_2, b_3), b_2, b_3])

    def part(entry: Scalar, outer_rate: bool, inner_rate: bool) -> Scalar:
        level = tangent_of(entry, 0, outer.level) if outer_rate else value_of(entry, outer.level)
        return tangent_of(level, 0, inner.level) if inner_rate else value_of(level, inner.level)

    R_c, R_1, R_2 = (
        [[part(entry, o, i) for entry in row] for row in frame]
        for o, i in ((False, False), (True, False), (True, True))
    )
    half = ops.constant(sp.Rational(1, 2))
    back = transpose(R_c)
    # R_c' R_c'' = hat(Omega_c') + hat(Omega_c)^2, and the square is symmetric.
    velocity, acceleration = (scaled(half, _vee_difference(matmul(back, rate))) for rate in (R_1, R_2))
    return R_c, velocity, acceleration


def _hat(w: Vector) -> Matrix:
    return [[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]]


def _vee_difference(A: Matrix) -> Vector:
    """(A - A')^v."""
    return [A[2][1] - A[1][2], A[0][2] - A[2][0], A[1][0] - A[0][1]]


def _sample(rng: random.Random) -> tuple[Any, ...]:
    def vector(size: float) -> list[float]:
        return [rng.uniform(-size, size) for _ in range(3)]

    X = [[float(i == j) for j in range(4)] for i in range(4)]
    for i, entry in enumerate(vector(1)):
        X[i][3] = entry
    return (X, vector(0.5) + vector(0.5), *(vector(0.5) for _ in range(5)), [1.0, 0.0, 0.0], vector(0.2), vector(0.2))
