"""The strict Lyapunov function of the attitude laws with a cross term, and its rate along the closed loop."""

from __future__ import annotations

from typing import Any

from lie_codegen.control.attitude import gyroscopic_factor
from lie_codegen.control.attitude_ports import ATTITUDE, RATE, body_inertia_parameter, random_rotation, units_of_gains
from lie_codegen.exact.positive_matrix import positive_number
from lie_codegen.groups.maps.rotation_log import rotation_log
from lie_codegen.kernel.arithmetic import Arithmetic
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
    plus,
    scaled,
)
from lie_codegen.kernel.parameter import input_ports, parameter, sample_inputs, values_of


@kernel_factory(units=units_of_gains)
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
        body_inertia_parameter(inertia, False),
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
        inputs=(ATTITUDE, RATE, *input_ports(parameters)),
        outputs=(Port("V", (), "J"), Port("V_dot", (), "W")),
        body=body,
        formula="V = k_p |theta|^2/2 + omega' I omega/2 + epsilon theta' I omega, and dV/dt along the closed loop",
        source="Geyer, The Attitude Control Problem, proof of Proposition 21",
        sampler=lambda rng: (
            random_rotation(rng),
            [rng.uniform(-1, 1) for _ in range(3)],
            *sample_inputs(parameters, rng),
        ),
    )
